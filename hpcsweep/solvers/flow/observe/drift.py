"""Largest storey drift, and peaks of single rows, over continuous time, on linear segments.

All components are polynomials of the step (`tables`). A maximum is sought only where the Hermite
bound of `search` allows more than the largest drift so far.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.solvers.flow.linear.polynomials import expand_rows, value_and_slope, value_slope_bend
from hpcsweep.solvers.flow.search.search import HERMITE_BEND, may_exceed, may_reach
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that may be missed."""
PEAK_ERROR = 1e-13
"""Relative, of a largest drift."""
LEAST_PART = 0.5**11
"""Least fraction of a step that is halved in the search for it. Without a proof on such a part,
beside a turning point of the slope, an extremum differs from its neighbours by 1e-10."""
NOTHING = 1e-200
"""Of drifts below this the ends of the steps are enough."""


@inlined
def drift_on_segment(index, x, z_end, s, model, tables, tally, work):
    """Update the largest drift over the first `s` of a linear step from x to state z_end.

    ``work.bounds`` holds the bounds of the fourth derivatives on the step.
    """
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        row = (i, below, 0)
        peak_of_row(row, index, x, z_end, s, 0, tally.peak_drift, tables, work)


@inlined
def peak_of_row(row, index, x, z_end, s, w, peaks, tables, work):
    """Update peak w with y_i - y_below over the first `s` of a linear step.

    Parameters
    ----------
    row : tuple of int
        i; below, or -1; and a side, 0 for the modulus, 1 or -1 for that times y_i.
    index, x, z_end, s, tables, work
        Of `drift_on_segment`.
    w : int
    peaks : ndarray
    """
    i, below, side = row
    n = z_end.shape[0] // 2
    h = tables.h[index]
    sign = -1.0 if side < 0 else 1.0
    d0, d1 = sign * x[i], sign * z_end[i]
    v0, v1 = sign * x[n + i], sign * z_end[n + i]
    bound4 = work.bounds[i]
    if below >= 0:
        d0, v0 = d0 - x[below], v0 - x[n + below]
        d1, v1 = d1 - z_end[below], v1 - z_end[n + below]
        bound4 += work.bounds[below]
    peak = max(peaks[w], max(_size(d0, side), _size(d1, side)))
    peaks[w] = peak
    if max(abs(peak) * (1.0 + SAME_PEAK), bound4) < NOTHING:
        return
    if _may_be_higher(peak, side, s, d0, v0, d1, v1, bound4):
        expand_rows(tables.poly, index, x, work.rows, work.expanded, max(i, below) + 1)
        for p in range(N_COEFFICIENTS):
            work.drift_rows[0, p] = sign * work.rows[i, p]
            if below >= 0:
                work.drift_rows[0, p] -= work.rows[below, p]
        search_peak(work.drift_rows, h, s, bound4, side, w, peaks, work.stack)


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
def search_peak(rows, h, s, bound4, side, w, peaks, stack):
    """Update peak w with the extrema of one polynomial on [0, s].

    A part is finished where the Hermite bound allows no more than the peak, or where the slope is
    proved monotone, so that it has at most one extremum. Other parts are halved. `stack` is
    workspace for right ends, as in `search.first_passage`.

    Returns
    -------
    float
        Time of the peak, -1 if it has not been raised.
    """
    a = 0.0
    time = -1.0
    ga, da = value_and_slope(rows, 0, h, a)
    gb, db = value_and_slope(rows, 0, h, s)
    stack[0, 0], stack[0, 1], stack[0, 2] = s, gb, db
    depth = 0
    least = s * LEAST_PART
    while depth >= 0:
        b, gb, db = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        d = b - a
        known = max(peaks[w], max(_size(ga, side), _size(gb, side)))
        if known > peaks[w]:
            time = a if _size(ga, side) == known else b
            peaks[w] = known
        if _may_be_higher(known, side, d, ga, da, gb, db, bound4):
            if d > least and not slope_is_monotone(d, ga, da, gb, db, bound4):
                middle = 0.5 * (a + b)
                gb, db = value_and_slope(rows, 0, h, middle)
                depth += 1
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, gb, db
                continue
            if da * db < 0.0:
                top, at = extremum(rows, h, a, da, b, db)
                if _size(top, side) > known:
                    peaks[w], time = _size(top, side), at
        a, ga, da = b, gb, db
        depth -= 1
    return time


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
