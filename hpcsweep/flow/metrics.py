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

from hpcsweep.flow import layer as layer_module
from hpcsweep.flow.search import expand_rows, may_reach, value_and_slope
from hpcsweep.flow.tables import (
    MODAL_NODES,
    MODAL_WEIGHTS,
    N_COEFFICIENTS,
    N_MODAL,
    ZERO,
    product,
)
from hpcsweep.jit import LANES, combine, jit

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that is not looked for."""
PEAK_DEPTH = 5
MODAL_TOLERANCE = 1e-5
"""Largest tail of the interpolant of q_j / ||q|| on an interval that counts as resolved. The norms
are then right to about 1e-10 (measured: 8e-10 with a tolerance of 1e-4, 5e-12 with 1e-6)."""
SHORTEST_INTERVAL = 1e-9
"""Part of a step below which an interval counts as resolved in any case."""
ZERO_TOLERANCE = 1e-7
"""Of a sign change; the integral of the modulus depends on its square."""
MODAL_TRANSFORM = np.ascontiguousarray(
    (
        (np.arange(N_MODAL)[:, None] + 0.5)
        * np.polynomial.legendre.legvander(MODAL_NODES, N_MODAL - 1).T
        * MODAL_WEIGHTS
    ).T
)
"""Row: node; column: coefficient of the Legendre series."""
STAGE_WEIGHTS = layer_module.WEIGHTS
N_STAGES = layer_module.N_STAGES
_K = np.arange(N_MODAL)
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
    counts: np.ndarray
    """(4,) int64: linear steps, fast passages, layer steps, layer visits."""
    drift: bool
    modal_norm: bool


def empty_tally(n: int, drift: bool = False, modal_norm: bool = False) -> Tally:
    """Make a tally for n floors."""
    return Tally(
        np.zeros(1, np.uint64),
        np.zeros(1),
        np.zeros(1),
        np.zeros(n),
        np.zeros(4, np.int64),
        drift,
        modal_norm,
    )


@jit
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
        if may_reach(s, d0 - peak, v0, d1 - peak, v1, bound4) or may_reach(
            s, -d0 - peak, -v0, -d1 - peak, -v1, bound4
        ):
            expand_rows(tables.poly, index, x, work.rows, work.expanded)
            for p in range(N_COEFFICIENTS):
                work.drift_rows[0, p] = work.rows[i, p]
                if i > 0:
                    work.drift_rows[0, p] -= work.rows[below, p]
            _search_peak(work.drift_rows, h, s, bound4, tally)


@jit
def _search_peak(rows, h, s, bound4, tally):
    """Update the largest drift with the extrema of one polynomial on [0, s]."""
    parts = 1 << PEAK_DEPTH
    d = s / parts
    g0, slope0 = value_and_slope(rows, 0, h, 0.0)
    for part in range(parts):
        g1, slope1 = value_and_slope(rows, 0, h, (part + 1) * d)
        peak = tally.peak_drift[0] * (1.0 + SAME_PEAK)
        if slope0 * slope1 < 0.0 and (
            may_reach(d, g0 - peak, slope0, g1 - peak, slope1, bound4)
            or may_reach(d, -g0 - peak, -slope0, -g1 - peak, -slope1, bound4)
        ):
            a, b, fa, fb = part * d, (part + 1) * d, slope0, slope1
            value = g0
            for _ in range(60):
                middle = b - fb * (b - a) / (fb - fa)
                value, slope = value_and_slope(rows, 0, h, middle)
                if slope * fb > 0.0:
                    b, fb = middle, slope
                    fa *= 0.5
                else:
                    a, fa = middle, slope
                    fb *= 0.5
                if abs(slope) * d < 1e-13 * abs(value) or slope == 0.0 or b - a < 1e-9 * d:
                    break
            tally.peak_drift[0] = max(tally.peak_drift[0], abs(value))
        tally.peak_drift[0] = max(tally.peak_drift[0], abs(g1))
        g0, slope0 = g1, slope1


@jit
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
    expand_rows(tables.poly, index, x, work.rows, work.expanded)
    for j in range(n):
        for p in range(N_COEFFICIENTS):
            total = 0.0
            for i in range(n):
                total += model.shapes[i, j] * work.rows[i, p]
            work.modal_rows[j, p] = total
    # halves, the left one first, until each is resolved
    left = 0.0
    length = 0.5 * s if s == h else s
    least = SHORTEST_INTERVAL * h
    while left < s:
        length = min(length, s - left)
        powers = work.modal_powers
        for node in range(N_MODAL):
            sigma = (2.0 * left + length * (MODAL_NODES[node] + 1.0)) / h - 1.0
            power = 1.0
            for p in range(N_COEFFICIENTS):
                powers[p, node] = power
                power *= sigma
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


@jit
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
    for node in range(N_MODAL):
        square = 0.0
        for j in range(n):
            square += f[j * N_MODAL + node] ** 2
        factor = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
        for j in range(n):
            f[j * N_MODAL + node] *= factor
    c = work.modal_series
    for j in range(n):
        start = j * N_MODAL
        for k in range(0, N_MODAL, LANES):
            combine(c, k, ZERO, 0, 1.0, MODAL_TRANSFORM, k, N_MODAL, f, start, N_MODAL)
        tail = max(abs(c[N_MODAL - 2]), abs(c[N_MODAL - 1]))
        if tail > MODAL_TOLERANCE:
            if not accept:
                return False
            mean = 0.0
            for node in range(N_MODAL):
                mean += 0.5 * MODAL_WEIGHTS[node] * abs(f[start + node])
            work.modal_part[j] = mean
        else:
            work.modal_part[j] = 0.5 * _integral_of_modulus(f, start, c)
    for j in range(n):
        tally.modal[j] += length * work.modal_part[j]
    return True


@jit
def _integral_of_modulus(f, start, c):
    """Integrate the modulus of a Legendre series c over [-1, 1]; f[start:] are its node values."""
    first, last = 0.0, 0.0
    for k in range(0, N_MODAL, 2):
        first += c[k] - c[k + 1]
        last += c[k] + c[k + 1]
    a, fa = -1.0, first
    total, done = 0.0, 0.0
    for node in range(N_MODAL + 1):
        if node < N_MODAL:
            b, fb = MODAL_NODES[node], f[start + node]
        else:
            b, fb = 1.0, last
        if fa * fb < 0.0:
            zero = _zero_between(c, a, fa, b, fb)
            _, integral = _series_and_integral(c, zero)
            total += abs(integral - done)
            done = integral
        a, fa = b, fb
    return total + abs(2.0 * c[0] - done)


@jit
def _series_and_integral(c, s):
    """Evaluate a Legendre series at s, and its integral from -1.

    The antiderivative of P_k is (P_(k+1) - P_(k-1)) / (2 k + 1), 0 at -1.
    """
    before, current = 1.0, s
    value = c[0]
    integral = c[0] * (s + 1.0)
    for k in range(1, N_MODAL):
        following = LEGENDRE_UP[k] * s * current - LEGENDRE_DOWN[k] * before
        value += c[k] * current
        integral += c[k] * (following - before) * LEGENDRE_INTEGRAL[k]
        before, current = current, following
    return value, integral


@jit
def _zero_between(c, a, fa, b, fb):
    """Find a zero of a Legendre series between a and b where the signs differ (Illinois)."""
    middle = a
    for _ in range(60):
        middle = b - fb * (b - a) / (fb - fa)
        value, _ = _series_and_integral(c, middle)
        if value * fb > 0.0:
            b, fb = middle, value
            fa *= 0.5
        else:
            a, fa = middle, value
            fb *= 0.5
        if abs(value) < ZERO_TOLERANCE or b - a < ZERO_TOLERANCE:
            break
    return middle


@jit
def observe_layer_step(h, z0, z1, model, tally, work):
    """Update contact, drift and modal norms with one step inside a layer.

    Maxima are taken over the ends and the stages, and, where the velocity changes sign between
    two neighbours, at the top of the quintic Hermite interpolant through them; its error is
    d^6 / 46080 |u^(6)|, d the short distance between stages. ``work.a`` and ``work.a_end`` hold the
    accelerations at the ends.
    """
    n = tally.modal.shape[0]
    touching = False
    for i in range(n):
        highest = _highest(
            h,
            (z0[i], z0[n + i], work.a[i]),
            (z1[i], z1[n + i], work.a_end[i]),
            work.layer.u[i],
            work.layer.v[i],
            work.layer.g[i],
        )
        if highest >= 1.0:
            tally.contact[0] |= np.uint64(1) << np.uint64(i)
            touching = True
    if tally.drift:
        for i in range(n):
            for sign in (1.0, -1.0):
                peak = _highest_drift(h, i, sign, z0, z1, n, work)
                tally.peak_drift[0] = max(tally.peak_drift[0], peak)
    if tally.modal_norm:
        share = _free_share(z0, z1, n) if touching else 1.0
        if share > 0.0:
            tally.free_time[0] += share * h
            for k in range(N_STAGES):
                square = 0.0
                for j in range(n):
                    q = 0.0
                    for i in range(n):
                        q += model.shapes[i, j] * work.layer.u[i, k]
                    work.modal_values[j] = abs(q)
                    square += q * q
                if square > 0.0:
                    for j in range(n):
                        tally.modal[j] += (
                            share * h * STAGE_WEIGHTS[k] * work.modal_values[j] / math.sqrt(square)
                        )


@jit
def _free_share(z0, z1, n):
    """Share of a step in which no floor touches, where one begins or ends touching in it."""
    share = 1.0
    for i in range(n):
        x0 = z0[i] - 1.0
        x1 = z1[i] - 1.0
        if x0 >= 0.0 and x1 >= 0.0:
            return 0.0
        if x0 < 0.0 <= x1:
            share = min(share, x0 / (x0 - x1))
        elif x1 < 0.0 <= x0:
            share = min(share, x1 / (x1 - x0))
    return share


@jit
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


@jit
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


@jit
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
