r"""Slow passage of one contact through its layer: along the exact linear motions of both sides.

On either side of the stop the motion is that of the contact set there, x' = M x, and the force
r(x) of `crossing`, which is at most 0.28 beta / rho. Let p(s) be the distance in the linear motion,
about the time 0 at which the contact is at the stop. By variation of constants the true distance
is, on the way to the stop (s < 0) and on the way from it,

    p(s) + int_-inf^s g(s - t) r dt,      p(s) + int_0^s g(s - t) r dt,      g(t) = d exp(M t) e,

and the state at s = 0 changes by int exp(-M s) e r ds, from that of the linear motion to the true
one or back. The contact need not be at the stop exactly then: r(x) = beta q x / (1 + exp(rho q x)),
q = -1 before and 1 beyond it, is the difference of the true and the linear force on both sides of
the stop. A passage is one half after the other.

With y = rho |p(s) - p(0)| as variable of integration, ds = dy / (rho |p'|), all integrals have the
weight 1 / (1 + exp(y)), whose Gauss rule on [0, `REACH`] is the same for all passages, and what is
left is smooth: at the true distance, rho q x = y - delta,

    r(x) = beta / rho (y - delta) / (1 + exp(y)) / (1 + S(y) (exp(-delta) - 1)).

`ARRIVING` and `DEPARTING` integrate, from the far end and from the stop to each node, the
polynomial through the values at the nodes. The integral equation is solved by iteration, which
gains a factor of the order of delta each time. p and exp(M s) e are Taylor series (`series`) of
`LANES` terms. Tangent vectors obey the same equations with r' and g, at the same nodes.

With slow passages integrated instead, 20 frames take 13.5 % more processor time with the damping as
printed (18.13 s for 15.97 s), 8.6 % as described (37.57 s for 34.58 s).

Tangent map of half a slow passage (`slow_passage`)
---------------------------------------------------
A variation of the distance is that of the linear motion plus the response to the variations r'(x)
dx of the force, at the nodes of the passage.
"""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    greatest,
    load,
    maximum,
    modulus,
    negative,
    root,
    store,
    total,
)
from hpcsweep.model.contact import FULL_POTENTIAL
from hpcsweep.solvers.flow.passage.crossing import NEGLECTED
from hpcsweep.solvers.flow.rules.gauss import (
    ARRIVING,
    DEPARTING,
    DERIVATIVE_EXCESS,
    N_PASSAGE,
    NODES,
    REACH,
    SWITCHED,
    WEIGHTS,
)
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import start
from hpcsweep.solvers.flow.state.tables import ZERO

FALL = 0.9
"""Largest part of the square of the speed that may be lost up to `REACH`."""
RISE = 3.0
"""Least y at which it may have doubled."""
SLOWEST = 0.2
"""Least speed of the linear motion at the nodes, in units of that at the stop."""
DISPLACED = 0.1
"""Largest delta; its exponential is a polynomial."""
SWEEPS = 5
SETTLED = 1e-6
"""Change of delta after which one more sweep is the last. In the passages tried, delta up to 0.01,
each changed it at least 2,000 times less than the previous one."""
EXPONENTIAL = (-1.0 / 720.0 / 7.0, 1.0 / 720.0, -1.0 / 120.0, 1.0 / 24.0, -1.0 / 6.0, 0.5, -1.0)
"""(exp(-delta) - 1) / delta, descending orders."""


@kernel
def half_is_smooth(v, a, j, is_beyond, contact, model):
    """Return whether half a passage may be taken along the linear motion of its side.

    Up to `REACH` the square of the speed may fall by `FALL` of itself at most, and double no sooner
    than at `RISE`: the rule is then right to 2e-12 of the impulse J (tried on (1 - y / y_0)^ (-1/2)
    and (1 - (y / y_0)^2)^(-1/2), y_0 at these bounds), and to 2e-8 where the layer's own potential
    changes the speed. The series leave out 9 (kappa t^2)^4 J at first, t = 1 / (rho |v|) and kappa
    = beta + |K| beyond the stop, |K| before it, or the square of the fastest decay or forcing.
    Contacts that push each other are excluded: the bounds of `apart.is_alone` do not cover them.

    Parameters
    ----------
    v, a, j : float
        Speed of the distance at the stop, its acceleration and jerk without the contact's force.
    is_beyond : bool
        Which side.
    contact : int
    model : Model
    """
    contacts, rho = model.contacts, model.rho
    beta = contacts.beta[contact]
    reach = REACH / rho
    speed, square = abs(v), v * v
    potential = 2.0 * FULL_POTENTIAL * beta / (rho * rho)
    along = a if is_beyond else -a
    fall = (2.0 * max(-along, 0.0) + abs(j) * reach / speed) * reach + potential
    stiffness = model.stiffness_bound
    if is_beyond:
        fall += beta * reach * reach
        stiffness += beta
    fastest = max(model.energy.drag, model.omega)
    for h in range(model.harmonics.shape[0]):
        fastest = max(fastest, model.harmonics[h, 0] * model.omega)
    if contacts.is_oblique:
        return False
    if not (fall <= FALL * square and 2.0 * max(along, 0.0) * RISE <= rho * square):
        return False
    phase = max(stiffness, fastest * fastest) / (rho * rho * square)
    impulse = potential / speed * contacts.gain[contact]
    left_out = 9.0 * phase**4 + 2e-12 + 2e-8 * potential / square
    return impulse * left_out <= NEGLECTED


@kernel
def passage_is_smooth(v, a, j, contact, model):
    """Return whether a whole passage may be taken so; it must also leave its layer at once."""
    beta, layer = model.contacts.beta[contact], model.layer
    speed, square = abs(v), v * v
    change = (2.0 * abs(a) + abs(j) * layer / speed + beta * layer) * layer
    return (
        change <= FALL * square
        and half_is_smooth(v, a, j, False, contact, model)
        and half_is_smooth(v, a, j, True, contact, model)
    )


@inlined
def _distance_and_rates(b, t):
    """Evaluate distance covered, speed and acceleration at times t (Lanes) from the series b."""
    value, slope, bend = t * 0.0 + b[LANES - 1], t * 0.0, t * 0.0
    for k in range(LANES - 2, -1, -1):
        bend = fma(bend, t, slope)
        slope = fma(slope, t, value)
        value = fma(value, t, b[k])
    return value, slope, 2.0 * bend


@inlined
def expand_series(direction, side, first, x, tables, work):
    """Write the series of side p(direction t) into ``work.series``."""
    b = work.series
    combine(b, 0, ZERO, 0, 1.0, tables.series, first, LANES, x, 0, x.shape[0])
    factor = side
    for k in range(LANES):
        b[k] *= factor
        factor *= direction


@inlined
def _find_times(beta, rho, work):
    """Find the times at which the linear motion is at the nodes; return False if it misses one."""
    b, times, shares = work.series, work.times, work.shares
    speed = b[1]
    if not speed * speed + 4.0 * b[2] * REACH / rho > SLOWEST * SLOWEST * speed * speed:
        return False
    slow = 0
    for block in range(0, N_PASSAGE, LANES):
        x = load(NODES, block) * (1.0 / rho)
        t = 2.0 * x / (speed + root(fma(x, 4.0 * b[2], speed * speed)))
        gone, w, bend = _distance_and_rates(b, t)
        gone = gone - x
        t = t - 2.0 * gone * w / fma(2.0 * w, w, -1.0 * gone * bend)
        gone, w, bend = _distance_and_rates(b, t)
        t = t - (gone - x) / w
        gone, w, bend = _distance_and_rates(b, t)
        slow += negative(w - SLOWEST * speed)
        store(times, block, t)
        store(shares, block, beta / (rho * rho) / w)
    return slow == 0


@inlined
def respond(values, initial, work):
    """Write `initial` plus the response to forces at the nodes into ``work.moved``.

    Returns
    -------
    float
        The largest change.
    """
    change = load(ZERO, 0)
    for block in range(0, N_PASSAGE, LANES):
        even, odd = load(initial, block), load(ZERO, 0)
        for node in range(0, N_PASSAGE, 2):
            even = fma(load(work.response, node * N_PASSAGE + block), values[node], even)
            odd = fma(load(work.response, (node + 1) * N_PASSAGE + block), values[node + 1], odd)
        change = greatest(change, modulus(even + odd - load(work.moved, block)))
        store(work.moved, block, even + odd)
    return maximum(change)


@inlined
def sum_up(direction, first, tables, work):
    """Write the effect of the forces at the nodes on the state at the stop into ``work.kicked``."""
    times, forces = work.times, work.forces
    low, high = load(forces, 0) * load(WEIGHTS, 0), load(forces, LANES) * load(WEIGHTS, LANES)
    t_low, t_high = load(times, 0) * -direction, load(times, LANES) * -direction
    for k in range(LANES):
        work.moments[k] = total(low + high)
        low, high = low * t_low, high * t_high
    width = tables.impulses.shape[3]
    for block in range(0, width, LANES):
        combine(
            work.kicked,
            block,
            ZERO,
            0,
            1.0,
            tables.impulses,
            first + block,
            width,
            work.moments,
            0,
            LANES,
        )


@inlined
def _exponential_less_one(delta):
    """Evaluate exp(-delta) - 1 of Lanes."""
    series = fma(delta, EXPONENTIAL[0], EXPONENTIAL[1])
    for k in range(2, len(EXPONENTIAL)):
        series = fma(delta, series, EXPONENTIAL[k])
    return series * delta


@inlined
def take_half(direction, index, contact, model, tables, work):
    """Compute the effect of r on the state ``work.x`` on one side of the stop, in ``work.kicked``.

    Parameters
    ----------
    direction : float
        -1 on the way to the stop, 1 on the way from it.
    index : int
        Index of the table of that side.
    contact : int
    model : Model
    tables : Tables
    work : HalfPassage

    Returns
    -------
    bool
        Whether the passage fulfils the conditions of the module.
    """
    contacts, rho = model.contacts, model.rho
    beta, sign, row = contacts.beta[contact], contacts.sign[contact], contacts.row[contact]
    b, times, shares, moved = work.series, work.times, work.shares, work.moved
    place = index * contacts.row.shape[0] + contact
    first = place * work.x.shape[0] * LANES
    v = sign * work.x[model.stiffness.shape[0] + row]
    side = direction if v > 0.0 else -direction
    expand_series(direction, side, first, work.x, tables, work)
    beyond = side * b[0] - contacts.gap[contact]
    b[0] = 0.0
    if not _find_times(beta, rho, work):
        return False
    # of a unit impulse on the contact's row: what later displaces it, over `later`, by powers of it
    bent = sign * tables.impulses[index, contact, 2, row]
    third = sign * tables.impulses[index, contact, 3, row]
    fourth = sign * tables.impulses[index, contact, 4, row]
    rule = DEPARTING if direction > 0.0 else ARRIVING
    for node in range(N_PASSAGE):
        for block in range(0, N_PASSAGE, LANES):
            later = direction * (load(times, block) - times[node])
            kept = load(rule, node * N_PASSAGE + block) * later
            kept = kept * fma(later, fma(later, fma(later, fourth, third), bent), 1.0)
            store(work.response, node * N_PASSAGE + block, kept)
    initial = work.slopes
    for block in range(0, N_PASSAGE, LANES):
        store(initial, block, beyond)
        store(moved, block, beyond)
    change = math.inf
    for sweep in range(SWEEPS):
        for block in range(0, N_PASSAGE, LANES):
            delta = load(moved, block) * (-side * rho)
            less = fma(load(SWITCHED, block), _exponential_less_one(delta), 1.0)
            store(work.forces, block, load(shares, block) * (load(NODES, block) - delta) / less)
        if sweep == SWEEPS - 1 or change <= SETTLED:
            break
        change = rho * respond(work.forces, initial, work)
    for block in range(0, N_PASSAGE, LANES):
        delta = load(moved, block) * (-side * rho)
        less = _exponential_less_one(delta)
        switched = load(SWITCHED, block)
        part = 1.0 / fma(switched, less, 1.0)
        y = load(NODES, block) - delta
        slope = 1.0 - y * switched * (less + 1.0) * part + load(DERIVATIVE_EXCESS, block)
        store(work.slopes, block, load(shares, block) * part * slope * (side * rho))
        if not maximum(modulus(delta)) <= DISPLACED:
            return False
    sum_up(direction, place * LANES * tables.impulses.shape[3], tables, work)
    return True


@entry_point(INT, FLOAT, INT, INT, VECTOR, BYTES, inner=True, specialises=True)
def cross_half(direction, index, contact, z, shared):
    """Change from the linear motion to the true one at the stop, or back.

    Parameters
    ----------
    direction, index, contact
        As in `take_half`, whose workspace is ``work.arriving`` or ``work.departing``.
    z : ndarray, shape (2R,)
        State; changed on success. ``work.forcing`` has the forcing at that time.
    shared : ndarray of bytes
        A packed `Shared`.

    Returns
    -------
    int
        1, or 0 if the passage does not fulfil the conditions of the module.
    """
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    model, tables, work = common.model, common.tables, common.work
    half = work.departing if direction > 0.0 else work.arriving
    start(half.x, z, work.forcing)
    if not take_half(direction, index, contact, model, tables, half):
        return 0
    for i in range(z.shape[0]):
        z[i] += half.kicked[i]
    return 1


TANGENT_SWEEPS = 7
TANGENT_SETTLED = 1e-10
"""Change after which one more sweep is the last, relative."""


@entry_point(INT, FLOAT, INT, INT, MATRIX, BYTES, inner=True, specialises=True)
def half_tangent(direction, index, contact, tangent, shared):
    """Multiply `tangent` by the tangent map of the half taken last by `cross_half`.

    Parameters
    ----------
    direction, index, contact, shared
        As in `cross_half`.
    tangent : ndarray, shape (2R, m)

    Returns
    -------
    int
        m
    """
    common = read_shared(shared)
    tangent = as_long_as(tangent, common.previous)
    model, tables, workspace = common.model, common.tables, common.work
    work = workspace.departing if direction > 0.0 else workspace.arriving
    contacts = model.contacts
    place = index * contacts.row.shape[0] + contact
    size = tangent.shape[0]
    x, forces, moved, shares = work.x, work.forces, work.moved, work.shares
    for i in range(size, x.shape[0]):
        x[i] = 0.0
    for column in range(tangent.shape[1]):
        for i in range(size):
            x[i] = tangent[i, column]
        expand_series(direction, 1.0, place * x.shape[0] * LANES, x, tables, work)
        for block in range(0, N_PASSAGE, LANES):
            t = load(work.times, block)
            value = t * 0.0 + work.series[LANES - 1]
            for k in range(LANES - 2, -1, -1):
                value = fma(value, t, work.series[k])
            store(shares, block, value)
            store(moved, block, value)
        largest = maximum(greatest(modulus(load(moved, 0)), modulus(load(moved, LANES))))
        change = math.inf
        for sweep in range(TANGENT_SWEEPS):
            for block in range(0, N_PASSAGE, LANES):
                store(forces, block, load(work.slopes, block) * load(moved, block))
            if sweep == TANGENT_SWEEPS - 1 or change <= TANGENT_SETTLED * largest:
                break
            change = respond(forces, shares, work)
        sum_up(direction, place * LANES * tables.impulses.shape[3], tables, work)
        for i in range(size):
            tangent[i, column] += work.kicked[i]
    return tangent.shape[1]
