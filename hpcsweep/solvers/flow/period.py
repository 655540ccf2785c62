"""March over forcing periods: linear steps, fast passages, and visits to the layer.

One period runs from tau = 0 to T = 2 pi / Omega, so that the phase is exact in every period.
Between contact changes the motion takes linear steps of the present contact set (`tables`).
A step is accepted when no floor can have reached the edge of its layer, which is proved
(`search`); otherwise the first floor that does is found. If its passage through the layer is
fast, and no other floor comes near a layer meanwhile, the passage is done in closed form
(`crossing`); if not, the motion is integrated from the edge until no floor is inside a layer
(`layer`). For infinite sharpness the layer has no width and every passage is the closed form
with zero impulse.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.vectors import LANES, aligned_zeros, fma
from hpcsweep.model.contact import FULL_POTENTIAL, STOP
from hpcsweep.solvers.flow.crossing import (
    NEGLECTED,
    add_kick,
    moments,
    passage_is_fast,
)
from hpcsweep.solvers.flow.layer import (
    COMPLETE,
    N_STAGES,
    NON_FINITE,
    SOLVER_FAILED,
    STEP_LIMIT,
    LayerRoom,
    accelerations,
    collocate,
    empty_room,
    finish,
    forcing_at,
    inside_layer,
    later_forcing,
    longest_step,
    quadrature_error,
    shortening,
    step_limit,
)
from hpcsweep.solvers.flow.metrics import (
    drift_on_segment,
    modal_norm_on_segment,
    observe_layer_step,
)
from hpcsweep.solvers.flow.search import (
    MAX_DEPTH,
    UNDECIDED,
    evaluate_rows,
    expand_row,
    expand_rows,
    first_passage,
    leaves,
    may_reach,
    rising_root,
    value_and_slope,
)
from hpcsweep.solvers.flow.tables import (
    N_COEFFICIENTS,
    N_MODAL,
    lookup,
    padded,
    product,
    product_of_moduli,
)
from hpcsweep.solvers.flow.tangent import (
    TangentRoom,
    empty_tangent_room,
    layer_tangent,
    linear_tangent,
    passage_tangent,
)

OVERFLOW = 1e100
"""A coordinate beyond this ends the run as NON_FINITE."""
EXTRAPOLATION = 1.005
"""How far beyond its step a polynomial is used, in steps: its error grows less than fivefold."""


class Work(NamedTuple):
    """Room for the kernels; contents mean nothing between calls."""

    x: np.ndarray
    z_end: np.ndarray
    wide: np.ndarray
    """Padded 2n: the end of a step."""
    bounds: np.ndarray
    """Padded n: bounds of the fourth derivatives on a step."""
    rows: np.ndarray
    """(2n, N_COEFFICIENTS): polynomials of the present step, valid where `expanded`."""
    expanded: np.ndarray
    drift_rows: np.ndarray
    modal_rows: np.ndarray
    modal_nodes: np.ndarray
    """Padded n N_MODAL: modal coordinates at the nodes of an interval, by mode, then node."""
    modal_part: np.ndarray
    modal_series: np.ndarray
    modal_powers: np.ndarray
    """(N_COEFFICIENTS, N_MODAL): powers of the nodes of an interval."""
    modal_summary: np.ndarray
    """(LANES,): see `metrics.SUMMARY`."""
    ways: np.ndarray
    stack: np.ndarray
    a: np.ndarray
    a_end: np.ndarray
    tangent: TangentRoom
    layer: LayerRoom
    stage_u: np.ndarray
    stage_v: np.ndarray
    stage_a: np.ndarray


def empty_work(n: int) -> Work:
    """Allocate the room for n floors."""
    return Work(
        x=aligned_zeros(2 * n + 3),
        z_end=np.zeros(2 * n),
        wide=aligned_zeros(padded(2 * n)),
        bounds=aligned_zeros(padded(n)),
        rows=aligned_zeros(2 * n, N_COEFFICIENTS),
        expanded=np.zeros(2 * n, np.bool_),
        drift_rows=aligned_zeros(1, N_COEFFICIENTS),
        modal_rows=aligned_zeros(n, N_COEFFICIENTS),
        modal_nodes=aligned_zeros(padded(n * N_MODAL)),
        modal_part=aligned_zeros(n),
        modal_series=aligned_zeros(N_MODAL),
        modal_powers=aligned_zeros(N_COEFFICIENTS, N_MODAL),
        modal_summary=aligned_zeros(LANES),
        ways=np.zeros(n),
        stack=np.zeros((MAX_DEPTH + 2, 3)),
        a=np.zeros(n),
        a_end=np.zeros(n),
        tangent=empty_tangent_room(n),
        layer=empty_room(n),
        stage_u=np.zeros(N_STAGES),
        stage_v=np.zeros(N_STAGES),
        stage_a=np.zeros(N_STAGES),
    )


@kernel
def set_forcing(x, ground, quadrature):
    """Write the forcing part (A sin, A cos, 1) of the augmented state."""
    size = x.shape[0]
    x[size - 3] = ground
    x[size - 2] = quadrature
    x[size - 1] = 1.0


@kernel
def _rotate(x, cosine, sine):
    """Take the forcing part of the augmented state over one step."""
    size = x.shape[0]
    ground = x[size - 3]
    quadrature = x[size - 2]
    x[size - 3] = fma(ground, cosine, quadrature * sine)
    x[size - 2] = fma(quadrature, cosine, -ground * sine)


@kernel
def _known(key, keys, count):
    """Return the index of a contact set's table, -1 if there is none yet."""
    for index in range(count[0]):
        if keys[index] == key:
            return index
    return -1


@kernel
def contact_key(tau, z, amplitude, model, a):
    """Find the contact set of a state outside all layers.

    A floor exactly at a stop of infinite sharpness touches if it is moving, or else
    accelerating, towards it. `a` is room for n accelerations.
    """
    key = np.uint64(0)
    n = a.shape[0]
    for i in range(n):
        x = z[i] - STOP
        if x == 0.0 and z[n + i] == 0.0:
            accelerations(amplitude * math.sin(model.omega * tau), z, model, a)
        if x > 0.0 or (x == 0.0 and (z[n + i] > 0.0 or (z[n + i] == 0.0 and a[i] > 0.0))):
            key |= np.uint64(1) << np.uint64(i)
    return key


@kernel
def _clear(key, i, d, x, z_end, n, layer, bound4):
    """Tell whether floor i keeps away from its layer, or leaves it, within d; True is proved."""
    sign, level = _edge(key, i, layer)
    g0, slope0 = sign * (x[i] - level), sign * x[n + i]
    g1, slope1 = sign * (z_end[i] - level), sign * z_end[n + i]
    return not may_reach(d, g0, slope0, g1, slope1, bound4) or leaves(
        d, g0, slope0, g1, slope1, bound4
    )


@kernel
def _edge(key, i, layer):
    """Give the edge of the layer of floor i in its contact state, and the sign of its way there."""
    if (key >> np.uint64(i)) & np.uint64(1):
        return -1.0, STOP + layer
    return 1.0, STOP - layer


@kernel
def _coast(key, h, tau, end, layer, step, bound4, index, cosine, sine, x, wide, bounds, steps_left):
    """Take linear steps while no floor can reach the edge of its layer (proved) and time is left.

    Returns
    -------
    tau : float
    n_steps : int
        `x` holds the augmented state there.
    known : bool
        Whether `wide` and `bounds` are those of a step from there.
    """
    n = (x.shape[0] - 3) // 2
    n_steps = 0
    while tau + h < end and n_steps < steps_left:
        product(step, index, x, wide)
        product_of_moduli(bound4, index, x, bounds)
        for i in range(n):
            if not _clear(key, i, h, x, wide, n, layer, bounds[i]):
                return tau, n_steps, True
        for row in range(2 * n):
            x[row] = wide[row]
        _rotate(x, cosine, sine)
        tau += h
        n_steps += 1
    return tau, n_steps, False


@kernel
def _first_event(key, index, span, h, x, z_end, layer, bounds, poly, rows, expanded, stack):
    """Find the first floor that reaches the edge of its layer within `span` of a step.

    Returns
    -------
    floor : int
        -1 if none does (proved), `UNDECIDED` if rounding forbids to tell.
    a, ga, b, gb : float
        See `first_passage`. No other floor reaches the edge of its layer before b.
    """
    n = z_end.shape[0] // 2
    floor = -1
    a = b = span
    ga = gb = 0.0
    for i in range(n):
        bound = bounds[i]
        if _clear(key, i, span, x, z_end, n, layer, bound):
            continue
        if not expanded[i]:
            expand_row(poly, index, i, x, rows)
            expanded[i] = True
        sign, level = _edge(key, i, layer)
        value, slope = z_end[i], z_end[n + i]
        if b < span:
            value, slope = value_and_slope(rows, i, h, b)
        found, g_found, after, g_after = first_passage(
            rows,
            i,
            h,
            0.0,
            sign * (x[i] - level),
            sign * x[n + i],
            b,
            sign * (value - level),
            sign * slope,
            level,
            sign,
            bound,
            stack,
        )
        if found == UNDECIDED:
            return UNDECIDED, found, g_found, after, g_after
        if found < 0.0:
            continue
        if floor >= 0:
            # both within one interval: the time of the first
            other_sign, other_level = _edge(key, floor, layer)
            a = rising_root(rows, floor, h, a, ga, b, gb, other_level, other_sign)
            found = rising_root(rows, i, h, found, g_found, after, g_after, level, sign)
            g_found = 0.0
            if found >= a:
                b, ga, gb = a, 0.0, 0.0
                continue
            after, g_after = found, 0.0
        floor, a, ga, b, gb = i, found, g_found, after, g_after
    return floor, a, ga, b, gb


@kernel
def _time_at_stop(rows, floor, h, s, sign):
    """Follow the floor from the edge of its layer (time s) to the stop; NaN if it turns."""
    for _ in range(40):
        value, slope = value_and_slope(rows, floor, h, s)
        if not sign * slope > 0.0:
            return math.nan
        step = (STOP - value) / slope
        s += step
        if abs(step) <= 1e-15 * h:
            return s
    return s


@kernel
def _first_at_stop(floor, at_stop, key, rows, h, n):
    """Choose the floor that is first at the stop, not after `at_stop`.

    The floor that is first at the edge of its layer may be overtaken inside by a faster one.
    """
    for i in range(n):
        if i != floor and at_stop <= h * EXTRAPOLATION:
            sign = -1.0 if (key >> np.uint64(i)) & np.uint64(1) else 1.0
            value, slope = value_and_slope(rows, i, h, at_stop)
            if sign * (value - STOP) > 0.0 and sign * slope > 0.0:
                earlier = _time_at_stop(rows, i, h, at_stop, sign)
                if earlier < at_stop:
                    floor = i
                    at_stop = earlier
    return floor, at_stop


@kernel
def _passes_apart(floor, key, tau, z, a, amplitude, model):
    """Tell whether floor `floor`, at the stop, may pass its layer apart from all other floors.

    That holds where no other floor comes near its layer meanwhile, and also where those that do
    will pass as fast. While two floors are inside their layers the contact force of one moves the
    other only through the coupling D_12 + K_12 t of the floors, t the time both take: it changes
    the speed of the second by J_1 coupling t and hence its impulse J_2 by J_1 J_2 coupling t / v,
    which must be negligible.

    Returns
    -------
    bool
    promised : uint64
        The floors on their way to the stop that were found to pass fast. They may be inside their
        layers already, so that they have to be taken through in closed form, too.
    """
    stiffness, damping = model.stiffness, model.damping
    beta, rho, omega, layer = model.beta, model.rho, model.omega, model.layer
    n = stiffness.shape[0]
    end = 2.0 * math.pi / omega
    energy = 2.0 * FULL_POTENTIAL * beta / (rho * rho)
    least = abs(z[n + floor])
    span = 2.0 * layer / least
    promised = np.uint64(0)
    found = np.uint64(1) << np.uint64(floor)
    searching = True
    while searching:
        searching = False
        if tau - span < 0.0 or tau + span > end:
            return False, promised
        for i in range(n):
            bit = np.uint64(1) << np.uint64(i)
            x = abs(z[i] - STOP)
            w = abs(z[n + i])
            if found & bit or x - (w + abs(a[i]) * span) * span > layer:
                continue
            way = 2.0 * layer + x
            square = w * w - 2.0 * (abs(a[i]) + beta * way) * way
            if not square > 0.25 * w * w:
                return False, promised
            slowest = math.sqrt(square)
            span = max(span, way / slowest)
            least = min(least, slowest)
            coupling = 0.0
            jerk = omega * abs(amplitude)
            for j in range(n):
                jerk += abs(stiffness[i, j] * z[n + j]) + abs(damping[i, j] * a[j])
                if j != i:
                    coupling = max(coupling, abs(damping[i, j]) + abs(stiffness[i, j]) * span)
            if not energy * energy * coupling * span <= NEGLECTED * least**3:
                return False, promised
            if not passage_is_fast(slowest, abs(a[i]), jerk, model):
                return False, promised
            found |= bit
            if (z[n + i] < 0.0) == (key & bit != np.uint64(0)):
                promised |= bit
            searching = True
    return True, promised


@kernel
def _passes(floor, key, tau, ground, quadrature, z, amplitude, model, a, promised):
    """Take floor `floor`, at the stop in state z, through its layer if that is fast.

    `ground` and `quadrature` are A sin(Omega tau) and A cos(Omega tau).

    Returns
    -------
    bool
        False, with z unchanged, if the passage has to be integrated instead. `a` then holds
        the accelerations at the stop without the contact force of the floor.
    float
        Jerk of the floor, likewise.
    promised : uint64
        Floors whose next passage has to be in closed form, see `_passes_apart`; brought up to date.
    """
    stiffness, damping = model.stiffness, model.damping
    beta, rho, omega = model.beta, model.rho, model.omega
    n = stiffness.shape[0]
    v = z[n + floor]
    z[floor] = STOP
    for i in range(n):
        force = -ground
        if i != floor and (key >> np.uint64(i)) & np.uint64(1):
            force -= beta * (z[i] - STOP)
        for j in range(n):
            force -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        a[i] = force
    jerk = -omega * quadrature
    for j in range(n):
        jerk -= stiffness[floor, j] * z[n + j] + damping[floor, j] * a[j]
    if not passage_is_fast(v, a[floor], jerk, model):
        return False, jerk, promised
    if rho == math.inf:
        return True, jerk, promised
    if promised & (np.uint64(1) << np.uint64(floor)) == np.uint64(0):
        apart, more = _passes_apart(floor, key, tau, z, a, amplitude, model)
        if not apart:
            return False, jerk, promised
        promised |= more
    add_kick(moments(v, a[floor], jerk, beta, rho), floor, model, z)
    return True, jerk, promised & ~(np.uint64(1) << np.uint64(floor))


@kernel
def visit_layer(tau, end, z, amplitude, model, tolerance, steps_left, work, tally, tangent):
    """Integrate from tau until no floor is inside a layer, or until `end`.

    Returns
    -------
    tau : float
    outcome : int
    steps : int
        Steps taken.
    """
    forcing = forcing_at(tau, amplitude, model.omega)
    accelerations(forcing[1], z, model, work.a)
    most = longest_step(model)
    steps = 0
    while True:
        left = end - tau
        h, stiffness = step_limit(z, work.a, model, min(left, most))
        if not tau + h > tau:
            return tau, SOLVER_FAILED, steps
        while True:
            steps += 1
            if steps > steps_left:
                return tau, STEP_LIMIT, steps
            if collocate(tau, h, z, work.a, forcing, stiffness, model, work.layer):
                finish(h, z, work.layer.g, work.z_end)
                error = quadrature_error(h, z, model, work.layer)
                speed = 1.0
                for i in range(work.z_end.shape[0]):
                    speed = max(speed, abs(work.z_end[i]))
                if error <= tolerance * speed:
                    break
                h *= shortening(tolerance * speed, error)
            else:
                h *= 0.5
            if not h > 1e-14 * left:
                return tau, SOLVER_FAILED, steps
        tau = end if h >= left else tau + h
        forcing = later_forcing(tau, h, forcing, model.omega)
        accelerations(forcing[1], work.z_end, model, work.a_end)
        if tally is not None:
            observe_layer_step(h, z, work.z_end, model, tally, work)
        if tangent is not None:
            layer_tangent(h, model, work.layer, tangent)
        for i in range(z.shape[0]):
            z[i] = work.z_end[i]
            if not abs(z[i]) < OVERFLOW:
                return tau, NON_FINITE, steps
        for i in range(work.a.shape[0]):
            work.a[i] = work.a_end[i]
        if tau >= end or not inside_layer(z, model.layer):
            return tau, COMPLETE, steps


@inlined
def march_period(
    z, amplitude, model, tables, tolerance, max_steps, work, counts, tally=None, tangent=None
):
    """Advance z over one forcing period, in place.

    Parameters
    ----------
    z : ndarray, shape (2n,)
        State at tau = 0; on success the state at tau = T, else the last state reached.
    amplitude : float
        A.
    model, tables, work
        See their classes.
    tolerance : float
        Local error allowed a step inside a layer, relative to max(1, |z|).
    max_steps : int
        Cap of steps in this period.
    counts : ndarray of int, shape (4,)
        Increased by the linear steps, fast passages, layer steps and layer visits.
    tally : Tally, optional
        Brought up to date.
    tangent : ndarray, shape (2n, m), optional
        Multiplied by the tangent map of the period, in place.

    Returns
    -------
    int
        An `Outcome`.
    """
    n = model.stiffness.shape[0]
    end = 2.0 * math.pi / model.omega
    x = work.x
    z_end = work.z_end
    rows = work.rows
    expanded = work.expanded
    stack = work.stack
    step = tables.step
    wide = work.wide
    bounds = work.bounds
    poly = tables.poly
    bound4 = tables.bound4
    lengths = tables.h
    rotation = tables.rotation
    keys = tables.keys
    layer = model.layer
    omega = model.omega
    a = work.a
    for i in range(2 * n):
        if not abs(z[i]) < OVERFLOW:
            return NON_FINITE
    if not abs(amplitude) < OVERFLOW:
        return NON_FINITE
    tau = 0.0
    steps = 0
    index = -1
    key = np.uint64(0)
    promised = np.uint64(0)
    while tau < end:
        steps += 1
        if steps > max_steps:
            return STEP_LIMIT
        if index < 0:
            if inside_layer(z, layer):
                counts[3] += 1
                tau, outcome, used = visit_layer(
                    tau,
                    end,
                    z,
                    amplitude,
                    model,
                    tolerance,
                    max_steps - steps,
                    work,
                    tally,
                    tangent,
                )
                counts[2] += used
                steps += used
                if outcome != COMPLETE:
                    return outcome
                continue
            key = contact_key(tau, z, amplitude, model, a)
            index = _known(key, keys, tables.count)
            if index < 0:
                index = lookup(key, model, tables)
            for i in range(2 * n):
                x[i] = z[i]
            set_forcing(x, amplitude * math.sin(omega * tau), amplitude * math.cos(omega * tau))
        h = lengths[index]
        known = False
        if tally is None and tangent is None:
            tau, coasted, known = _coast(
                key,
                h,
                tau,
                end,
                layer,
                step,
                bound4,
                index,
                rotation[index, 0],
                rotation[index, 1],
                x,
                wide,
                bounds,
                max_steps - steps,
            )
            counts[0] += coasted
            steps += coasted
        counts[0] += 1
        for row in range(2 * n):
            expanded[row] = False
        span = h
        if tau + h < end:
            if not known:
                product(step, index, x, wide)
            for row in range(2 * n):
                z_end[row] = wide[row]
        else:
            span = end - tau
            expand_rows(poly, index, x, rows, expanded, 2 * n)
            evaluate_rows(rows, h, span, z_end)
        passed = False
        jerk = 0.0
        ground = 0.0
        quadrature = 0.0
        beyond = False
        if not known:
            product_of_moduli(bound4, index, x, bounds)
        floor, time, g_before, after, g_after = _first_event(
            key, index, span, h, x, z_end, layer, bounds, poly, rows, expanded, stack
        )
        if floor == UNDECIDED:
            return SOLVER_FAILED
        if floor >= 0:
            expand_rows(poly, index, x, rows, expanded, 2 * n)
            first = floor
            sign, level = _edge(key, floor, layer)
            if time < after and g_after >= layer:
                # the floor is at the stop before any other is at its layer
                at_stop = rising_root(
                    rows, floor, h, time, g_before - layer, after, g_after - layer, STOP, sign
                )
            else:
                time = rising_root(rows, floor, h, time, g_before, after, g_after, level, sign)
                after = time
                at_stop = _time_at_stop(rows, floor, h, time, sign)
                floor, at_stop = _first_at_stop(floor, at_stop, key, rows, h, n)
            inside = time <= at_stop <= EXTRAPOLATION * h
            if inside and tau + at_stop < end:
                evaluate_rows(rows, h, at_stop, z)
                ground = amplitude * math.sin(omega * (tau + at_stop))
                quadrature = amplitude * math.cos(omega * (tau + at_stop))
                passed, jerk, promised = _passes(
                    floor,
                    key,
                    tau + at_stop,
                    ground,
                    quadrature,
                    z,
                    amplitude,
                    model,
                    a,
                    promised,
                )
            if passed:
                counts[1] += 1
                span = at_stop
            else:
                span = rising_root(rows, first, h, time, g_before, after, g_after, level, sign)
                # a floor that reaches the stop after this step: try again from the layer's edge
                beyond = at_stop > EXTRAPOLATION * h and span > 0.01 * h
                evaluate_rows(rows, h, span, z_end)
        if tangent is not None:
            linear_tangent(tables, index, span, tangent, work.tangent)
            if passed:
                evaluate_rows(rows, h, span, z_end)
                z_end[floor] = STOP
                after = key ^ (np.uint64(1) << np.uint64(floor))
                passage_tangent(floor, after, z_end, a, jerk, model, work.tangent, tangent)
        if passed:
            for i in range(2 * n):
                z_end[i] = z[i]
        for i in range(2 * n):
            if not abs(z_end[i]) < OVERFLOW:
                return NON_FINITE
        if tally is not None:
            if key != np.uint64(0):
                tally.contact[0] |= key
            drift_on_segment(index, x, z_end, span, tables, tally, work)
            if tally.modal_norm and key == np.uint64(0):
                modal_norm_on_segment(index, x, span, model, tables, tally, work)
        for i in range(2 * n):
            z[i] = z_end[i]
        tau = end if span >= end - tau else tau + span
        if floor < 0:
            for i in range(2 * n):
                x[i] = z[i]
            if span == h:
                _rotate(x, rotation[index, 0], rotation[index, 1])
        elif beyond:
            set_forcing(x, amplitude * math.sin(omega * tau), amplitude * math.cos(omega * tau))
            for i in range(2 * n):
                x[i] = z[i]
        elif passed:
            key ^= np.uint64(1) << np.uint64(floor)
            index = _known(key, keys, tables.count)
            if index < 0:
                index = lookup(key, model, tables)
            for i in range(2 * n):
                x[i] = z[i]
            set_forcing(x, ground, quadrature)
        else:
            index = -1
            if model.rho != math.inf:
                # at the edge of the layer, perhaps just outside it by rounding: integrate
                counts[3] += 1
                tau, outcome, used = visit_layer(
                    tau,
                    end,
                    z,
                    amplitude,
                    model,
                    tolerance,
                    max_steps - steps,
                    work,
                    tally,
                    tangent,
                )
                counts[2] += used
                steps += used
                if outcome != COMPLETE:
                    return outcome
    return COMPLETE
