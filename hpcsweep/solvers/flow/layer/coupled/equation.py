r"""A step with several contacts in or beyond their layers: its integral equations and its tables.

Let u = Phi q be the modes of the structure without contacts, with a diagonal Gamma, and f_k the
force of contact k on its distance x_k, which pushes along e_k. The motion of mode j from q_j, q_j'
at the start of a step of length h is

    q_j(t) = C_j(t) q_j + S_j(t) q_j' + int_0^t S_j(t - s) (g_j G(s) - sum_k a_kj f_k(s)) ds,

g = Phi^-1 f the modes of the forcing, a_k = Phi^-1 e_k. S_j is the response to a unit impulse, C_j
= S_j' + Gamma_j S_j. All else of the structure is linear, so that the f_k of the r contacts that
may push during the step are all that is unknown: with the modal row d_k Phi of a distance,

    x_k(t) = (free motion)_k - sum_l int_0^t w_kl(t - s) f_l(s) ds,

    w_kl = sum_j (d_k Phi)_j S_j a_lj,

r coupled Volterra equations, whatever the number of modes. Each f_l, and G, is replaced by the
polynomial through its values at the `N_NODES` Gauss nodes c_i of the step, as in
`solitary.equation` for one contact::

    x_ki = free_ki - sum_l sum_p W_kl[p, i] f_l(x_lp),
    W_kl[p, i] = int_0^(c_i h) w_kl(c_i h - s) l_p(s / h) ds.

They are solved by iteration. Where contacts push only what they refer to, w_kl begins with t^3 for
k != l: k iterations reduce an error by (h^2 |df/dx|)^k / (2 k)! as for one; where they are oblique
the sum of their stiffnesses stands for |df/dx|. A contact that stays closed is one of the r: its
force, linear, is solved with the others. The end of the step follows by the Gauss rule, and its
error is measured for each force at both ends.

Tables
------
The structure without contacts is one, so tables depend on the length of the step alone, h = h_0
2^(-l / 2) with h_0 = `REACH` over the largest rate of a mode. On such a step the terms of

    S_j(t) = sum_m s_m t^m,    s_0 = 0,  s_1 = 1,

    (m + 1) (m + 2) s_(m+2) = -Gamma_j (m + 1) s_(m+1) - Lambda_j s_m

are below 2^m / m!, and `N_POWERS` of them are exact to rounding. C_j and S_j at the nodes and at
the end are made when a length first occurs; W_kl, of 16 x 16 numbers, when a pair of contacts does.
A step then takes some n (8 + 4 r) products of `LANES` numbers, and r^2 (2 `N_NODES`) an iteration.

The tangent map is the derivative of the same: with s_k = df_k/dx_k at the nodes, the same equations
for forces s_k x_k, column by column, in modes.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, store, total
from hpcsweep.model.contact import FAR, contact_force, contact_forces, contact_stiffnesses
from hpcsweep.solvers.flow.layer.solitary.equation import (
    CONVERGED,
    FAILED,
    MAX_ITERATIONS,
    VARIED,
    error_of_rule,
    judged,
    largest_of,
    less_responses,
)
from hpcsweep.solvers.flow.linear.forcing import SHORT_ANGLE, short_turn
from hpcsweep.solvers.flow.rules.solitary_rule import (
    N_NODES,
    N_POWERS,
    NODE_RESPONSES,
    NODES,
    WEIGHTS,
)
from hpcsweep.solvers.flow.state.tables import ZERO

REACH = 2.0
SHARES = N_NODES * N_NODES


@kernel
def longest_step(spectrum):
    """Return h_0."""
    fastest = 0.0
    for j in range(spectrum.squares.shape[0]):
        rate = max(math.sqrt(abs(spectrum.squares[j])), abs(spectrum.rates[j]))
        fastest = max(fastest, rate)
    return REACH / fastest if fastest > 0.0 else math.inf


@inlined
def write_terms(j, h, spectrum, out):
    """Write the terms of S_j and of S_j' at h."""
    square, rate = spectrum.squares[j], spectrum.rates[j]
    before, value = 0.0, h
    for m in range(N_POWERS):
        out[0, m] = before
        out[1, m] = value * (m + 1) / h
        after = h / (m + 2) * (rate * value - square * h / (m + 1) * before)
        before, value = value, after


@inlined
def sum_at(part, terms):
    """Return S and S' of a mode at a part of the step, a number or Lanes."""
    value = slope = part * 0.0
    for m in range(N_POWERS - 1, -1, -1):
        value, slope = fma(value, part, terms[0, m]), fma(slope, part, terms[1, m])
    return value, slope


@kernel
def build_turns(level, h, spectrum, own):
    """Write what a step of this length makes of modes, and of forces at its nodes."""
    turns, ends = own.turns, own.ends
    for j in range(spectrum.squares.shape[0]):
        terms = own.powers[level, j]
        write_terms(j, h, spectrum, terms)
        rate = spectrum.rates[j]
        for block in range(0, N_NODES, LANES):
            part, weight = load(NODES, block), load(WEIGHTS, block) * h
            s, d = sum_at(part, terms)
            late, speed = sum_at(1.0 - part, terms)
            at = (level * turns.shape[1] * turns.shape[2] + j) * N_NODES + block
            step = turns.shape[2] * N_NODES
            store(turns, at, fma(s, -rate, d))
            store(turns, at + step, s)
            store(turns, at + 2 * step, late * weight)
            store(turns, at + 3 * step, speed * weight)
        s, d = sum_at(1.0, terms)
        ends[level, 0, j], ends[level, 1, j], ends[level, 2, j] = fma(s, -rate, d), s, d
    own.built[level] = 1


@kernel
def build_response(row, sign, kicks, kick, h, spectrum, own):
    """Write the response of a distance to a force, W; return 1 + its place.

    Parameters
    ----------
    row : int
        Of the distance.
    sign : float
    kicks : ndarray
        a of the force in kicks[kick:], flat.
    """
    width, sums, shapes = spectrum.squares.shape[0], own.sums, spectrum.shapes
    for m in range(N_POWERS):
        store(sums, m * LANES, load(ZERO, 0))
    for p in range(0, width, LANES):
        before = load(ZERO, 0)
        value = load(shapes, row * width + p) * load(kicks, kick + p) * (sign * h)
        square, rate = load(spectrum.squares, p), load(spectrum.rates, p)
        for m in range(N_POWERS - 1):
            at = (m + 1) * LANES
            store(sums, at, load(sums, at) + value)
            after = (rate * value - square * before * (h / (m + 1))) * (h / (m + 2))
            before, value = value, after
    terms = own.terms
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
    if own.built[level] == 0:
        build_turns(level, h, spectrum, own)
    if own.count[0] + r * (r + 1) > own.responses.shape[0]:
        own.count[0] = 0
        own.place[:], own.forced[:] = 0, 0
    for i in range(r):
        k = own.which[i]
        row, sign = contacts.row[k], contacts.sign[k]
        if own.forced[level, k] == 0:
            own.forced[level, k] = build_response(row, sign, spectrum.forcing, 0, h, spectrum, own)
        for other in range(r):
            l = own.which[other]  # noqa: E741
            if own.place[level, k, l] == 0:
                kick = l * width
                place = build_response(row, sign, spectrum.kicks, kick, h, spectrum, own)
                own.place[level, k, l] = place


@kernel
def _write_forcing(h, forcing, model, own):
    """Write minus G at the nodes behind the forces of all contacts."""
    (tau, amplitude, pairs), out, row = forcing, own.forces, own.forces.shape[0] - 1
    for block in range(0, N_NODES, LANES):
        value, nodes = load(ZERO, 0), load(NODES, block)
        for k in range(model.harmonics.shape[0]):
            angle = model.harmonics[k, 0] * model.omega * h
            if angle <= SHORT_ANGLE:
                s, c = short_turn(nodes * angle)
                value = value - fma(s, pairs[2 * k + 1], c * pairs[2 * k])
        for k in range(model.ramp.shape[0]):
            at = 2 * (model.harmonics.shape[0] + k)
            value = value - fma(nodes, h * pairs[at + 1], pairs[at])
        store(out, row * N_NODES + block, value)
    for k in range(model.harmonics.shape[0]):
        rate = model.harmonics[k, 0] * model.omega
        if rate * h > SHORT_ANGLE:
            size, phase = amplitude * model.harmonics[k, 1], model.harmonics[k, 2]
            for i in range(N_NODES):
                out[row, i] -= size * math.sin(rate * (tau + NODES[i] * h) + phase)


@kernel
def _free_motion(level, r, modes, model, spectrum, own):
    """Write what the distances of the contacts would be, plus their gaps, without any force."""
    contacts, width, motion, turns = (
        model.contacts,
        spectrum.squares.shape[0],
        own.motion,
        own.turns,
    )
    first, step = level * turns.shape[1] * width * N_NODES, width * N_NODES
    for j in range(width):
        for at in range(j * N_NODES, (j + 1) * N_NODES, LANES):
            turned = load(turns, first + at) * modes[j]
            store(motion, at, fma(load(turns, first + step + at), modes[width + j], turned))
    for i in range(r):
        k = own.which[i]
        row, sign = contacts.row[k] * width, contacts.sign[k]
        for b in range(0, N_NODES, LANES):
            at = i * N_NODES + b
            combine(own.free, at, ZERO, 0, sign, motion, b, N_NODES, spectrum.shapes, row, width)


@kernel
def _end_of_step(level, r, modes, forces, spectrum, own, out):
    """Write the modes at the end of a step from those at its start and the forces at its nodes."""
    width, turns, ends, kicks = spectrum.squares.shape[0], own.turns, own.ends, spectrum.kicks
    first = (level * turns.shape[1] + 2) * width * N_NODES
    last = (forces.shape[0] - 1) * N_NODES
    for j in range(width):
        share = spectrum.forcing[j]
        low, high = load(forces, last) * share, load(forces, last + LANES) * share
        for i in range(r):
            push = kicks[own.which[i], j]
            low = fma(load(forces, i * N_NODES), push, low)
            high = fma(load(forces, i * N_NODES + LANES), push, high)
        at = first + j * N_NODES
        moved = fma(load(turns, at), low, load(turns, at + LANES) * high)
        at += width * N_NODES
        pushed = fma(load(turns, at), low, load(turns, at + LANES) * high)
        q, v, c, s = modes[j], modes[width + j], ends[level, 0, j], ends[level, 1, j]
        out[j] = fma(c, q, fma(s, v, -total(moved)))
        bent = -spectrum.squares[j] * s
        out[width + j] = fma(bent, q, fma(ends[level, 2, j], v, -total(pushed)))


@inlined
def _respond(i, level, r, forces, own):
    """Return the distance of a contact at the nodes, in two registers, by the forces."""
    low, high = load(own.free, i * N_NODES), load(own.free, i * N_NODES + LANES)
    for other in range(r):
        place = own.place[level, own.which[i], own.which[other]] - 1
        low, high = less_responses(low, high, own.responses, place, forces[other])
    return low, high


@kernel
def _solve(level, r, square, beta, rho, own):
    """Solve for distances and forces at the nodes; return whether the iteration converged."""
    forces, x = own.forces, own.x
    previous = math.inf
    for iteration in range(MAX_ITERATIONS):
        for i in range(r):
            for at in range(i * N_NODES, (i + 1) * N_NODES, LANES):
                store(forces, at, contact_forces(load(x, at), beta[own.which[i]], rho))
        change = 0.0
        for i in range(r):
            low, high = _respond(i, level, r, forces, own)
            at = i * N_NODES
            change = max(change, largest_of(low - load(x, at), high - load(x, at + LANES)))
            store(x, at, low)
            store(x, at + LANES, high)
        outcome = judged(change, previous, iteration, square)
        if outcome == FAILED:
            return False
        if outcome == CONVERGED:
            break
        previous = change
    else:
        return False
    for i in range(r):
        for at in range(i * N_NODES, (i + 1) * N_NODES, LANES):
            store(forces, at, contact_forces(load(x, at), beta[own.which[i]], rho))
    return True


@kernel
def write_distances(modes, model, spectrum, own, out):
    """Write the distances of all contacts, and their speeds, by modes; return the largest size."""
    contacts, width, size, eight = model.contacts, spectrum.squares.shape[0], 1.0, own.eight
    stops, n, m = spectrum.stops, spectrum.stops.shape[0], contacts.row.shape[0]
    for first in range(0, stops.shape[1], LANES):
        for half in range(2):
            at = half * LANES
            combine(eight, at, ZERO, 0, 1.0, stops, first, stops.shape[1], modes, half * width, n)
        for k in range(first, min(first + LANES, m)):
            out[0, k] = contacts.sign[k] * eight[0, k - first] - contacts.gap[k]
            out[1, k] = contacts.sign[k] * eight[1, k - first]
            size = max(size, max(abs(out[0, k]), abs(out[1, k])))
    return size


@kernel
def write_accelerations(ground, modes, model, spectrum, own):
    """Write the accelerations of the distances ``own.distances`` where G is `ground`."""
    contacts, width, x, bend = model.contacts, spectrum.squares.shape[0], own.distances, own.bend
    for p in range(0, width, LANES):
        force = fma(
            load(spectrum.rates, p), load(modes, width + p), load(spectrum.forcing, p) * ground
        )
        store(bend, p, force - load(spectrum.squares, p) * load(modes, p))
    for k in range(contacts.row.shape[0]):
        if not model.rho * x[0, k] < -FAR:
            push = contact_force(x[0, k], contacts.beta[k], model.rho)
            for p in range(0, width, LANES):
                kick = load(spectrum.kicks, k * width + p)
                store(bend, p, fma(kick, -push, load(bend, p)))
    stops, n, eight = spectrum.stops, spectrum.stops.shape[0], own.eight
    for first in range(0, stops.shape[1], LANES):
        combine(eight, 0, ZERO, 0, 1.0, stops, first, stops.shape[1], bend, 0, n)
        for k in range(first, min(first + LANES, contacts.row.shape[0])):
            x[2, k] = contacts.sign[k] * eight[0, k - first]


@kernel
def take_step(level, h, r, stiffness, forcing, shared):
    """Take a step of that length with the r contacts of ``own.which``, to ``own.after``.

    Parameters
    ----------
    stiffness : float
        Largest |df/dx| expected, or the sum of all.
    forcing : tuple
        Start of the step, A, and the pairs of the forcing there.

    Returns
    -------
    bool
        Whether the error is allowed.
    """
    model, spectrum, own = shared.model, shared.tables.spectrum, shared.coupled
    contacts, rho, x = model.contacts, model.rho, own.distances
    have_tables(level, h, r, model, spectrum, own)
    _write_forcing(h, forcing, model, own)
    _free_motion(level, r, own.modes, model, spectrum, own)
    ground = own.forces[own.forces.shape[0] - 1]
    for i in range(r):
        k = own.which[i]
        force = contact_force(x[0, k], contacts.beta[k], rho)
        low, high = load(own.free, i * N_NODES), load(own.free, i * N_NODES + LANES)
        low, high = low - contacts.gap[k], high - contacts.gap[k]
        forced = own.forced[level, k] - 1
        low, high = less_responses(low, high, own.responses, forced, ground)
        store(own.free, i * N_NODES, low)
        store(own.free, i * N_NODES + LANES, high)
        for block in range(0, N_NODES, LANES):
            t, at = load(NODES, block) * h, i * N_NODES + block
            store(own.x, at, fma(t * t, -0.5 * force, load(own.free, at)))
    if not _solve(level, r, h * h * stiffness, contacts.beta, rho, own):
        return False
    _end_of_step(level, r, own.modes, own.forces, spectrum, own, own.after)
    size = write_distances(own.after, model, spectrum, own, own.moved)
    worst = 0.0
    for i in range(r):
        k = own.which[i]
        first = contact_force(x[0, k], contacts.beta[k], rho)
        last = contact_force(own.moved[0, k], contacts.beta[k], rho)
        low, high = load(own.forces, i * N_NODES), load(own.forces, i * N_NODES + LANES)
        error = error_of_rule(h, low, high, first, last, contacts.beta[k] / rho)
        worst = max(worst, error * contacts.gain[k])
    return worst <= shared.tolerance * size


@kernel
def coupled_tangent(level, r, model, spectrum, own, tangent):
    """Multiply `tangent`, of columns in modes, by the tangent map of the step taken, in place."""
    width, half, contacts = spectrum.squares.shape[0], tangent.shape[0] // 2, model.contacts
    n, vector, pushes, x = spectrum.to_modes.shape[0], own.vector, own.pushes, own.varied
    for i in range(r):
        for at in range(i * N_NODES, (i + 1) * N_NODES, LANES):
            stiff = contact_stiffnesses(load(own.x, at), contacts.beta[own.which[i]], model.rho)
            store(own.slopes, at, stiff)
    for block in range(0, N_NODES, LANES):
        store(pushes, (pushes.shape[0] - 1) * N_NODES + block, load(ZERO, 0))
    for column in range(tangent.shape[1]):
        for j in range(n):
            vector[j], vector[width + j] = tangent[j, column], tangent[half + j, column]
        _free_motion(level, r, vector, model, spectrum, own)
        for at in range(0, r * N_NODES, LANES):
            store(x, at, load(own.free, at))
        for _ in range(MAX_ITERATIONS):
            for at in range(0, r * N_NODES, LANES):
                store(pushes, at, load(own.slopes, at) * load(x, at))
            change = size = 0.0
            for i in range(r):
                low, high = _respond(i, level, r, pushes, own)
                at = i * N_NODES
                change = max(change, largest_of(low - load(x, at), high - load(x, at + LANES)))
                size = max(size, largest_of(low, high))
                store(x, at, low)
                store(x, at + LANES, high)
            if not change > VARIED * size:
                break
        for at in range(0, r * N_NODES, LANES):
            store(pushes, at, load(own.slopes, at) * load(x, at))
        _end_of_step(level, r, vector, pushes, spectrum, own, own.after)
        for j in range(n):
            tangent[j, column], tangent[half + j, column] = own.after[j], own.after[width + j]
