r"""Peaks over continuous time on linear segments: drifts, single rows, absolute accelerations.

All components are polynomials of the step (`tables`). A maximum is sought only where the Hermite
bound of `search` allows more than the largest drift so far.

Absolute accelerations of the floors along the linear motion: tables of a contact set
-------------------------------------------------------------------------------------
A floor's absolute acceleration is q = u'' + g G with g = -f where a base shakes (f = -1), that is
what its springs, dampers and contacts do,

    u'' + g G = -M^-1 K u - M^-1 C u' - sum_k (beta_k x_k + drag_k x_k') e_k + (f + g) G,

so that q = l . (y, y') + c, with l and c of the contact set, does not jump with G'. Where forces
act instead (g = 0) the last term is left, and the polynomial of u'' along a step is the derivative
of that of u'. With x' = M x of `tables` q has the slope l . (y', y'') + (f + g) G', linear in the
augmented state x, too. A table holds the rows of values and slopes, the polynomials of q on a step,
and bounds of |q''''| from these: what the Hermite bound of `search` needs to tell that a peak
cannot be exceeded.

Peaks of single rows and their times over continuous time, on linear segments
-----------------------------------------------------------------------------
Drifts, floors and distances of closed contacts past their stops are taken from the states at both
ends of a step (`drift`), absolute accelerations from their tables (`outputs`), eight at once. A
peak is first raised to what is reached at the ends, and then looked for only where the Hermite
bound of `search` allows more.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, modulus, negative, total
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.model.kernel_model import ACCELERATION, CONTACT, DRIFT, FLOOR
from hpcsweep.solvers.flow.linear.forcing import forcing_after, turn_forcing
from hpcsweep.solvers.flow.linear.polynomials import (
    expand_row,
    expand_rows,
    value_and_slope,
    value_slope_bend,
)
from hpcsweep.solvers.flow.linear.propagators import max_fourth_derivative
from hpcsweep.solvers.flow.search.search import HERMITE_BEND, HERMITE_MIDDLE, may_exceed, may_reach
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state, time_of
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, product, product_of_moduli

SAME_PEAK = 1e-11
"""Relative excess over the largest drift so far that may be missed."""
PEAK_ERROR = 1e-13
"""Relative, of a largest drift."""
MIN_PART = 0.5**11
"""Least fraction of a step that is halved in the search for it. Without a proof on such a part,
beside a turning point of the slope, an extremum differs from its neighbours by 1e-10."""
NOTHING = 1e-200
"""Of drifts below this the ends of the steps are enough."""
FOURTH = np.array([math.perm(p, 4) for p in range(N_COEFFICIENTS)], float)
"""Factors of the coefficients in the fourth derivative by sigma."""
REPEATED = 0.02
"""Share of a step by which the extremum of the cubic interpolant may miss."""
MAX_STEPS = 5
"""Of Newton's method, from the cubic Hermite interpolant: its error is squared by each."""


@inlined
def drift_on_segment(index, x, z_end, s, model, tables, tally, work):
    """Update the largest drift over the first `s` of a linear step from x to state z_end.

    ``work.bounds`` holds the bounds of the fourth derivatives on the step.
    """
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        row = (i, below, 0, 0.0)
        ends, bound4 = row_at_ends(row, x, z_end, work.bounds)
        tally.peak_drift[0] = max(tally.peak_drift[0], max(abs(ends[0]), abs(ends[2])))
        if row_may_be_higher(tally.peak_drift[0], 0, s, ends, bound4):
            expand_difference(row, index, x, tables, work)
            search_peak(
                work.drift_rows, tables.h[index], s, bound4, 0, 0, tally.peak_drift, work.stack
            )


@inlined
def largest_of_storeys(model, tally):
    """Raise the largest drift to the peaks of the storeys, where these are gathered instead."""
    for d in range(model.drift_rows.shape[0]):
        tally.peak_drift[0] = max(tally.peak_drift[0], tally.peaks[d])


@inlined
def row_at_ends(row, x, z_end, bounds):
    """Return the values and slopes of a row at both ends of a step, and a bound of |y''''|.

    Parameters
    ----------
    row : tuple
        i; below, or -1; a side, 0 for |y_i - y_below|, 1 or -1 for that times the difference; and a
        gap, by which it is less.
    x, z_end : ndarray
        Of `drift_on_segment`.
    bounds : ndarray
        ``work.bounds``

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
def raise_to_ends(ends, side, along, w, tally):
    """Raise peak w, and its time, to the values at the ends of a step; `along` of `raise_peak`."""
    start, end = _size(ends[0], side), _size(ends[2], side)
    reached = max(start, end)
    if reached > tally.peaks[w]:
        tally.peaks[w] = reached
        tally.times[w] = along[2] + (0.0 if start == reached else along[1])


@inlined
def row_may_be_higher(peak, side, s, ends, bound4):
    """Return whether a row, its `ends` and `bound4` as of `row_at_ends`, may exceed its peak."""
    if max(abs(peak) * (1.0 + SAME_PEAK), bound4) < NOTHING:
        return False
    return _may_be_higher(peak, side, s, ends[0], ends[1], ends[2], ends[3], bound4)


@inlined
def expand_difference(row, index, x, tables, work):
    """Write the polynomial of a row, as of `row_at_ends`, into ``work.drift_rows``."""
    i, below, side, gap = row
    sign = -1.0 if side < 0 else 1.0
    expand_rows(tables.poly, index, x, work.rows, work.expanded, max(i, below) + 1)
    for p in range(N_COEFFICIENTS):
        work.drift_rows[0, p] = sign * work.rows[i, p]
        if below >= 0:
            work.drift_rows[0, p] -= sign * work.rows[below, p]
    work.drift_rows[0, 0] -= gap


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
    least = s * MIN_PART
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
def raise_peak(rows, along, ends, bound4, side, w, tally, stack):
    """Update peak w and its time by the extrema of a polynomial, as `search_peak` does.

    The coefficients bound the fourth derivative more sharply than the state does, which makes most
    searches needless. Where slopes at the `ends`, of `row_at_ends`, differ in sign, Newton's method
    begins at the extremum of the cubic Hermite interpolant, or at the time `near`, when the peak
    was reached last, if that is within `REPEATED` of the step: of a periodic motion it is the
    extremum. It ends where the Hermite bounds of the parts before and beyond allow no more than the
    peak, after one to four evaluations. Otherwise, and where that fails, the peak is searched.

    Parameters
    ----------
    rows : ndarray
        Polynomial 0 is that of a step.
    along : tuple
        Length of the step, part of it, time of its start, and `near`, from there.
    ends, bound4, side, w
        See `row_at_ends`.
    tally
        Has `peaks` and `times`.
    """
    h, s, time, near = along
    peaks, at = tally.peaks, -1.0
    g0, v0, g1, v1 = ends
    bound4 = min(bound4, _fourth_derivative(rows, h))
    if not _may_be_higher(peaks[w], side, s, g0, v0, g1, v1, bound4):
        return
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
                peaks[w], at = _size(g, side), t
            known = peaks[w]
            before = _may_be_higher(known, side, t, g0, v0, g, v, bound4)
            if not before and not _may_be_higher(known, side, s - t, g, v, g1, v1, bound4):
                tally.times[w] = time + at if at >= 0.0 else tally.times[w]
                return
            if v0 * bend >= 0.0:
                break
            t -= v / bend
    found = search_peak(rows, h, s, bound4, side, w, peaks, stack)
    at = found if found >= 0.0 else at
    if at >= 0.0:
        tally.times[w] = time + at


@inlined
def _fourth_derivative(rows, h):
    """Bound |d^4/ds^4| of polynomial 0 on the step by the moduli of its coefficients."""
    own = modulus(load(rows, 0)) * load(FOURTH, 0)
    for p in range(LANES, N_COEFFICIENTS, LANES):
        own = fma(modulus(load(rows, p)), load(FOURTH, p), own)
    rate = 2.0 / h
    return total(own) * ((rate * rate) * (rate * rate))


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


@inlined
def fill_outputs(index, model, tables, outputs):
    """Fill table `index` of the accelerations for the contact set of that of the motion, once."""
    if not (outputs.filled[index] and outputs.key[index] == tables.keys[index]):
        _fill(index, model, tables, outputs)


@kernel
def _fill(index, model, tables, outputs):
    """Fill table `index` of the accelerations."""
    key = tables.keys[index]
    outputs.filled[index], outputs.key[index] = True, key
    rows, n_rows = outputs.accelerations, model.stiffness.shape[0]
    _write_accelerations(key, model, rows)
    _write_pairs(rows, model, outputs.pair[index])
    poly, h, last = tables.poly[index], tables.h[index], tables.poly.shape[2] - 1
    for i in range(model.ground.shape[0]):
        own = outputs.poly[index, i]
        for column in range(poly.shape[1]):
            for c in range(N_COEFFICIENTS):
                own[column, c] = 0.0
            if model.forcing[i] + model.ground[i] != 0.0:
                differentiate(poly[n_rows + i, column], h, own[column])
            else:
                for j in range(2 * n_rows):
                    if rows[i, j] != 0.0:
                        for c in range(N_COEFFICIENTS):
                            own[column, c] += rows[i, j] * poly[j, column, c]
                if column == last:
                    own[column, 0] += rows[i, last]
            outputs.bound4[index, column, i] = max_fourth_derivative(own[column], h)


@inlined
def differentiate(polynomial, h, out):
    """Write the time derivative of a polynomial of a step of length h into `out`."""
    for c in range(N_COEFFICIENTS - 1):
        out[c] = (c + 1) * polynomial[c + 1] * (2.0 / h)
    out[N_COEFFICIENTS - 1] = 0.0


@kernel
def _write_accelerations(key, model, out):
    """Write y'' of all rows as rows of the augmented state."""
    n_rows = model.stiffness.shape[0]
    contacts = model.contacts
    last = out.shape[1] - 1
    for i in range(n_rows):
        for j in range(n_rows):
            out[i, j] = -model.stiffness[i, j]
            out[i, n_rows + j] = -model.damping[i, j]
        for pair in range(2 * n_rows, last, 2):
            out[i, pair], out[i, pair + 1] = model.forcing[i], 0.0
        out[i, last] = 0.0
        for k in range(contacts.row.shape[0]):
            if key & contact_bit(k) != np.uint64(0):
                push = contacts.beta[k] * contacts.kick[k, i]
                out[i, contacts.row[k]] -= push * contacts.sign[k]
                drag = contacts.edges[k, DRAG] * contacts.kick[k, i]
                out[i, n_rows + contacts.row[k]] -= drag * contacts.sign[k]
                out[i, last] += push * contacts.gap[k]


@kernel
def _write_pairs(rows, model, pair):
    """Write the columns of values and slopes."""
    n_rows = rows.shape[0]
    last = pair.shape[0] - 1
    for i in range(model.ground.shape[0]):
        value_at = i + i // LANES * LANES
        slope_at = value_at + LANES
        for column in range(last + 1):
            value = rows[i, column] if column < 2 * n_rows else 0.0
            slope = rows[i, column - n_rows] if n_rows <= column < 2 * n_rows else 0.0
            for j in range(n_rows):
                slope += rows[i, n_rows + j] * rows[j, column]
            pair[column, value_at], pair[column, slope_at] = value, slope
        pair[last, value_at] = rows[i, last]
        # of a harmonic the pair (sine, cosine), of a ramp (G, G')
        own = model.forcing[i] + model.ground[i]
        for h in range((last - 2 * n_rows) // 2):
            at = 2 * n_rows + 2 * h
            rate = 1.0
            if h < model.harmonics.shape[0]:
                rate = model.harmonics[h, 0] * model.omega
            pair[at, value_at] += own
            pair[at + 1, slope_at] += own * rate


@inlined
def look(index, x, outputs, out):
    """Write values and slopes of the accelerations in an augmented state."""
    product(outputs.pair, index, x, out)


@inlined
def bound_outputs(index, x, outputs):
    """Write bounds of |q''''| on a step from x."""
    product_of_moduli(outputs.bound4, index, x, outputs.bounds)


DISPLACEMENT_KINDS = 3
LEAST = 1e-200
"""Excess over a peak that is not looked for, however small the peak is."""


@inlined
def rows_of_kind(kind, shared):
    """Return the flag of drifts, floors or contacts, where in `Model.watched`, and how many."""
    model, outputs = shared.model, shared.outputs
    if kind == 0:
        return DRIFT, 0, model.drift_rows.shape[0]
    if kind == 1:
        return FLOOR, outputs.first_floor, model.ground.shape[0]
    return CONTACT, outputs.first_contact, model.contacts.row.shape[0]


@inlined
def peaks_on_segment(segment, span, amplitude, wanted, shared):
    """Raise the peaks that are wanted over the first `span` of a linear step to ``work.z_end``.

    ``work.expanded`` tells which polynomials are there, and ``work.bounds`` the bounds of the
    fourth derivatives on the step.
    """
    if wanted & ~ACCELERATION:
        _displacements_on_segment(segment, span, wanted & ~ACCELERATION, shared)
    if wanted & ACCELERATION:
        _accelerations_on_segment(segment, span, amplitude, shared)


@inlined
def _displacements_on_segment(segment, span, wanted, shared):
    """Raise the peaks of drifts, floors and closed contacts; arguments of `peaks_on_segment`."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    contacts, peaks = model.contacts, tally.peaks
    index, time = segment.index, time_of(segment.tau, model)
    for kind in range(DISPLACEMENT_KINDS):
        flag, first, count = rows_of_kind(kind, shared)
        if wanted & flag == 0 or (flag == CONTACT and segment.key == np.uint64(0)):
            continue
        for k in range(count):
            gap = 0.0
            if flag == CONTACT:
                if segment.key & contact_bit(k) == np.uint64(0):
                    continue
                gap = contacts.gap[k]
            p = first + k
            i, below, side, _ = model.watched[p]
            row = (i, below, side, gap)
            ends, bound4 = row_at_ends(row, work.x, work.z_end, work.bounds)
            along = (tables.h[index], span, time, tally.times[p] - time)
            raise_to_ends(ends, side, along, p, tally)
            if row_may_be_higher(peaks[p], side, span, ends, bound4):
                expand_difference(row, index, work.x, tables, work)
                raise_peak(work.drift_rows, along, ends, bound4, side, p, tally, work.stack)


@inlined
def _accelerations_on_segment(segment, span, amplitude, shared):
    """Raise the peaks of absolute accelerations; arguments of `peaks_on_segment`."""
    model, tables, work, outputs = shared.model, shared.tables, shared.work, shared.outputs
    index, size = segment.index, work.z_end.shape[0]
    fill_outputs(index, model, tables, outputs)
    if outputs.place[0] == index and outputs.place[1] == segment.tau:
        copy_state(outputs.end, outputs.start)
    else:
        look(index, work.x, outputs, outputs.start)
    x_end = outputs.x_end
    copy_state(work.x, x_end)
    for row in range(size):
        x_end[row] = work.z_end[row]
    if span == segment.h:
        turn_forcing(x_end, size, tables, index)
    else:
        forcing_after(span, segment.tau + span, amplitude, work.x, size, model, outputs.pairs)
        for k in range(outputs.pairs.shape[0]):
            x_end[size + k] = outputs.pairs[k]
    look(index, x_end, outputs, outputs.end)
    outputs.place[0], outputs.place[1] = index, segment.tau + span
    bound_outputs(index, work.x, outputs)
    start, end, bounds = outputs.start, outputs.end, outputs.bounds
    quarter, sixth = 0.25 * span, span * (1.0 / 6.0)
    fourth = HERMITE_MIDDLE * (span * span) * (span * span)
    for p in range(0, bounds.shape[0], LANES):
        # the quartics above and below of `search`
        peak = load(shared.tally.peaks, outputs.first + p)
        g0, slope0 = load(start, 2 * p), load(start, 2 * p + LANES)
        g1, slope1 = load(end, 2 * p), load(end, 2 * p + LANES)
        limit = peak * (1.0 + SAME_PEAK) + LEAST
        middle = fma(slope0 - slope1, sixth, 0.5 * (g0 + g1))
        more = load(bounds, p) * fourth
        early, late = fma(slope0, quarter, g0), fma(slope1, -quarter, g1)
        # signs one by one: a maximum of Lanes that keeps NaN takes five times a difference
        higher = negative(peak - modulus(g0)) | negative(peak - modulus(g1))
        higher |= negative(limit - modulus(early)) | negative(limit - modulus(late))
        higher |= negative(limit - more - modulus(middle))
        if higher != 0:
            for lane in range(LANES):
                if higher >> lane & 1:
                    _raise_acceleration(p + lane, segment, span, shared)


@inlined
def _raise_acceleration(p, segment, span, shared):
    """Raise the peak of floor p by its extrema on a step."""
    work, outputs, tally = shared.work, shared.outputs, shared.tally
    w, at = outputs.first + p, p + p // LANES * LANES
    start, end = outputs.start, outputs.end
    ends = (start[at], start[at + LANES], end[at], end[at + LANES])
    bound4, time = outputs.bounds[p], time_of(segment.tau, shared.model)
    along = (segment.h, span, time, tally.times[w] - time)
    raise_to_ends(ends, 0, along, w, tally)
    if row_may_be_higher(tally.peaks[w], 0, span, ends, bound4):
        expand_row(outputs.poly, segment.index, p, work.x, outputs.rows)
        raise_peak(outputs.rows[p : p + 1], along, ends, bound4, 0, w, tally, work.stack)
