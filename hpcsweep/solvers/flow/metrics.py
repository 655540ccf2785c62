"""Maxima and means over continuous time, gathered along the motion.

On a linear segment all components are polynomials of the step (`tables`), on a step inside a
layer the stage values are at hand (`layer`). Drift is looked for only where the Hermite bound of
`search` allows more than the largest drift so far. Modal norms are integrated on intervals that are
halved until the interpolant of q_j / ||q|| at Gauss nodes resolves it, narrow where ||q|| nearly
vanishes; the kinks of |q_j| are the sign changes of the interpolant.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.vectors import (
    LANES,
    combine,
    fma,
    load,
    maximum,
    modulus,
    negative,
    root,
    store,
    total,
)
from hpcsweep.model.contact import STOP
from hpcsweep.solvers.flow import layer as layer_module
from hpcsweep.solvers.flow.search import (
    HERMITE_BEND,
    expand_rows,
    may_reach,
    value_and_slope,
    value_slope_bend,
)
from hpcsweep.solvers.flow.tables import (
    MODAL_NODES,
    MODAL_WEIGHTS,
    N_COEFFICIENTS,
    N_MODAL,
    ZERO,
    product,
)

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that is not looked for."""
PEAK_ERROR = 1e-13
"""Relative, of a largest drift."""
LEAST_PART = 0.5**11
"""Of a step: shorter parts are not halved in the search for it. Without a proof on such a part,
beside a turning point of the slope, an extremum differs from its neighbours by 1e-10."""
NOTHING = 1e-200
"""Of drifts below this the ends of the steps are enough."""
MODAL_TOLERANCE = 1e-5
"""Largest tail of the interpolant of q_j / ||q|| on an interval that counts as resolved. The norms
are then right to about 1e-10 (measured: 8e-10 with a tolerance of 1e-4, 5e-12 with 1e-6)."""
SHORTEST_INTERVAL = 1e-9
"""Part of a step below which an interval counts as resolved in any case."""
ZERO_TOLERANCE = 1e-4
"""Of a sign change, on [-1, 1]; the integral of the modulus depends on its cube."""
MODAL_TRANSFORM = np.ascontiguousarray(
    (
        (np.arange(N_MODAL)[:, None] + 0.5)
        * np.polynomial.legendre.legvander(MODAL_NODES, N_MODAL - 1).T
        * MODAL_WEIGHTS
    ).T
)
"""Row: node; column: coefficient of the Legendre series."""
SUMMARY = np.zeros((N_MODAL, LANES))
"""Row: node; columns: the first and the last two of these coefficients, the series at -1 and 1."""
MEAN, LAST, BUT_LAST, LEFT, RIGHT = range(5)
SUMMARY[:, MEAN] = MODAL_TRANSFORM[:, 0]
SUMMARY[:, LAST], SUMMARY[:, BUT_LAST] = MODAL_TRANSFORM[:, -1], MODAL_TRANSFORM[:, -2]
SUMMARY[:, LEFT] = MODAL_TRANSFORM @ (-1.0) ** np.arange(N_MODAL)
SUMMARY[:, RIGHT] = MODAL_TRANSFORM.sum(axis=1)
ALL_NEGATIVE = 2 ** (N_MODAL + 2) - 1
PLACES = np.concatenate(([-1.0], MODAL_NODES, [1.0]))
TINY = 1e-300
"""Added to the square of ||q||, which may vanish."""
STAGE_WEIGHTS = layer_module.WEIGHTS
N_STAGES = layer_module.N_STAGES
_K = np.arange(N_MODAL + 1)
LEGENDRE_UP, LEGENDRE_DOWN = (2 * _K + 1) / (_K + 1), _K / (_K + 1)
"""Of the recurrence P_(k+1) = up_k s P_k - down_k P_(k-1)."""
LEGENDRE_INTEGRAL = 1 / (2 * _K + 1)


class Tally(NamedTuple):
    """What is gathered over a window, and what is asked for."""

    contact: np.ndarray
    """(1,) uint64: bit i - 1 is set once u_i >= 1."""
    peak_drift: np.ndarray
    """(1,)"""
    free_time: np.ndarray
    """(1,): time in which no floor touched."""
    modal: np.ndarray
    """(n,): integral of |q_j| / ||q|| over that time."""
    modal_norm: bool


def empty_tally(n: int, modal_norm: bool = False) -> Tally:
    """Make a tally for n floors."""
    return Tally(
        np.zeros(1, np.uint64),
        np.zeros(1),
        np.zeros(1),
        np.zeros(n),
        modal_norm,
    )


@inlined
def drift_on_segment(index, x, z_end, s, tables, tally, work):
    """Update the largest drift over the first `s` of a linear step from x to state z_end.

    ``work.bounds`` holds the bounds of the fourth derivatives on the step.
    """
    n = tally.modal.shape[0]
    h = tables.h[index]
    for i in range(n):
        below = i - 1
        d0, d1 = x[i], z_end[i]
        v0, v1 = x[n + i], z_end[n + i]
        if i > 0:
            d0, v0 = d0 - x[below], v0 - x[n + below]
            d1, v1 = d1 - z_end[below], v1 - z_end[n + below]
        peak = max(tally.peak_drift[0], max(abs(d0), abs(d1)))
        tally.peak_drift[0] = peak
        bound4 = work.bounds[i]
        if i > 0:
            bound4 += work.bounds[below]
        peak *= 1.0 + SAME_PEAK
        if max(peak, bound4) < NOTHING:
            continue
        if may_reach(s, d0 - peak, v0, d1 - peak, v1, bound4) or may_reach(
            s, -d0 - peak, -v0, -d1 - peak, -v1, bound4
        ):
            expand_rows(tables.poly, index, x, work.rows, work.expanded, i + 1)
            for p in range(N_COEFFICIENTS):
                work.drift_rows[0, p] = work.rows[i, p]
                if i > 0:
                    work.drift_rows[0, p] -= work.rows[below, p]
            _search_peak(work.drift_rows, h, s, bound4, tally, work.stack)


@kernel
def _search_peak(rows, h, s, bound4, tally, stack):
    """Update the largest drift with the extrema of one polynomial on [0, s].

    A part is done with where the Hermite bound allows no more than the largest drift, or where
    the slope is proved to be monotone: it has one extremum at most. Other parts are halved.
    `stack` is room for right ends, as in `search.first_passage`.
    """
    a = 0.0
    ga, da = value_and_slope(rows, 0, h, a)
    gb, db = value_and_slope(rows, 0, h, s)
    stack[0, 0], stack[0, 1], stack[0, 2] = s, gb, db
    depth = 0
    least = s * LEAST_PART
    while depth >= 0:
        b, gb, db = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        d = b - a
        known = max(tally.peak_drift[0], max(abs(ga), abs(gb)))
        tally.peak_drift[0] = known
        peak = known * (1.0 + SAME_PEAK)
        if may_reach(d, ga - peak, da, gb - peak, db, bound4) or may_reach(
            d, -ga - peak, -da, -gb - peak, -db, bound4
        ):
            if d > least and not _slope_is_monotone(d, ga, da, gb, db, bound4):
                middle = 0.5 * (a + b)
                gb, db = value_and_slope(rows, 0, h, middle)
                depth += 1
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, gb, db
                continue
            if da * db < 0.0:
                tally.peak_drift[0] = max(known, abs(_extremum(rows, h, a, da, b, db)))
        a, ga, da = b, gb, db
        depth -= 1


@kernel
def _slope_is_monotone(d, g0, slope0, g1, slope1, bound4):
    """Tell whether g'' has one sign on an interval of length d; True is proved.

    That of the cubic Hermite interpolant is linear and differs by no more than d^2 / 12 times
    the bound of the fourth derivative (see `search`).
    """
    rise = 6.0 * (g1 - g0) / d
    bend0 = (rise - 4.0 * slope0 - 2.0 * slope1) / d
    bend1 = (2.0 * slope0 + 4.0 * slope1 - rise) / d
    error = HERMITE_BEND * d * d * bound4
    return min(bend0, bend1) > error or max(bend0, bend1) < -error


@kernel
def _extremum(rows, h, a, slope_a, b, slope_b):
    """Value of polynomial 0 where its slope vanishes between a and b, where the signs differ."""
    s = a - slope_a * (b - a) / (slope_b - slope_a)
    value = 0.0
    for _ in range(60):
        value, slope, bend = value_slope_bend(rows, 0, h, s)
        if slope * slope_b > 0.0:
            b = s
        else:
            a = s
        step = -slope / bend if bend != 0.0 else math.inf
        # the value is off by slope step / 2
        if abs(slope * step) <= PEAK_ERROR * abs(value) or b - a <= 1e-9 * h:
            break
        s = s + step if a < s + step < b else 0.5 * (a + b)
    return value


@inlined
def modal_norm_on_segment(index, x, s, model, tables, tally, work):
    """Add the modal norms over the first `s` of a free step that starts at x."""
    n = tally.modal.shape[0]
    h = tables.h[index]
    tally.free_time[0] += s
    if n == 1:
        tally.modal[0] += s
        return
    if s == h:
        product(tables.modal, 0, x, work.modal_nodes)
        if _add_interval(s, False, n, tally, work):
            return
    expand_rows(tables.poly, index, x, work.rows, work.expanded, n)
    for j in range(n):
        for p in range(0, N_COEFFICIENTS, LANES):
            row = j * N_COEFFICIENTS + p
            combine(
                work.modal_rows,
                row,
                ZERO,
                0,
                1.0,
                work.rows,
                p,
                N_COEFFICIENTS,
                model.modal_transform,
                j * n,
                n,
            )
    # halves, the left one first, until each is resolved
    left = 0.0
    length = 0.5 * s if s == h else s
    least = SHORTEST_INTERVAL * h
    while left < s:
        length = min(length, s - left)
        powers = work.modal_powers
        middle, half = (2.0 * left + length) / h - 1.0, length / h
        for node in range(0, N_MODAL, LANES):
            sigma = fma(load(MODAL_NODES, node), half, middle)
            power = sigma
            store(powers, node, 1.0)
            for p in range(1, N_COEFFICIENTS):
                store(powers, p * N_MODAL + node, power)
                power = power * sigma
        for j in range(n):
            for node in range(0, N_MODAL, LANES):
                combine(
                    work.modal_nodes,
                    j * N_MODAL + node,
                    ZERO,
                    0,
                    1.0,
                    powers,
                    node,
                    N_MODAL,
                    work.modal_rows,
                    j * N_COEFFICIENTS,
                    N_COEFFICIENTS,
                )
        if _add_interval(length, length <= least, n, tally, work):
            left = s if length >= s - left else left + length
            length *= 2.0
        else:
            length *= 0.5


@kernel
def _add_interval(length, accept, n, tally, work):
    """Integrate |q_j| / ||q|| over an interval from its nodes, if they resolve it.

    f_j = q_j / ||q|| is interpolated by Legendre polynomials at the nodes; it is resolved if their
    last two coefficients are below `MODAL_TOLERANCE`. |f_j| is then integrated between the sign
    changes of the interpolant.

    Returns
    -------
    bool
        Whether it was added; always if `accept`.
    """
    f = work.modal_nodes
    summary = work.modal_summary
    for node in range(0, N_MODAL, LANES):
        square = load(f, node) * load(f, node) + TINY
        for at in range(N_MODAL + node, n * N_MODAL, N_MODAL):
            square = fma(load(f, at), load(f, at), square)
        size = 1.0 / root(square)
        for at in range(node, n * N_MODAL, N_MODAL):
            store(f, at, load(f, at) * size)
    for j in range(n):
        start = j * N_MODAL
        combine(summary, 0, ZERO, 0, 1.0, SUMMARY, 0, LANES, f, start, N_MODAL)
        if max(abs(summary[LAST]), abs(summary[BUT_LAST])) > MODAL_TOLERANCE:
            if not accept:
                return False
            mean = 0.0
            for node in range(0, N_MODAL, LANES):
                mean += total(load(MODAL_WEIGHTS, node) * modulus(load(f, start + node)))
            work.modal_part[j] = 0.5 * mean
            continue
        signs = np.int64(summary[LEFT] < 0.0) | np.int64(summary[RIGHT] < 0.0) << (N_MODAL + 1)
        for node in range(0, N_MODAL, LANES):
            signs |= negative(load(f, start + node)) << (node + 1)
        if signs == 0 or signs == ALL_NEGATIVE:
            work.modal_part[j] = abs(summary[MEAN])
        else:
            work.modal_part[j] = 0.5 * _integral_of_modulus(f, start, summary, work.modal_series)
    for j in range(n):
        tally.modal[j] += length * work.modal_part[j]
    return True


@kernel
def _integral_of_modulus(f, start, summary, c):
    """Integrate the modulus of a Legendre series over [-1, 1]; f[start:] are its node values.

    It is that of the series between its zeros. At s beside a zero the antiderivative at the zero is
    F(s) - f(s)^2 / (2 f'(s)), up to the cube of the distance. `c` is room for the coefficients.
    """
    for k in range(0, N_MODAL, LANES):
        combine(c, k, ZERO, 0, 1.0, MODAL_TRANSFORM, k, N_MODAL, f, start, N_MODAL)
    fa = summary[LEFT]
    whole, done = 0.0, 0.0
    for place in range(1, N_MODAL + 2):
        fb = f[start + place - 1] if place <= N_MODAL else summary[RIGHT]
        if fa * fb < 0.0:
            a, b = PLACES[place - 1], PLACES[place]
            s = b - fb * (b - a) / (fb - fa)
            integral = 0.0
            for _ in range(60):
                value, slope, integral = _series(c, s)
                if value * fb > 0.0:
                    b = s
                else:
                    a = s
                step = -value / slope if slope != 0.0 else math.inf
                if abs(step) < ZERO_TOLERANCE or b - a < ZERO_TOLERANCE:
                    if abs(step) < ZERO_TOLERANCE:
                        integral += 0.5 * value * step
                    break
                s = s + step if a < s + step < b else 0.5 * (a + b)
            whole += abs(integral - done)
            done = integral
        fa = fb
    return whole + abs(2.0 * c[0] - done)


@inlined
def _series(c, s):
    """Evaluate a Legendre series and its slope at s, and its integral from -1.

    P'_(k+1) = P'_(k-1) + (2 k + 1) P_k; the antiderivative of P_k is
    (P_(k+1) - P_(k-1)) / (2 k + 1), 0 at -1.
    """
    before, current = 1.0, s
    slope_before, slope_current = 0.0, 1.0
    value = c[0]
    slope = 0.0
    integral = c[0] * (s + 1.0)
    for k in range(1, N_MODAL):
        following = fma(LEGENDRE_UP[k] * s, current, -LEGENDRE_DOWN[k] * before)
        slope_following = fma(2.0 * k + 1.0, current, slope_before)
        value = fma(c[k], current, value)
        slope = fma(c[k], slope_current, slope)
        integral = fma(c[k] * LEGENDRE_INTEGRAL[k], following - before, integral)
        before, current = current, following
        slope_before, slope_current = slope_current, slope_following
    return value, slope, integral


@inlined
def observe_layer_step(h, z0, z1, model, tally, work):
    """Update contact, drift and modal norms with one step inside a layer.

    Maxima are taken over the ends and the stages, and, where the velocity changes sign between
    two neighbours, at the top of the quintic Hermite interpolant through them; its error is
    d^6 / 46080 |u^(6)|, d the short distance between stages. ``work.a`` and ``work.a_end`` hold the
    accelerations at the ends.
    """
    n = tally.modal.shape[0]
    room = work.layer
    ways = work.ways
    touching = False
    for i in range(n):
        hardest = max(abs(work.a[i]), abs(work.a_end[i]))
        hardest = max(hardest, maximum(modulus(load(room.g, i * N_STAGES))))
        # at most, were the acceleration between the stages twice what it is at any of them
        ways[i] = h * (abs(z0[n + i]) + 2.0 * h * hardest)
        bit = np.uint64(1) << np.uint64(i)
        if z0[i] >= STOP or z1[i] >= STOP:
            tally.contact[0] |= bit
            touching = True
        elif tally.contact[0] & bit == np.uint64(0) and z0[i] + ways[i] >= STOP:
            start, end = (z0[i], z0[n + i], work.a[i]), (z1[i], z1[n + i], work.a_end[i])
            if _highest(h, start, end, room.u[i], room.v[i], room.g[i]) >= STOP:
                tally.contact[0] |= bit
    for i in range(n):
        drift, way = z0[i], ways[i]
        if i > 0:
            drift, way = drift - z0[i - 1], way + ways[i - 1]
        for sign in (1.0, -1.0):
            if sign * drift + way > tally.peak_drift[0]:
                peak = _highest_drift(h, i, sign, z0, z1, n, work)
                tally.peak_drift[0] = max(tally.peak_drift[0], peak)
    if tally.modal_norm:
        share = _free_share(z0, z1, n) if touching else 1.0
        if share > 0.0:
            tally.free_time[0] += share * h
            q = work.modal_nodes
            for j in range(n):
                combine(
                    q, j * LANES, ZERO, 0, 1.0, room.u, 0, N_STAGES, model.modal_transform, j * n, n
                )
            square = load(q, 0) * load(q, 0) + TINY
            for j in range(1, n):
                square = fma(load(q, j * LANES), load(q, j * LANES), square)
            weight = load(STAGE_WEIGHTS, 0) / root(square)
            for j in range(n):
                tally.modal[j] += share * h * total(weight * modulus(load(q, j * LANES)))


@kernel
def _free_share(z0, z1, n):
    """Share of a step in which no floor touches, where one begins or ends touching in it."""
    share = 1.0
    for i in range(n):
        x0 = z0[i] - STOP
        x1 = z1[i] - STOP
        if x0 >= 0.0 and x1 >= 0.0:
            return 0.0
        if x0 < 0.0 <= x1:
            share = min(share, x0 / (x0 - x1))
        elif x1 < 0.0 <= x0:
            share = min(share, x1 / (x1 - x0))
    return share


@kernel
def _highest_drift(h, i, sign, z0, z1, n, work):
    """Find the largest value of sign (u_i - u_(i-1)) over a layer step."""
    below = i - 1
    room = work.layer
    for k in range(N_STAGES):
        u, v, g = room.u[i, k], room.v[i, k], room.g[i, k]
        if i > 0:
            u, v, g = u - room.u[below, k], v - room.v[below, k], g - room.g[below, k]
        work.stage_u[k] = sign * u
        work.stage_v[k] = sign * v
        work.stage_a[k] = sign * g
    d0, v0, a0 = z0[i], z0[n + i], work.a[i]
    d1, v1, a1 = z1[i], z1[n + i], work.a_end[i]
    if i > 0:
        d0, v0, a0 = d0 - z0[below], v0 - z0[n + below], a0 - work.a[below]
        d1, v1, a1 = d1 - z1[below], v1 - z1[n + below], a1 - work.a_end[below]
    return _highest(
        h,
        (sign * d0, sign * v0, sign * a0),
        (sign * d1, sign * v1, sign * a1),
        work.stage_u,
        work.stage_v,
        work.stage_a,
    )


@kernel
def _highest(h, start, end, stage_u, stage_v, stage_a):
    """Find the largest value of one component over a layer step.

    Value, velocity and acceleration are given at the ends and at the stages.
    """
    highest = max(start[0], end[0])
    left_s, left = 0.0, start
    for k in range(N_STAGES + 1):
        if k < N_STAGES:
            right_s, right = layer_module.NODES[k], (stage_u[k], stage_v[k], stage_a[k])
        else:
            right_s, right = 1.0, end
        highest = max(highest, right[0])
        if left[1] > 0.0 > right[1]:
            highest = max(highest, _top((right_s - left_s) * h, left, right))
        left_s, left = right_s, right
    return highest


@kernel
def _top(d, left, right):
    """Find the top of the quintic Hermite interpolant between two points d apart."""
    c0, c1, c2 = left[0], d * left[1], 0.5 * d * d * left[2]
    r0 = right[0] - (c0 + c1 + c2)
    r1 = d * right[1] - (c1 + 2.0 * c2)
    r2 = d * d * right[2] - 2.0 * c2
    c3 = 10.0 * r0 - 4.0 * r1 + 0.5 * r2
    c4 = -15.0 * r0 + 7.0 * r1 - r2
    c5 = 6.0 * r0 - 3.0 * r1 + 0.5 * r2
    t = left[1] / (left[1] - right[1])
    for _ in range(4):
        slope = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
        bend = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
        if not bend < 0.0:
            break
        t = min(max(t - slope / bend, 0.0), 1.0)
    return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
