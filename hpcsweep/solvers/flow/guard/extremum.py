"""The largest value of a row over a step: by its ends and a bound, or where its slope vanishes.

A maximum is sought only where the Hermite bound of `search` allows more than the largest so far.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_matrix
from hpcsweep.solvers.flow.guard.search import HERMITE_BEND, MAX_DEPTH, may_exceed, may_reach
from hpcsweep.solvers.flow.step.polynomials import (
    fourth_derivative,
    value_and_slope,
    value_slope_bend,
)

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that may be missed."""


PEAK_ERROR = 1e-13
"""Relative, of a largest drift."""


MIN_PART = 0.5**11
"""Least fraction of a step that is halved in the search for it. Without a proof on such a part,
beside a turning point of the slope, an extremum differs from its neighbours by 1e-10."""


NOTHING = 1e-200
"""Of drifts below this the ends of the steps are enough."""


REPEATED = 0.02
"""Share of a step by which the extremum of the cubic interpolant may miss."""


MAX_STEPS = 5
"""Of Newton's method, from the cubic Hermite interpolant: its error is squared by each."""


class Peak(NamedTuple):
    """A peak so far: number `place` of values, and a time to begin with, see `raise_peak`."""

    values: np.ndarray
    place: int
    near: float


@inlined
def row_at_ends(row, x, z_end, bounds):
    """Return the values and slopes of a row at both ends of a step, and a bound of |y''''|.

    Parameters
    ----------
    row : tuple
        i; below, or -1; a side, 0 for |y_i - y_below|, 1 or -1 for that times the difference; and a
        gap, by which it is less.
    x, z_end : ndarray
        States at both ends.
    bounds : ndarray
        ``step.bounds``

    Returns
    -------
    ends : tuple of float
        Value and slope at the start, value and slope at the end.
    bound4 : float
    """
    i, below, side, gap = row
    n = z_end.shape[0] // 2
    sign = -1.0 if side < 0 else 1.0
    d0, d1 = sign * x[i] - gap, sign * z_end[i] - gap
    v0, v1 = sign * x[n + i], sign * z_end[n + i]
    bound4 = bounds[i]
    if below >= 0:
        d0, v0 = d0 - sign * x[below], v0 - sign * x[n + below]
        d1, v1 = d1 - sign * z_end[below], v1 - sign * z_end[n + below]
        bound4 += bounds[below]
    return (d0, v0, d1, v1), bound4


@inlined
def raise_to_ends(ends, side, s, peak):
    """Raise a `Peak` to the values at the ends of a step; return when, -1 if it was not below."""
    start, end = _size(ends[0], side), _size(ends[2], side)
    reached = max(start, end)
    if not reached > peak.values[peak.place]:
        return -1.0
    peak.values[peak.place] = reached
    return 0.0 if start == reached else s


@inlined
def row_may_be_higher(peak, side, s, ends, bound4):
    """Return whether a row, its `ends` and `bound4` as of `row_at_ends`, may exceed its peak."""
    if max(abs(peak) * (1.0 + SAME_PEAK), bound4) < NOTHING:
        return False
    return _may_be_higher(peak, side, s, ends[0], ends[1], ends[2], ends[3], bound4)


@inlined
def _may_be_higher(peak, side, d, g0, slope0, g1, slope1, bound4):
    """Return whether |g|, or with a side g, may exceed a peak by more than `SAME_PEAK`."""
    if side == 0:
        return may_exceed(peak * (1.0 + SAME_PEAK), d, g0, slope0, g1, slope1, bound4)
    more = peak + SAME_PEAK * abs(peak)
    return may_reach(d, g0 - more, slope0, g1 - more, slope1, bound4)


@inlined
def _size(value, side):
    """Return |value|, or with a side the value."""
    return abs(value) if side == 0 else value


@kernel
def search_peak(rows, h, s, bound4, side, peak):
    """Update a `Peak` with the extrema of one polynomial on [0, s].

    A part is finished where the Hermite bound allows no more than the peak, or where the slope is
    proved monotone, so that it has at most one extremum. Other parts are halved.

    Returns
    -------
    float
        Time of the peak, -1 if it has not been raised.
    """
    peaks, w, _ = peak
    a = 0.0
    time = -1.0
    ga, da = value_and_slope(rows, 0, h, a)
    gb, db = value_and_slope(rows, 0, h, s)
    depth, stack = 0, local_matrix(MAX_DEPTH + 2, 3)  # right ends
    stack[0, 0], stack[0, 1], stack[0, 2] = s, gb, db
    least = s * MIN_PART
    while depth >= 0:
        b, gb, db = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        d = b - a
        largest = max(peaks[w], max(_size(ga, side), _size(gb, side)))
        if largest > peaks[w]:
            time = a if _size(ga, side) == largest else b
            peaks[w] = largest
        if _may_be_higher(largest, side, d, ga, da, gb, db, bound4):
            if d > least and not slope_is_monotone(d, ga, da, gb, db, bound4):
                middle = 0.5 * (a + b)
                gb, db = value_and_slope(rows, 0, h, middle)
                depth += 1
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, gb, db
                continue
            if da * db < 0.0:
                top, at = extremum(rows, h, a, da, b, db)
                if _size(top, side) > largest:
                    peaks[w], time = _size(top, side), at
        a, ga, da = b, gb, db
        depth -= 1
    return time


@kernel
def raise_peak(rows, h, s, ends, bound4, side, peak):
    """Update a `Peak` with the extrema of polynomial 0 of `rows` on [0, s], as `search_peak` does.

    The coefficients bound the fourth derivative more sharply than the state does, which makes most
    searches needless. Where slopes at the `ends`, of `row_at_ends`, differ in sign, Newton's method
    begins at the extremum of the cubic Hermite interpolant, or at the time `near`, when the peak
    was reached last, if that is within `REPEATED` of the step: of a periodic motion it is the
    extremum. It ends where the Hermite bounds of the parts before and beyond allow no more than the
    peak, after one to four evaluations. Otherwise, and where that fails, the peak is searched.

    Returns
    -------
    float
        Time of the peak, -1 if it has not been raised.
    """
    peaks, w, near = peak
    g0, v0, g1, v1 = ends
    time = -1.0
    bound4 = min(bound4, fourth_derivative(rows, h))
    if not _may_be_higher(peaks[w], side, s, g0, v0, g1, v1, bound4):
        return time
    if v0 * v1 < 0.0 and (side == 0 or v0 > 0.0):
        m = 3.0 * (g1 - g0) / s - v0 - v1
        root = math.sqrt(m * m - v0 * v1)
        t = s * v0 / (v0 - m + (root if v0 > 0.0 else -root))
        if abs(near - t) <= REPEATED * s:
            t = near
        for _ in range(MAX_STEPS):
            if not 0.0 < t < s:
                break
            g, v, bend = value_slope_bend(rows, 0, h, t)
            if _size(g, side) > peaks[w]:
                peaks[w], time = _size(g, side), t
            top = peaks[w]
            before = _may_be_higher(top, side, t, g0, v0, g, v, bound4)
            if not before and not _may_be_higher(top, side, s - t, g, v, g1, v1, bound4):
                return time
            if v0 * bend >= 0.0:
                break
            t -= v / bend
    searched = search_peak(rows, h, s, bound4, side, peak)
    return searched if searched >= 0.0 else time


@kernel
def slope_is_monotone(d, g0, slope0, g1, slope1, bound4):
    """Return whether g'' has one sign on an interval of length d; True is proved.

    The second derivative of the cubic Hermite interpolant is linear and differs by at most d^2 / 12
    times the bound of the fourth derivative (see `search`).
    """
    rise = 6.0 * (g1 - g0) / d
    bend0 = (rise - 4.0 * slope0 - 2.0 * slope1) / d
    bend1 = (2.0 * slope0 + 4.0 * slope1 - rise) / d
    error = HERMITE_BEND * d * d * bound4
    return min(bend0, bend1) > error or max(bend0, bend1) < -error


@kernel
def extremum(rows, h, a, slope_a, b, slope_b):
    """Return where the slope of polynomial 0 vanishes between a and b, where its signs differ.

    Returns
    -------
    value, time : float
    """
    s = a - slope_a * (b - a) / (slope_b - slope_a)
    value = 0.0
    time = s
    for _ in range(60):
        time = s
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
    return value, time
