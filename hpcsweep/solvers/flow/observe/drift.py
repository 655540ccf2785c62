"""Largest storey drift over continuous time, on linear segments.

All components are polynomials of the step (`tables`). A maximum is looked for only where the
Hermite bound of `search` allows more than the largest drift so far.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.solvers.flow.linear.polynomials import expand_rows, value_and_slope, value_slope_bend
from hpcsweep.solvers.flow.search.search import HERMITE_BEND, may_exceed
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that is not looked for."""
PEAK_ERROR = 1e-13
"""Relative, of a largest drift."""
LEAST_PART = 0.5**11
"""Of a step: shorter parts are not halved in the search for it. Without a proof on such a part,
beside a turning point of the slope, an extremum differs from its neighbours by 1e-10."""
NOTHING = 1e-200
"""Of drifts below this the ends of the steps are enough."""


@inlined
def drift_on_segment(index, x, z_end, s, model, tables, tally, work):
    """Update the largest drift over the first `s` of a linear step from x to state z_end.

    ``work.bounds`` holds the bounds of the fourth derivatives on the step.
    """
    n = model.stiffness.shape[0]
    h = tables.h[index]
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        d0, d1 = x[i], z_end[i]
        v0, v1 = x[n + i], z_end[n + i]
        if below >= 0:
            d0, v0 = d0 - x[below], v0 - x[n + below]
            d1, v1 = d1 - z_end[below], v1 - z_end[n + below]
        peak = max(tally.peak_drift[0], max(abs(d0), abs(d1)))
        tally.peak_drift[0] = peak
        bound4 = work.bounds[i]
        if below >= 0:
            bound4 += work.bounds[below]
        peak *= 1.0 + SAME_PEAK
        if max(peak, bound4) < NOTHING:
            continue
        if may_exceed(peak, s, d0, v0, d1, v1, bound4):
            expand_rows(tables.poly, index, x, work.rows, work.expanded, max(i, below) + 1)
            for p in range(N_COEFFICIENTS):
                work.drift_rows[0, p] = work.rows[i, p]
                if below >= 0:
                    work.drift_rows[0, p] -= work.rows[below, p]
            search_peak(work.drift_rows, h, s, bound4, tally, work.stack)


@kernel
def search_peak(rows, h, s, bound4, tally, stack):
    """Update the largest drift with the extrema of one polynomial on [0, s].

    A part is done with where the Hermite bound allows no more than the largest drift, or where
    the slope is proved to be monotone: it has one extremum at most. Other parts are halved.
    `stack` is workspace for right ends, as in `search.first_passage`.
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
        if may_exceed(peak, d, ga, da, gb, db, bound4):
            if d > least and not slope_is_monotone(d, ga, da, gb, db, bound4):
                middle = 0.5 * (a + b)
                gb, db = value_and_slope(rows, 0, h, middle)
                depth += 1
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, gb, db
                continue
            if da * db < 0.0:
                tally.peak_drift[0] = max(known, abs(extremum(rows, h, a, da, b, db)))
        a, ga, da = b, gb, db
        depth -= 1


@kernel
def slope_is_monotone(d, g0, slope0, g1, slope1, bound4):
    """Return whether g'' has one sign on an interval of length d; True is proved.

    That of the cubic Hermite interpolant is linear and differs by no more than d^2 / 12 times
    the bound of the fourth derivative (see `search`).
    """
    rise = 6.0 * (g1 - g0) / d
    bend0 = (rise - 4.0 * slope0 - 2.0 * slope1) / d
    bend1 = (2.0 * slope0 + 4.0 * slope1 - rise) / d
    error = HERMITE_BEND * d * d * bound4
    return min(bend0, bend1) > error or max(bend0, bend1) < -error


@kernel
def extremum(rows, h, a, slope_a, b, slope_b):
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
