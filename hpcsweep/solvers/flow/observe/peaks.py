"""Peaks of single rows over continuous time, on linear segments: storeys, floors, contacts.

As the largest drift (`drift`), but each row of `Model.watched` has a peak of its own: of |y_i -
y_below|, or, where the row has a side, of that side times y_i.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.solvers.flow.linear.polynomials import expand_rows, value_and_slope
from hpcsweep.solvers.flow.observe.drift import (
    LEAST_PART,
    NOTHING,
    SAME_PEAK,
    extremum,
    slope_is_monotone,
)
from hpcsweep.solvers.flow.search.search import may_exceed, may_reach
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS


@inlined
def _may_be_higher(peak, side, d, g0, slope0, g1, slope1, bound4):
    """Return whether |g|, or with a side g, may exceed a peak by more than `SAME_PEAK`."""
    more = peak + SAME_PEAK * abs(peak)
    if side == 0:
        return may_exceed(more, d, g0, slope0, g1, slope1, bound4)
    return may_reach(d, g0 - more, slope0, g1 - more, slope1, bound4)


@inlined
def _size(value, side):
    """Return |value|, or with a side the value."""
    return abs(value) if side == 0 else value


@kernel
def peaks_on_segment(index, x, z_end, s, wanted, model, tables, tally, work):
    """Update the peaks of the watched rows that are wanted over the first `s` of a linear step.

    Arguments as of `drift.drift_on_segment`.
    """
    n = model.stiffness.shape[0]
    h = tables.h[index]
    for w in range(model.watched.shape[0]):
        i, below, side, flag = model.watched[w]
        if wanted & flag == 0:
            continue
        sign = -1.0 if side < 0 else 1.0
        d0, d1 = sign * x[i], sign * z_end[i]
        v0, v1 = sign * x[n + i], sign * z_end[n + i]
        bound4 = work.bounds[i]
        if below >= 0:
            d0, v0 = d0 - x[below], v0 - x[n + below]
            d1, v1 = d1 - z_end[below], v1 - z_end[n + below]
            bound4 += work.bounds[below]
        peak = max(tally.peaks[w], max(_size(d0, side), _size(d1, side)))
        tally.peaks[w] = peak
        if max(abs(peak), bound4) < NOTHING:
            continue
        if _may_be_higher(peak, side, s, d0, v0, d1, v1, bound4):
            expand_rows(tables.poly, index, x, work.rows, work.expanded, max(i, below) + 1)
            for p in range(N_COEFFICIENTS):
                work.drift_rows[0, p] = sign * work.rows[i, p]
                if below >= 0:
                    work.drift_rows[0, p] -= work.rows[below, p]
            _search_peak(work.drift_rows, h, s, bound4, side, w, tally.peaks, work.stack)


@kernel
def _search_peak(rows, h, s, bound4, side, w, peaks, stack):
    """Update a peak with the extrema of one polynomial on [0, s]; see `drift.search_peak`."""
    a = 0.0
    ga, da = value_and_slope(rows, 0, h, a)
    gb, db = value_and_slope(rows, 0, h, s)
    stack[0, 0], stack[0, 1], stack[0, 2] = s, gb, db
    depth = 0
    least = s * LEAST_PART
    while depth >= 0:
        b, gb, db = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        d = b - a
        known = max(peaks[w], max(_size(ga, side), _size(gb, side)))
        peaks[w] = known
        if _may_be_higher(known, side, d, ga, da, gb, db, bound4):
            if d > least and not slope_is_monotone(d, ga, da, gb, db, bound4):
                middle = 0.5 * (a + b)
                gb, db = value_and_slope(rows, 0, h, middle)
                depth += 1
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, gb, db
                continue
            if da * db < 0.0:
                peaks[w] = max(known, _size(extremum(rows, h, a, da, b, db), side))
        a, ga, da = b, gb, db
        depth -= 1
