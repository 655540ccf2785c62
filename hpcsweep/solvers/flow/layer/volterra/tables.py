r"""Tables of steps by their length: what modes, forcing and forces at the nodes do, see `equation`.

On a step of length h = h_0 2^(-l / 2), h_0 = `REACH` over the largest rate of a mode or of the
forcing, the terms of the motion of a mode by any unit of its start, q = 1, q' = 1, or of the
forcing, with t = h s,

    q(t) = sum_m a_m s^m,

    (m + 1) (m + 2) a_(m+2) = -h Gamma_j (m + 1) a_(m+1) - h^2 Lambda_j a_m + h^2 g_j G_m,

are below 2^m / m!, and `N_POWERS` of them are exact to rounding. S_j is the motion by q' = 1.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    load,
    local_matrix,
    local_vector,
    store,
    total,
)
from hpcsweep.solvers.flow.rules.volterra_rule import (
    N_NODES,
    N_PARTS,
    N_POWERS,
    NODE_RESPONSES,
    NODES,
    PART_NODES,
    PART_RESPONSES,
    WEIGHTS,
)
from hpcsweep.solvers.flow.state.tables import ZERO

REACH = 2.0
SHARES = N_NODES * N_NODES
PLACE, SPEED, PAIRS = range(3)
"""Units of a mode: q, q', and from the third on the pairs of the forcing."""


@kernel
def longest_step(model, spectrum):
    """Return h_0."""
    fastest = 0.0
    for j in range(spectrum.squares.shape[0]):
        rate = max(math.sqrt(abs(spectrum.squares[j])), abs(spectrum.rates[j]))
        fastest = max(fastest, rate)
    for k in range(model.harmonics.shape[0]):
        fastest = max(fastest, model.harmonics[k, 0] * model.omega)
    return REACH / fastest if fastest > 0.0 else math.inf


@kernel
def _write_terms(j, unit, h, model, spectrum, out):
    """Write the terms of q, and of q', of a mode by a unit, see the module."""
    square, rate = spectrum.squares[j] * h * h, spectrum.rates[j] * h
    before, value = 1.0 if unit == PLACE else 0.0, h if unit == SPEED else 0.0
    push = spectrum.forcing[j] * h * h if unit >= PAIRS else 0.0
    pair, n_turning = (unit - PAIRS) // 2, model.harmonics.shape[0]
    second = (unit - PAIRS) % 2 == 1
    turned = model.harmonics[pair, 0] * model.omega * h if pair < n_turning and push != 0.0 else 0.0
    term = 1.0
    for m in range(N_POWERS):
        ground = 0.0
        if pair < n_turning:
            if m > 0:
                term *= turned / m
            if (m % 2 == 1) == second:
                ground = term if m % 4 < 2 else -term
        elif m == (1 if second else 0):
            ground = h if second else 1.0
        out[0, m], out[1, m] = before, value * (m + 1) / h
        after = rate * value - (square * before - push * ground) / (m + 1)
        before, value = value, after / (m + 2)


@inlined
def _sum_at(part, terms):
    """Return q and q' at a part of the step, a number or Lanes."""
    value = slope = part * 0.0
    for m in range(N_POWERS - 1, -1, -1):
        value, slope = fma(value, part, terms[0, m]), fma(slope, part, terms[1, m])
    return value, slope


@kernel
def _build_step(level, h, model, spectrum, own):
    """Write the ends of steps of a length: by units of modes, and by forces at the nodes."""
    steps, late, terms = own.steps, own.late, local_matrix(2, N_POWERS)
    for j in range(spectrum.to_modes.shape[0]):
        for unit in range(steps.shape[2]):
            _write_terms(j, unit, h, model, spectrum, terms)
            value, slope = _sum_at(1.0, terms)
            steps[level, 0, unit, j], steps[level, 1, unit, j] = value, slope
            if unit == SPEED:
                for node in range(N_NODES):
                    value, slope = _sum_at(1.0 - NODES[node], terms)
                    late[level, 0, node, j] = value * WEIGHTS[node] * h
                    late[level, 1, node, j] = slope * WEIGHTS[node] * h
    own.built[level, 0] = 1


@kernel
def _build_linear(level, k, h, model, spectrum, own):
    """Write the distance of contact k at the nodes of steps of a length by units of all modes."""
    (n, width), contacts = spectrum.to_modes.shape, model.contacts
    rows, terms = own.linear.shape[2], local_matrix(2, N_POWERS)
    first = (level * own.linear.shape[1] + k) * rows * N_NODES
    for j in range(n):
        share = contacts.sign[k] * spectrum.shapes[contacts.row[k], j]
        for unit in range(own.steps.shape[2]):
            _write_terms(j, unit, h, model, spectrum, terms)
            row = unit * width + j if unit < PAIRS else 2 * width + unit - PAIRS
            for block in range(0, N_NODES, LANES):
                value, _ = _sum_at(load(NODES, block), terms)
                at = first + row * N_NODES + block
                store(own.linear, at, fma(value, share, load(own.linear, at)))
    own.built[level, 1 + N_PARTS + k] = 1


@kernel
def _build_response(row, sign, kick, h, spectrum, own):
    """Write the response of a distance to a force, W; return 1 + its place.

    Parameters
    ----------
    row : int
        Of the distance.
    sign : float
    kick : int
        Place of a of the force in ``spectrum.kicks``, flat.
    """
    width, sums, shapes = spectrum.squares.shape[0], local_matrix(N_POWERS, LANES), spectrum.shapes
    for m in range(N_POWERS):
        store(sums, m * LANES, load(ZERO, 0))
    for p in range(0, width, LANES):
        before = load(ZERO, 0)
        value = load(shapes, row * width + p) * load(spectrum.kicks, kick + p) * (sign * h)
        square, rate = load(spectrum.squares, p), load(spectrum.rates, p)
        for m in range(N_POWERS - 1):
            at = (m + 1) * LANES
            store(sums, at, load(sums, at) + value)
            after = (rate * value - square * before * (h / (m + 1))) * (h / (m + 2))
            before, value = value, after
    terms = local_vector(N_POWERS)
    for m in range(N_POWERS):
        terms[m] = total(load(sums, m * LANES))
    place = own.count[0]
    own.count[0] = place + 1
    for at in range(0, SHARES, LANES):
        to = place * SHARES + at
        combine(own.responses, to, ZERO, 0, h, NODE_RESPONSES, at, SHARES, terms, 0, N_POWERS)
    return place + 1


@kernel
def have_tables(level, h, r, model, spectrum, own):
    """Build what a step of this length with the r contacts of ``own.which`` needs, if it is not."""
    contacts, width = model.contacts, spectrum.squares.shape[0]
    if own.built[level, 0] == 0:
        _build_step(level, h, model, spectrum, own)
    if own.count[0] + r * r > own.responses.shape[0]:
        own.count[0] = 0
        own.place[:] = 0
    for i in range(r):
        k = own.which[i]
        row, sign = contacts.row[k], contacts.sign[k]
        if own.built[level, 1 + N_PARTS + k] == 0:
            _build_linear(level, k, h, model, spectrum, own)
        for other in range(r):
            l = own.which[other]  # noqa: E741
            if own.place[level, k, l] == 0:
                place = _build_response(row, sign, l * width, h, spectrum, own)
                own.place[level, k, l] = place


@kernel
def have_part(part, level, h, model, spectrum, own):
    """Build the table of a part of the steps of a length, if it is not."""
    if own.built[level, 1 + part] > 0:
        return
    seen, terms, step = own.seen, local_matrix(2, N_POWERS), N_NODES * LANES
    nodes, rows = load(PART_NODES, part * LANES), seen.shape[4] * LANES
    for j in range(seen.shape[2]):
        first = ((level * seen.shape[1] + part) * seen.shape[2] + j) * 2 * rows
        for unit in range(own.steps.shape[2]):
            _write_terms(j, unit, h, model, spectrum, terms)
            value, slope = _sum_at(nodes, terms)
            at = first + (N_NODES + unit) * LANES
            store(seen, at, value)
            store(seen, at + rows, slope)
            if unit == SPEED:
                for node in range(N_NODES):
                    place, to = part * N_POWERS * step + node * LANES, first + node * LANES
                    by, table = -h, PART_RESPONSES
                    combine(seen, to, ZERO, 0, by, table, place, step, terms, 0, N_POWERS)
                    to, m = to + rows, N_POWERS
                    combine(seen, to, ZERO, 0, by, table, place, step, terms, m, N_POWERS)
    own.built[level, 1 + part] = 1
