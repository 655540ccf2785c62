"""Observe a step inside a layer: bounds and peaks of its components, drifts and modal norms."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, maximum, modulus, root, total
from hpcsweep.model.kernel_model import CONTACT
from hpcsweep.solvers.flow.layer.interpolant import (
    hermite,
    highest_near,
    interpolate,
    turn_of,
    value_of,
)
from hpcsweep.solvers.flow.observe.modal_norm import TINY
from hpcsweep.solvers.flow.observe.peaks import DISPLACEMENT_KINDS, rows_of_kind
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, WEIGHTS
from hpcsweep.solvers.flow.state.shared import MAXIMA, NORMS, wants_norms
from hpcsweep.solvers.flow.state.state import approach_speed, distance, time_of
from hpcsweep.solvers.flow.state.tables import ZERO

BETWEEN = 0.1
"""How far a component may come beyond its values at ends and nodes, over their range; of a parabola
between nodes it is 0.03, with its top in the step."""


@inlined
def range_of(inner, first, last):
    """Return the least and the greatest of Lanes and two numbers."""
    top = max(maximum(inner), max(first, last))
    return min(-maximum(0.0 - inner), min(first, last)), top


@inlined
def above(bottom, top):
    """Return whether a component of a range is above 0 between its values, too."""
    return bottom > BETWEEN * (top - bottom)


@inlined
def beyond(bottom, top):
    """Return what a component of a range may reach."""
    return top + BETWEEN * (top - bottom)


@inlined
def stays(closed, bottom, top):
    """Return whether a contact whose distances past its stop have a range stays as it is."""
    return above(bottom, top) if closed else above(-top, -bottom)


@inlined
def keeps_sign(bottom, top):
    """Return whether a component of a range has one sign on the step."""
    return above(bottom, top) or above(-top, -bottom)


NEAR_PEAK = 1e-6
"""Relative distance below the peak so far within which a maximum is evaluated exactly."""


@inlined
def displacements_in_layer(tau, h, z0, z1, wanted, only_look, shared):
    """Raise the requested peaks of displacements over one step from state z0 to state z1.

    With `only_look` they are raised to the ends at most; return then whether one may be higher
    between them.
    """
    model, tally, work = shared.model, shared.tally, shared.work
    ways, time = work.ways, time_of(tau, model)
    n = model.stiffness.shape[0]
    for kind in range(DISPLACEMENT_KINDS):
        flag, first, count = rows_of_kind(kind, shared)
        if wanted & flag == 0:
            continue
        for k in range(count):
            p = first + k
            gap = model.contacts.gap[k] if flag == CONTACT else 0.0
            i, below, side, _ = model.watched[p]
            value, way = z0[i], ways[i]
            if below >= 0:
                value, way = value - z0[below], way + ways[below]
            for sign in (1.0, -1.0):
                if side * sign < 0.0 or not sign * value + way - gap > tally.peaks[p]:
                    continue
                start, end = ends_of(i, below, sign, z0, z1, n, work)
                inner, speeds = load(work.layer.u, i * LANES), load(work.layer.v, i * LANES)
                if below >= 0:
                    inner = inner - load(work.layer.u, below * LANES)
                    speeds = speeds - load(work.layer.v, below * LANES)
                bottom, top = range_of(inner * sign, start[0], end[0])
                if not beyond(bottom, top) - gap > tally.peaks[p]:
                    continue
                slowest, fastest = range_of(speeds * sign, start[1], end[1])
                if keeps_sign(slowest, fastest):
                    top = max(start[0], end[0]) - gap
                    if top > tally.peaks[p]:
                        tally.peaks[p] = top
                        tally.times[p] = time + (h if end[0] > start[0] else 0.0)
                    continue
                if only_look:
                    return True
                peak, s = highest_of(h, i, below, sign, z0, z1, n, work)
                if s < 0.0:
                    s = _place_of(peak, start, end, work)
                elif peak - gap > (1.0 - NEAR_PEAK) * tally.peaks[p]:
                    interpolate(h, start, end, work)
                    peak = highest_near(s, peak, work)
                if peak - gap > tally.peaks[p]:
                    tally.peaks[p], tally.times[p] = peak - gap, time + s * h
    return False


@kernel
def _place_of(peak, start, end, work):
    """Return at which part of a step an end or a stage has the largest value, `highest_of`."""
    if start[0] == peak:
        return 0.0
    for k in range(N_STAGES):
        if work.stage_u[k] == peak:
            return NODES[k]
    return 1.0


@inlined
def observe_layer_step(h, z0, wanted, shared):
    """Update maxima and norms by one step of length h inside a layer, from z0 to ``work.z_end``.

    Maxima are taken over the ends and the stages, and, where the velocity changes sign between
    two neighbours, at the top of the quintic Hermite interpolant through them; its error is
    d^6 / 46080 |u^(6)|, d the short distance between stages. ``work.a`` and ``work.a_end`` hold the
    accelerations at the ends.
    """
    model, tally, work = shared.model, shared.tally, shared.work
    n = model.stiffness.shape[0]
    z1, stage, ways = work.z_end, work.layer, work.ways
    longest_ways(h, z0, work)
    touching = False
    if wanted & (MAXIMA | NORMS):
        touching = _update_maxima(h, z0, z1, model, ways, tally, work)
    if wants_norms(wanted):
        modes = tally.modal.shape[0]
        share = _free_share(h, z0, z1, model.contacts) if touching else 1.0
        if share > 0.0:
            tally.free_time[0] += share * h
            q = work.modal_nodes
            for j in range(modes):
                combine(
                    q,
                    j * LANES,
                    ZERO,
                    0,
                    1.0,
                    stage.u,
                    0,
                    N_STAGES,
                    model.modal_transform,
                    j * n,
                    modes,
                )
            square = load(q, 0) * load(q, 0) + TINY
            for j in range(1, modes):
                square = fma(load(q, j * LANES), load(q, j * LANES), square)
            weight = load(WEIGHTS, 0) / root(square)
            for j in range(modes):
                tally.modal[j] += share * h * total(weight * modulus(load(q, j * LANES)))


@inlined
def longest_ways(h, z0, work):
    """Write how far each row can come on a step from z0 into ``work.ways``."""
    n = work.ways.shape[0]
    for i in range(n):
        hardest = max(abs(work.a[i]), abs(work.a_end[i]))
        hardest = max(hardest, maximum(modulus(load(work.layer.g, i * N_STAGES))))
        # at most, were the acceleration between the stages twice what it is at any of them
        work.ways[i] = h * (abs(z0[n + i]) + 2.0 * h * hardest)


@kernel
def _update_maxima(h, z0, z1, model, ways, tally, work):
    """Update contact set and largest drift; return whether a contact is closed at an end."""
    n = model.stiffness.shape[0]
    contacts = model.contacts
    touching = False
    for k in range(contacts.row.shape[0]):
        i, sign, gap = contacts.row[k], contacts.sign[k], contacts.gap[k]
        bit = np.uint64(1) << np.uint64(k)
        if sign * z0[i] >= gap or sign * z1[i] >= gap:
            tally.contact[0] |= bit
            touching = True
        elif (
            tally.contact[0] & bit == np.uint64(0)
            and sign * z0[i] + ways[i] >= gap
            and highest_of(h, i, -1, sign, z0, z1, n, work)[0] >= gap
        ):
            tally.contact[0] |= bit
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        drift, way = z0[i], ways[i]
        if below >= 0:
            drift, way = drift - z0[below], way + ways[below]
        for sign in (1.0, -1.0):
            if sign * drift + way > tally.peak_drift[0]:
                peak, _ = highest_of(h, i, below, sign, z0, z1, n, work)
                tally.peak_drift[0] = max(tally.peak_drift[0], peak)
    return touching


@kernel
def _free_share(h, z0, z1, contacts):
    """Return the share of a step without contact, where a contact closes or opens in it."""
    share = 1.0
    for k in range(contacts.row.shape[0]):
        x0, x1 = distance(k, z0, contacts), distance(k, z1, contacts)
        if x0 >= 0.0 and x1 >= 0.0:
            return 0.0
        if (x0 < 0.0) != (x1 < 0.0):
            v0, v1 = h * approach_speed(k, z0, contacts), h * approach_speed(k, z1, contacts)
            part = _crossing(x0, v0, x1, v1)
            share = min(share, part if x0 < 0.0 else 1.0 - part)
    return share


@kernel
def _crossing(x0, v0, x1, v1):
    """Return where a distance crosses 0 on [0, 1], from values and slopes at both ends (cubic)."""
    bend, third = 3.0 * (x1 - x0) - 2.0 * v0 - v1, 2.0 * (x0 - x1) + v0 + v1
    low, high, s = 0.0, 1.0, x0 / (x0 - x1)
    for _ in range(4):
        value = x0 + s * (v0 + s * (bend + s * third))
        if (value < 0.0) == (x0 < 0.0):
            low = s
        else:
            high = s
        slope = v0 + s * (2.0 * bend + 3.0 * s * third)
        step = s - value / slope if slope != 0.0 else low
        s = step if low <= step <= high else 0.5 * (low + high)
    return s


@kernel
def highest_of(h, i, below, sign, z0, z1, n, work):
    """Find the maximum of sign (y_i - y_below) over a layer step; of sign y_i if `below` is -1.

    Returns
    -------
    highest, s : float
        And the part of the step at which it is, -1 if that is an end or a stage. Value, velocity
        and acceleration at the stages are left in ``work.stage_u``, ``stage_v`` and ``stage_a``.
    """
    stage = work.layer
    for k in range(N_STAGES):
        u, v, g = stage.u[i, k], stage.v[i, k], stage.g[i, k]
        if below >= 0:
            u, v, g = u - stage.u[below, k], v - stage.v[below, k], g - stage.g[below, k]
        work.stage_u[k] = sign * u
        work.stage_v[k] = sign * v
        work.stage_a[k] = sign * g
    start, end = ends_of(i, below, sign, z0, z1, n, work)
    return _highest(h, start, end, work.stage_u, work.stage_v, work.stage_a)


@inlined
def ends_of(i, below, sign, z0, z1, n, work):
    """Return value, velocity and acceleration of sign (y_i - y_below) at both ends of a step."""
    d0, v0, a0 = z0[i], z0[n + i], work.a[i]
    d1, v1, a1 = z1[i], z1[n + i], work.a_end[i]
    if below >= 0:
        d0, v0, a0 = d0 - z0[below], v0 - z0[n + below], a0 - work.a[below]
        d1, v1, a1 = d1 - z1[below], v1 - z1[n + below], a1 - work.a_end[below]
    return (sign * d0, sign * v0, sign * a0), (sign * d1, sign * v1, sign * a1)


@kernel
def _highest(h, start, end, stage_u, stage_v, stage_a):
    """Find the maximum of one component over a layer step; return it and where, see `highest_of`.

    Value, velocity and acceleration are given at the ends and at the stages.
    """
    highest, at = max(start[0], end[0]), -1.0
    left_s, left = 0.0, start
    for k in range(N_STAGES + 1):
        if k < N_STAGES:
            right_s, right = NODES[k], (stage_u[k], stage_v[k], stage_a[k])
        else:
            right_s, right = 1.0, end
        if right[0] > highest:
            highest, at = right[0], -1.0
        if left[1] > 0.0 > right[1]:
            top, t = _top((right_s - left_s) * h, left, right)
            if top > highest:
                highest, at = top, left_s + t * (right_s - left_s)
        left_s, left = right_s, right
    return highest, at


@kernel
def _top(d, left, right):
    """Return maximum and place of the quintic Hermite interpolant between two points d apart."""
    c = hermite(d, left, right)
    t = turn_of(c, 1.0, left[1] / (left[1] - right[1]))
    return value_of(c, t), t
