r"""A step with a few contacts in or beyond their layers: their integral equations.

Let u = Phi q be the modes of the structure without contacts, with a diagonal Gamma, and f_k the
force of contact k on its distance x_k, which pushes along e_k. The motion of mode j from q_j, q_j'
at the start of a step of length h is

    q_j(t) = C_j(t) q_j + S_j(t) q_j' + int_0^t S_j(t - s) (g_j G(s) - sum_k a_kj f_k(s)) ds,

g = Phi^-1 f the modes of the forcing, a_k = Phi^-1 e_k. S_j is the response to a unit impulse, C_j
= S_j' + Gamma_j S_j. All else of the structure is linear, so that the f_k of the r contacts that
may push during the step are all that is unknown: with the modal row d_k Phi of a distance,

    x_k(t) = (free motion)_k - sum_l int_0^t w_kl(t - s) f_l(s) ds,

    w_kl = sum_j (d_k Phi)_j S_j a_lj,

r coupled Volterra equations, whatever the number of modes. The free motion is linear in q, q' and
the pairs of the forcing, and known from `tables`. Each f_l is replaced by the polynomial through
its values at the `N_NODES` Gauss nodes c_i of the step (exponential collocation: M. Hochbruck and
A. Ostermann, Appl. Numer. Math. 53 (2005) 323)::

    x_ki = free_ki - sum_l sum_p W_kl[p, i] f_l(x_lp),
    W_kl[p, i] = int_0^(c_i h) w_kl(c_i h - s) l_p(s / h) ds.

They are solved by iteration. Where contacts push only what they refer to, w_kl begins with t^3 for
k != l: k iterations reduce an error by (h^2 |df/dx|)^k / (2 k)! as for one; where they are oblique
the sum of their stiffnesses stands for |df/dx|. A contact that stays closed is one of the r: its
force, linear, is solved with the others.

The nodes make the state at the end right to the order of their rule, 2 N_NODES. The error of that
rule is of the order of the square of that of the polynomial, which is measured at both ends of the
step, where f is known. A step takes some r (2 n + r k) products of 16 numbers, k the iterations.

The tangent map is the derivative of the same: with s_k = df_k/dx_k at the nodes, the same equations
for forces s_k x_k, column by column, in modes.

Motion along parts of a step in modes, for what is gathered, at the nodes of collocated steps.

The forces of a step are polynomials, so that a mode's coordinate and speed at any time are sums of
their values at the nodes, by tables of a length of step. A step is planned for 16 nodes, with E = 3
(`scheme`); on its halves E is 4 or more, on its quarters as on a collocated one.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    greatest,
    load,
    local_matrix,
    local_vector,
    maximum,
    modulus,
    store,
    total,
)
from hpcsweep.model.contact import (
    FAR,
    contact_force,
    contact_forces,
    contact_stiffness,
    contact_stiffnesses,
)
from hpcsweep.solvers.flow.layer.volterra.tables import have_part, have_tables
from hpcsweep.solvers.flow.rules.volterra_rule import AT_END, AT_START, N_NODES, NODES
from hpcsweep.solvers.flow.state.tables import ZERO
from hpcsweep.solvers.flow.state.workspace import MOST

GOES_ON, CONVERGED, FAILED = range(3)
"""What `_judged` says of an iteration."""
MAX_ITERATIONS = 60
ROUNDING = 2e-17
"""Remaining error of the distances (gaps): that of displacements about the gap is 1e-16."""
VARIED = 1e-13
"""Last change of a variation of the distances, relative."""
MEASURED = 0.1
"""Measured error of a step, over h times the square of the error of extrapolation to its ends (over
beta / rho): 0.05 to 0.3 where that is 1e-9, less where it is smaller."""
TINY = 1e-300


@inlined
def _less_responses(low, high, table, place, forces):
    """Return distances, in two registers, less the responses to `forces` at the nodes."""
    first = place * N_NODES * N_NODES
    low_odd, high_odd = load(ZERO, 0), load(ZERO, 0)
    for k in range(0, N_NODES, 2):
        at = first + k * N_NODES
        even, odd = -forces[k], -forces[k + 1]
        low = fma(load(table, at), even, low)
        high = fma(load(table, at + LANES), even, high)
        low_odd = fma(load(table, at + N_NODES), odd, low_odd)
        high_odd = fma(load(table, at + N_NODES + LANES), odd, high_odd)
    return low + low_odd, high + high_odd


@inlined
def _largest_of(low, high):
    """Return the largest modulus."""
    return maximum(greatest(modulus(low), modulus(high)))


@inlined
def _judged(change, previous, iteration, square):
    """Return whether an iteration for forces has `CONVERGED`, has `FAILED`, or `GOES_ON`.

    Parameters
    ----------
    change, previous : float
        Largest changes of a distance by this iteration, counted from 0, and by the one before.
    square : float
        h^2 times the largest |df/dx|.
    """
    if not change < math.inf:
        return FAILED
    # the next change is smaller by at least
    ratio = square / ((2 * iteration + 3) * (2 * iteration + 4))
    if change * min(ratio, 1.0) <= ROUNDING:
        return CONVERGED
    if ratio < 0.5 and change >= previous:
        return CONVERGED if change <= 100.0 * ROUNDING else FAILED
    return GOES_ON


@inlined
def _size_of(x):
    """Return the largest distance or speed, at least 1 (gap)."""
    size = 1.0
    for k in range(x.shape[1]):
        size = max(size, abs(x[0, k]), abs(x[1, k]))
    return size


@inlined
def _error_of_rule(h, r, to_end, x, contacts, rho, own):
    """Estimate the error of a distance by the rule, from the forces at an end; see the module.

    Parameters
    ----------
    h : float
    r : int
    to_end : ndarray, shape (N_NODES,)
        `AT_START` or `AT_END`: extrapolates the force from the nodes.
    x : ndarray, shape (2, m)
        The distances at that end.
    contacts : Contacts
    rho : float
    own : Volterra
        With the forces at the nodes.
    """
    worst = 0.0
    for i in range(r):
        k, at = own.which[i], i * N_NODES
        low, high = load(own.forces, at), load(own.forces, at + LANES)
        extrapolated = total(fma(load(to_end, 0), low, load(to_end, LANES) * high))
        miss = abs(extrapolated - contact_force(x[0, k], contacts.beta[k], rho))
        scale = max(min(_largest_of(low, high), contacts.beta[k] / rho), TINY)
        worst = max(worst, contacts.gain[k] * miss * min(miss / scale, 1.0))
    return MEASURED * h * worst


@inlined
def _free_motion(level, r, modes, pairs, spectrum, own, out):
    """Write what the distances of the contacts would be, plus their gaps, without their forces.

    `pairs` is how many of ``modes`` behind the modes count.
    """
    (n, width), linear = spectrum.to_modes.shape, own.linear
    for i in range(r):
        first = (level * linear.shape[1] + own.which[i]) * linear.shape[2] * N_NODES
        for b in range(0, N_NODES, LANES):
            at, start = i * N_NODES + b, first + b
            combine(out, at, ZERO, 0, 1.0, linear, start, N_NODES, modes, 0, n)
            start += width * N_NODES
            combine(out, at, out, at, 1.0, linear, start, N_NODES, modes, width, n)
            start += width * N_NODES
            combine(out, at, out, at, 1.0, linear, start, N_NODES, modes, 2 * width, pairs)


@inlined
def _end_of_step(level, r, modes, units, forces, spectrum, own, out):
    """Write the modes at the end of a step from those at its start and the forces at its nodes.

    `units` of a mode count, see `tables`.
    """
    width, steps, late, kicks = spectrum.squares.shape[0], own.steps, own.late, spectrum.kicks
    every = steps.shape[2]
    for p in range(0, width, LANES):
        at, q, v = level * 2 * every * width + p, load(modes, p), load(modes, width + p)
        after = fma(load(steps, at), q, load(steps, at + width) * v)
        to = at + every * width
        speed = fma(load(steps, to), q, load(steps, to + width) * v)
        for unit in range(2, units):
            number = modes[2 * width + unit - 2]
            after = fma(load(steps, at + unit * width), number, after)
            speed = fma(load(steps, to + unit * width), number, speed)
        at = level * 2 * N_NODES * width + p
        for node in range(N_NODES):
            push = load(ZERO, 0)
            for i in range(r):
                kick = load(kicks, own.which[i] * width + p)
                push = fma(kick, -forces[i, node], push)
            after = fma(load(late, at + node * width), push, after)
            speed = fma(load(late, at + (N_NODES + node) * width), push, speed)
        store(out, p, after)
        store(out, width + p, speed)


@inlined
def _respond(i, level, r, free, forces, own):
    """Return the distance of a contact at the nodes, in two registers, by the forces."""
    low, high = load(free, i * N_NODES), load(free, i * N_NODES + LANES)
    for other in range(r):
        place = own.place[level, own.which[i], own.which[other]] - 1
        low, high = _less_responses(low, high, own.responses, place, forces[other])
    return low, high


@inlined
def _write_forces(r, beta, rho, own):
    """Write the forces at the nodes from the distances there."""
    for i in range(r):
        for at in range(i * N_NODES, (i + 1) * N_NODES, LANES):
            store(own.forces, at, contact_forces(load(own.x, at), beta[own.which[i]], rho))


@kernel
def _solve(level, h, r, square, allowed, model, free, own):
    """Solve for distances and forces at the nodes; return whether they are found and good enough.

    The forces of the second iteration tell already what the rule misses at the start.
    """
    x, previous, beta, rho = own.x, math.inf, model.contacts.beta, model.rho
    for iteration in range(MAX_ITERATIONS):
        _write_forces(r, beta, rho, own)
        if iteration == 1 and allowed < _error_of_rule(
            h, r, AT_START, own.distances, model.contacts, rho, own
        ):
            return False
        change = 0.0
        for i in range(r):
            low, high = _respond(i, level, r, free, own.forces, own)
            at = i * N_NODES
            change = max(change, _largest_of(low - load(x, at), high - load(x, at + LANES)))
            store(x, at, low)
            store(x, at + LANES, high)
        outcome = _judged(change, previous, iteration, square)
        if outcome == FAILED:
            return False
        if outcome == CONVERGED:
            _write_forces(r, beta, rho, own)
            return True
        previous = change
    return False


@kernel
def write_distances(modes, model, spectrum, out):
    """Write the distances of all contacts, and their speeds, by modes."""
    contacts, width = model.contacts, spectrum.squares.shape[0]
    eight = local_matrix(2, LANES)
    stops, n, m = spectrum.stops, spectrum.stops.shape[0], contacts.row.shape[0]
    for first in range(0, stops.shape[1], LANES):
        for half in range(2):
            at = half * LANES
            combine(eight, at, ZERO, 0, 1.0, stops, first, stops.shape[1], modes, half * width, n)
        for k in range(first, min(first + LANES, m)):
            out[0, k] = contacts.sign[k] * eight[0, k - first] - contacts.gap[k]
            out[1, k] = contacts.sign[k] * eight[1, k - first]


@kernel
def write_accelerations(ground, modes, model, spectrum, x):
    """Write the accelerations of the distances x where G is `ground` into x[2]."""
    contacts, width = model.contacts, spectrum.squares.shape[0]
    bend = local_vector(width)
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
    stops, n, eight = spectrum.stops, spectrum.stops.shape[0], local_vector(LANES)
    for first in range(0, stops.shape[1], LANES):
        combine(eight, 0, ZERO, 0, 1.0, stops, first, stops.shape[1], bend, 0, n)
        for k in range(first, min(first + LANES, contacts.row.shape[0])):
            x[2, k] = contacts.sign[k] * eight[k - first]


@kernel
def take_step(level, h, r, stiffness, shared, moved, after):
    """Take a step of that length with the r contacts of ``own.which``.

    Parameters
    ----------
    stiffness : float
        Largest |df/dx| expected, or the sum of all.
    moved : ndarray, shape (2, m)
        Receives distances and speeds of all contacts at the end.
    after : ndarray
        Receives the modes there.

    Returns
    -------
    bool
        Whether the error is allowed.
    """
    model, spectrum, own = shared.model, shared.tables.spectrum, shared.volterra
    contacts, rho, x, units = model.contacts, model.rho, own.distances, own.steps.shape[2]
    motion = local_matrix(MOST, N_NODES)
    have_tables(level, h, r, model, spectrum, own)
    _free_motion(level, r, own.modes, units - 2, spectrum, own, motion)
    for i in range(r):
        k = own.which[i]
        force = contact_force(x[0, k], contacts.beta[k], rho)
        change = contact_stiffness(x[0, k], contacts.beta[k], rho) * x[1, k] / 3.0
        for block in range(0, N_NODES, LANES):
            t, at = load(NODES, block) * h, i * N_NODES + block
            free = load(motion, at) - contacts.gap[k]
            store(motion, at, free)
            store(own.x, at, fma(t * t, -0.5 * fma(t, change, force), free))
    allowed = shared.tolerance * _size_of(x)
    if not _solve(level, h, r, h * h * stiffness, allowed, model, motion, own):
        return False
    _end_of_step(level, r, own.modes, units, own.forces, spectrum, own, after)
    write_distances(after, model, spectrum, moved)
    allowed = shared.tolerance * _size_of(moved)
    return _error_of_rule(h, r, AT_END, moved, contacts, rho, own) <= allowed


@kernel
def step_tangent(level, r, model, spectrum, own, tangent):
    """Multiply `tangent`, of columns in modes, by the tangent map of the step taken, in place."""
    (n, width), half, contacts = spectrum.to_modes.shape, tangent.shape[0] // 2, model.contacts
    vector, after = local_vector(2 * width), local_vector(2 * width)
    free, x = local_matrix(MOST, N_NODES), local_matrix(MOST, N_NODES)
    slopes, pushes = local_matrix(MOST, N_NODES), local_matrix(MOST, N_NODES)
    for p in range(2 * width):
        vector[p] = 0.0
    for i in range(r):
        for at in range(i * N_NODES, (i + 1) * N_NODES, LANES):
            stiff = contact_stiffnesses(load(own.x, at), contacts.beta[own.which[i]], model.rho)
            store(slopes, at, stiff)
    for column in range(tangent.shape[1]):
        for j in range(n):
            vector[j], vector[width + j] = tangent[j, column], tangent[half + j, column]
        _free_motion(level, r, vector, 0, spectrum, own, free)
        for at in range(0, r * N_NODES, LANES):
            store(x, at, load(free, at))
        for _ in range(MAX_ITERATIONS):
            for at in range(0, r * N_NODES, LANES):
                store(pushes, at, load(slopes, at) * load(x, at))
            change = size = 0.0
            for i in range(r):
                low, high = _respond(i, level, r, free, pushes, own)
                at = i * N_NODES
                change = max(change, _largest_of(low - load(x, at), high - load(x, at + LANES)))
                size = max(size, _largest_of(low, high))
                store(x, at, low)
                store(x, at + LANES, high)
            if not change > VARIED * size:
                break
        for at in range(0, r * N_NODES, LANES):
            store(pushes, at, load(slopes, at) * load(x, at))
        _end_of_step(level, r, vector, 2, pushes, spectrum, own, after)
        for j in range(n):
            tangent[j, column], tangent[half + j, column] = after[j], after[width + j]


@kernel
def write_part(part, h, level, model, spectrum, own, u, v):
    """Write displacements and velocities of all rows at the nodes of a part of the last step.

    `part` is its place in `volterra_rule.PARTS`, h and `level` are of the whole step.
    """
    have_part(part, level, h, model, spectrum, own)
    modes, seen, forces = own.before, own.seen, own.forces
    (n, width), r, count = spectrum.to_modes.shape, own.last[0], own.seen.shape[4]
    rows, drive = count * LANES, local_vector(count)
    motion, speeds = local_matrix(n, LANES), local_matrix(n, LANES)
    for p in range(N_NODES + 2, count):
        drive[p] = modes[2 * width + p - N_NODES - 2]
    for j in range(n):
        for block in range(0, N_NODES, LANES):
            push = load(ZERO, 0)
            for i in range(r):
                kick = spectrum.kicks[own.which[i], j]
                push = fma(load(forces, i * N_NODES + block), kick, push)
            store(drive, block, push)
        drive[N_NODES], drive[N_NODES + 1] = modes[j], modes[width + j]
        first, at = ((level * seen.shape[1] + part) * n + j) * 2 * rows, j * LANES
        combine(motion, at, ZERO, 0, 1.0, seen, first, LANES, drive, 0, count)
        combine(speeds, at, ZERO, 0, 1.0, seen, first + rows, LANES, drive, 0, count)
    for row in range(u.shape[0]):
        at, shape = row * LANES, row * width
        combine(u, at, ZERO, 0, 1.0, motion, 0, LANES, spectrum.shapes, shape, n)
        combine(v, at, ZERO, 0, 1.0, speeds, 0, LANES, spectrum.shapes, shape, n)
