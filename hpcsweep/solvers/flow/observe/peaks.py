"""Peaks of single rows and their times over continuous time.

Drifts, floors and distances of closed contacts past their stops are taken from the states at both
ends of any step (`drift`), absolute accelerations on linear segments from their tables (`outputs`),
eight at once. A
peak is first raised to what is reached at the ends, and then looked for only where the Hermite
bound of `search` allows more.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, modulus, negative, store
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.model.kernel_model import ACCELERATION, CONTACT, DRIFT, FLOOR
from hpcsweep.solvers.flow.linear.forcing import (
    forcing_after,
    forcing_rate,
    total_forcing,
    turn_forcing,
)
from hpcsweep.solvers.flow.linear.polynomials import (
    expand_row,
    fourth_derivative,
    value_and_slope,
)
from hpcsweep.solvers.flow.linear.series import IN_SERIES
from hpcsweep.solvers.flow.linear.spectral import (
    bound_by_terms,
    is_spectral,
    write_accelerations,
    write_forcing,
)
from hpcsweep.solvers.flow.observe.dense_output import expand
from hpcsweep.solvers.flow.observe.drift import (
    SAME_PEAK,
    Peak,
    bound_measured,
    raise_peak,
    raise_row,
    raise_to_ends,
    row_at_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.observe.outputs import differentiate, fill_outputs
from hpcsweep.solvers.flow.search.search import HERMITE_MIDDLE
from hpcsweep.solvers.flow.state.products import (
    add_product,
    add_product_of_moduli,
    product,
    product_of_moduli,
)
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state, time_of
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.workspace import N_TERMS

DISPLACEMENT_KINDS = 3
DISPLACEMENTS = DRIFT | FLOOR | CONTACT
LEAST = 1e-200
"""Excess over a peak that is not looked for, however small the peak is."""
FIFTH_OF_TERMS = np.array([math.perm(k, 5) for k in range(N_TERMS)], float)
"""As `series.FOURTH_OF_TERMS`, of speeds for accelerations."""


@inlined
def _rows_of_kind(kind, shared):
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
    if wanted & DISPLACEMENTS:
        displacements_on_segment(segment, span, wanted, False, shared)
    if wanted & ACCELERATION:
        _accelerations_on_segment(segment, span, amplitude, shared)


@inlined
def displacements_on_segment(segment, span, wanted, only_look, shared):
    """Raise the wanted peaks of drifts, floors and closed contacts over the present step.

    With `only_look` none is raised; return then whether one may be.
    """
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    contacts, peaks = model.contacts, tally.peaks
    time = time_of(segment.tau, model)
    bound_measured(segment, tables, work)
    for kind in range(DISPLACEMENT_KINDS):
        flag, first, count = _rows_of_kind(kind, shared)
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
            if only_look:
                ends, bound4 = row_at_ends(row, work.x, work.z_end, work.bounds)
                if row_may_be_higher(peaks[p], side, span, ends, bound4):
                    return True
                continue
            peak = Peak(peaks, p, tally.times[p] - time)
            at = raise_row(row, peak, segment, span, tables, work)
            if at >= 0.0:
                tally.times[p] = time + at
    return False


@inlined
def _accelerations_on_segment(segment, span, amplitude, shared):
    """Raise the peaks of absolute accelerations; arguments of `peaks_on_segment`."""
    outputs = shared.outputs
    if segment.index == IN_SERIES:
        _ends_in_series(segment, span, shared)
    elif is_spectral(shared.tables):
        _ends_in_modes(segment, span, amplitude, shared)
    else:
        _ends_by_tables(segment, span, amplitude, shared)
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
def _ends_by_tables(segment, span, amplitude, shared):
    """Write accelerations and slopes at both ends of a step of a table, and their bounds."""
    model, tables, work, outputs = shared.model, shared.tables, shared.work, shared.outputs
    index, size = segment.index, work.z_end.shape[0]
    fill_outputs(index, model, tables, outputs)
    if outputs.place[0] == index and outputs.place[1] == segment.tau:
        copy_state(outputs.end, outputs.start)
    else:
        _write_pairs(work.x, index, shared, outputs.start)
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
    _write_pairs(x_end, index, shared, outputs.end)
    outputs.place[0], outputs.place[1] = index, segment.tau + span
    tails = work.tails
    if tails.table[0] == index + 1:
        columns, bounds = (0, size + outputs.pairs.shape[0]), outputs.bounds
        add_product_of_moduli(outputs.bound4, index, work.x, columns, tails.pair_bound4, bounds)
    else:
        product_of_moduli(outputs.bound4, index, work.x, outputs.bounds)


@inlined
def _write_pairs(x, index, shared, out):
    """Write accelerations and slopes in an augmented state by a table."""
    outputs, tails = shared.outputs, shared.work.tails
    if tails.table[0] == index + 1:
        columns = (0, shared.work.z_end.shape[0] + outputs.pairs.shape[0])
        add_product(outputs.pair, index, x, columns, tails.pair, out)
    else:
        product(outputs.pair, index, x, out)


@kernel
def _ends_in_series(segment, span, shared):
    """Write the same of a step that is a series: by its terms, with polynomials beside modes."""
    model, outputs, x = shared.model, shared.outputs, shared.work.x
    outputs.place[0] = IN_SERIES
    if is_spectral(shared.tables):
        for p in range(outputs.rows.shape[0]):
            _ends_of_polynomial(p, segment, span, shared)
        return
    terms, size, rate = shared.work.series.terms, shared.work.z_end.shape[0], 1.0 / segment.h
    flat, half, ratio = terms.shape[1], size // 2, span * rate
    ground, slope = total_forcing(x, size, model), forcing_rate(x, size, model)
    for p in range(0, outputs.bounds.shape[0], LANES):
        share, first = load(outputs.ground, p), half + p
        value = bend = bound = load(ZERO, 0)
        for k in range(shared.work.series.count[0] - 1, 0, -1):
            term = load(terms, k * flat + first)
            bend = fma(bend, ratio, value)
            value = fma(value, ratio, term * (1.0 * k))
            bound = fma(modulus(term), FIFTH_OF_TERMS[k], bound)
        store(outputs.start, 2 * p, fma(share, ground, load(terms, flat + first) * rate))
        early = load(terms, 2 * flat + first) * (2.0 * rate * rate)
        store(outputs.start, 2 * p + LANES, fma(share, slope, early))
        store(outputs.end, 2 * p, fma(share, fma(slope, span, ground), value * rate))
        store(outputs.end, 2 * p + LANES, fma(share, slope, bend * (rate * rate)))
        store(outputs.bounds, p, bound * (rate * rate * rate * rate * rate))
    for p in range(outputs.rows.shape[0], outputs.bounds.shape[0]):
        # behind the floors the terms go on with other rows, whose accelerations are nobody's
        at = p + p // LANES * LANES
        outputs.start[at] = outputs.start[at + LANES] = 0.0
        outputs.end[at] = outputs.end[at + LANES] = outputs.bounds[p] = 0.0


@inlined
def _ends_of_polynomial(p, segment, span, shared):
    """Write the same of one acceleration by its polynomial."""
    outputs, h, at = shared.outputs, segment.h, p + p // LANES * LANES
    _write_acceleration(p, segment, shared)
    rows = outputs.rows[p : p + 1]
    outputs.start[at], outputs.start[at + LANES] = value_and_slope(rows, 0, h, 0.0)
    outputs.end[at], outputs.end[at + LANES] = value_and_slope(rows, 0, h, span)
    outputs.bounds[p] = fourth_derivative(rows, h)


@kernel
def _ends_in_modes(segment, span, amplitude, shared):
    """Write the same of a step in modes; polynomials of bases alone, beside closed contacts."""
    model, work, outputs, x = shared.model, shared.work, shared.outputs, shared.work.x
    spectrum, own = shared.tables.spectrum, work.spectral
    h, size, count = segment.h, work.z_end.shape[0], outputs.rows.shape[0]
    write_accelerations(0.0, h, count, spectrum, own, outputs.start)
    write_accelerations(span, h, count, spectrum, own, outputs.end)
    bound_by_terms(5, h, count, spectrum, own, outputs.bounds)
    forcing_after(span, segment.tau + span, amplitude, x, size, model, outputs.pairs)
    bend = 0.0
    for k in range(model.harmonics.shape[0]):
        most = abs(x[size + 2 * k]) + abs(x[size + 2 * k + 1])
        bend += (model.harmonics[k, 0] * model.omega) ** 4 * most
    for p in range(count):
        at, share = p + p // LANES * LANES, model.ground[p]
        outputs.start[at] += share * total_forcing(x, size, model)
        outputs.start[at + LANES] += share * forcing_rate(x, size, model)
        outputs.end[at] += share * total_forcing(outputs.pairs, 0, model)
        outputs.end[at + LANES] += share * forcing_rate(outputs.pairs, 0, model)
        outputs.bounds[p] += abs(share) * bend
        if p >= model.modal_transform.shape[0] and segment.key != np.uint64(0):
            _ends_of_polynomial(p, segment, span, shared)
    outputs.place[0] = IN_SERIES


@kernel
def _write_acceleration(p, segment, shared):
    """Write the polynomial of an acceleration along a step without a table."""
    model, work, h = shared.model, shared.work, segment.h
    size, out = work.z_end.shape[0], shared.outputs.rows[p]
    expand(size // 2 + p, segment, shared.tables, work)
    differentiate(work.rows[size // 2 + p], h, out)
    if is_spectral(shared.tables):
        write_forcing(h, model, work, work.layer.values)
        _add_forcing(p, segment, out, shared)
    else:
        slope = 0.5 * h * forcing_rate(work.x, size, model)
        out[0] += model.ground[p] * (total_forcing(work.x, size, model) + slope)
        out[1] += model.ground[p] * slope


@kernel
def _add_forcing(p, segment, out, shared):
    """Add what the ground has to the polynomial of an acceleration, and take from that of a base.

    The reaction of a base is without what contacts do.
    """
    model, work, contacts = shared.model, shared.work, shared.model.contacts
    n, size = model.modal_transform.shape[0], work.z_end.shape[0]
    for power in range(N_COEFFICIENTS):
        out[power] += model.ground[p] * work.layer.values[power]
    for k in range(contacts.row.shape[0] if p >= n else 0):
        if segment.key & contact_bit(k) == np.uint64(0):
            continue
        push = 0.0
        for j in range(n):
            push += model.rows[p - n, j] * contacts.kick[k, j]
        row, sign = contacts.row[k], contacts.sign[k]
        expand(row, segment, shared.tables, work)
        expand(size // 2 + row, segment, shared.tables, work)
        for power in range(N_COEFFICIENTS):
            out[power] += push * contacts.beta[k] * sign * work.rows[row, power]
            out[power] += push * contacts.edges[k, DRAG] * sign * work.rows[size // 2 + row, power]
        out[0] -= push * contacts.beta[k] * contacts.gap[k]


@inlined
def _raise_acceleration(p, segment, span, shared):
    """Raise the peak of floor p by its extrema on a step."""
    work, outputs, peaks = shared.work, shared.outputs, shared.tally.peaks
    w, at = outputs.first + p, p + p // LANES * LANES
    start, end = outputs.start, outputs.end
    ends = (start[at], start[at + LANES], end[at], end[at + LANES])
    bound4, time = outputs.bounds[p], time_of(segment.tau, shared.model)
    peak = Peak(peaks, w, shared.tally.times[w] - time)
    reached = raise_to_ends(ends, 0, span, peak)
    if row_may_be_higher(peaks[w], 0, span, ends, bound4):
        rows = outputs.rows[p : p + 1]
        if segment.index == IN_SERIES or is_spectral(shared.tables):
            _write_acceleration(p, segment, shared)
        else:
            expand_row(outputs.poly, segment.index, p, work.x, outputs.rows)
        found = raise_peak(rows, segment.h, span, ends, bound4, 0, peak, work.stack)
        reached = found if found >= 0.0 else reached
    if reached >= 0.0:
        shared.tally.times[w] = time + reached
