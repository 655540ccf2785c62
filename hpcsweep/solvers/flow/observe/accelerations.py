"""Peaks of absolute accelerations.

Along linear steps they are taken from their tables (`step.outputs`), eight at once. Within a layer
they change as fast as the contact's force does: there they are no interpolant of accelerations but
the equation of motion itself, along the polynomials of displacements and velocities (`step.step`).
A peak is found on the polynomial of the step that the accelerations at `SAMPLES` have, where that
may exceed the peak so far, and evaluated exactly there: what the place is off by counts by its
square.
"""

import math

import numpy as np
from numpy.polynomial import chebyshev

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    load,
    local_matrix,
    local_vector,
    maximum,
    modulus,
    negative,
)
from hpcsweep.solvers.flow.guard.extremum import (
    SAME_PEAK,
    Peak,
    raise_peak,
    raise_to_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.guard.search import HERMITE_MIDDLE
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.state.state import accelerations, add_sliders, time_of
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, OF_ACCELERATIONS, ZERO
from hpcsweep.solvers.flow.step.accelerations import ends_of_accelerations, expand_acceleration
from hpcsweep.solvers.flow.step.forcing import forcing_at, n_pairs, total_forcing
from hpcsweep.solvers.flow.step.polynomials import evaluate_rows, value_and_slope
from hpcsweep.solvers.flow.step.step import expand

LEAST = 1e-200
"""Excess over a peak that is not looked for, however small the peak is."""
BETWEEN = 0.1
"""How far a component may come beyond its values at ends and nodes, over their range; of a parabola
between nodes it is 0.03, with its top in the step."""
NEAR_PEAK = 1e-6
"""Relative distance below the peak so far within which a peak is evaluated exactly."""
SAMPLES = chebyshev.chebpts1(N_COEFFICIENTS)
TO_POWERS = np.ascontiguousarray(np.linalg.inv(np.vander(SAMPLES, increasing=True)).T)
"""Row k: coefficients of the polynomial per value at sample k."""


@inlined
def accelerations_on_segment(segment, span, amplitude, model, tables, outputs, tally, step):
    """Raise the peaks of absolute accelerations; arguments of `peaks.peaks_on_segment`."""
    end = outputs.end
    start, bounds = local_vector(end.shape[0]), local_vector(end.shape[0] // 2)
    ends_of_accelerations(segment, span, amplitude, model, tables, outputs, step, start, bounds)
    quarter, sixth = 0.25 * span, span * (1.0 / 6.0)
    fourth = HERMITE_MIDDLE * (span * span) * (span * span)
    for p in range(0, bounds.shape[0], LANES):
        # the quartics above and below of `search`
        peak = load(tally.peaks, outputs.first[OF_ACCELERATIONS] + p)
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
                    at = 2 * p + lane
                    ends = (start[at], start[at + LANES], end[at], end[at + LANES])
                    bound = bounds[p + lane]
                    _raise_acceleration(
                        p + lane, segment, span, ends, bound, model, tables, outputs, tally, step
                    )


@inlined
def _raise_acceleration(p, segment, span, ends, bound4, model, tables, outputs, tally, step):
    """Raise the peak of floor p by its extrema on a step."""
    peaks, w, time = tally.peaks, outputs.first[OF_ACCELERATIONS] + p, time_of(segment.tau, model)
    peak = Peak(peaks, w, tally.times[w] - time)
    reached = raise_to_ends(ends, 0, span, peak)
    if row_may_be_higher(peaks[w], 0, span, ends, bound4):
        rows = local_matrix(1, N_COEFFICIENTS)
        expand_acceleration(p, segment, model, tables, outputs, step, rows[0])
        higher = raise_peak(rows, segment.h, span, ends, bound4, 0, peak)
        reached = higher if higher >= 0.0 else reached
    if reached >= 0.0:
        tally.times[w] = time + reached


@inlined
def acceleration_may_be_higher(ground0, ground1, first, model, tally, work):
    """Return whether an acceleration may exceed its peak on the present step, by its stages.

    Parameters
    ----------
    ground0, ground1 : float
        The forcing at both ends.
    first : int
        Place of the accelerations in `Model.watched`.
    model, tally, work
        Of `Shared`.
    """
    for i in range(model.ground.shape[0]):
        if _floor_may_be_higher(i, ground0, ground1, tally.peaks[first + i], model, work):
            return True
    return False


@inlined
def _floor_may_be_higher(i, ground0, ground1, peak, model, work):
    """Return whether the acceleration of floor i may exceed a peak."""
    own = model.ground[i]
    start, end = work.step.a[i] + own * ground0, work.step.a_end[i] + own * ground1
    inner = fma(load(work.step.layer.ground, 0), own, load(work.step.layer.g, i * N_STAGES))
    top = max(maximum(inner), max(start, end))
    bottom = min(-maximum(0.0 - inner), min(start, end))
    return not max(top, -bottom) + BETWEEN * (top - bottom) <= peak


@inlined
def accelerations_in_layer(segment, amplitude, ground0, ground1, shared):
    """Raise the peaks of absolute accelerations over the present step."""
    model, work, tally = shared.model, shared.work, shared.tally
    highest, rows, h = local_vector(1), local_matrix(1, N_COEFFICIENTS), segment.h
    time = time_of(segment.tau, model)
    for i in range(model.ground.shape[0]):
        p = shared.outputs.first[OF_ACCELERATIONS] + i
        if not _floor_may_be_higher(i, ground0, ground1, tally.peaks[p], model, work):
            continue
        expand_acceleration_in_layer(i, segment, amplitude, shared, rows)
        g0, v0 = value_and_slope(rows, 0, h, 0.0)
        g1, v1 = value_and_slope(rows, 0, h, h)
        highest[0] = (1.0 - NEAR_PEAK) * tally.peaks[p]
        peak, ends = Peak(highest, 0, tally.times[p] - time), (g0, v0, g1, v1)
        at = raise_peak(rows, h, h, ends, math.inf, 0, peak)
        if at >= 0.0:
            size = abs(_acceleration_at(at, i, segment, amplitude, shared))
            if size > tally.peaks[p]:
                tally.peaks[p], tally.times[p] = size, time + at


@inlined
def expand_acceleration_in_layer(i, segment, amplitude, shared, rows):
    """Write the polynomial of the acceleration of floor i at `SAMPLES` into polynomial 0."""
    values, step = local_vector(N_COEFFICIENTS), shared.work.step
    for row in range(step.z_end.shape[0]):
        expand(row, segment, shared.tables, step)
    for k in range(N_COEFFICIENTS):
        s = 0.5 * segment.h * (1.0 + SAMPLES[k])
        values[k] = _acceleration_at(s, i, segment, amplitude, shared)
    for c in range(0, N_COEFFICIENTS, LANES):
        count = N_COEFFICIENTS
        combine(rows, c, ZERO, 0, 1.0, TO_POWERS, c, count, values, 0, count)


@inlined
def _acceleration_at(s, i, segment, amplitude, shared):
    """Evaluate the absolute acceleration of floor i at time s of the present step."""
    model, stage, rows = shared.model, shared.work.step.layer, shared.work.step.rows
    pairs, state = local_vector(n_pairs(model)), local_vector(rows.shape[0])
    rates = local_vector(rows.shape[0] // 2)
    evaluate_rows(rows, segment.h, s, state)
    forcing_at(segment.tau + s, amplitude, model, pairs, 0)
    ground = total_forcing(pairs, 0, model)
    accelerations(ground, state, model, rates)
    add_sliders(state, model.elements, stage, rates)
    return rates[i] + model.ground[i] * ground
