r"""Peaks of absolute accelerations over a step inside a layer.

The acceleration changes within a layer as fast as the contact's force does: it is no interpolant of
accelerations but the equation of motion itself, along the polynomials of displacements and
velocities (`step.step`). A peak is found on the polynomial of the step that the accelerations at
`SAMPLES` have, where that may exceed the peak so far, and evaluated exactly there: what the place
is off by counts by its square.
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
)
from hpcsweep.solvers.flow.guard.extremum import Peak, raise_peak
from hpcsweep.solvers.flow.layer.scheme import add_sliders
from hpcsweep.solvers.flow.rules.tableau import N_STAGES
from hpcsweep.solvers.flow.state.state import accelerations, time_of
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.step.forcing import forcing_at, n_pairs, total_forcing
from hpcsweep.solvers.flow.step.polynomials import evaluate_rows, value_and_slope
from hpcsweep.solvers.flow.step.step import expand

BETWEEN = 0.1
"""How far a component may come beyond its values at ends and nodes, over their range; of a parabola
between nodes it is 0.03, with its top in the step."""
NEAR_PEAK = 1e-6
"""Relative distance below the peak so far within which a peak is evaluated exactly."""
SAMPLES = chebyshev.chebpts1(N_COEFFICIENTS)
TO_POWERS = np.ascontiguousarray(np.linalg.inv(np.vander(SAMPLES, increasing=True)).T)
"""Row k: coefficients of the polynomial per value at sample k."""


@inlined
def may_be_higher(ground0, ground1, first, model, tally, work):
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
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    values, rows, h = local_vector(N_COEFFICIENTS), local_matrix(1, N_COEFFICIENTS), segment.h
    time = time_of(segment.tau, model)
    for i in range(model.ground.shape[0]):
        p = shared.outputs.first + i
        if not _floor_may_be_higher(i, ground0, ground1, tally.peaks[p], model, work):
            continue
        for row in range(work.step.z_end.shape[0]):
            expand(row, segment, tables, work.step)
        for k in range(N_COEFFICIENTS):
            s = 0.5 * h * (1.0 + SAMPLES[k])
            values[k] = _acceleration_at(s, i, segment, amplitude, shared)
        for c in range(0, N_COEFFICIENTS, LANES):
            count = N_COEFFICIENTS
            combine(rows, c, ZERO, 0, 1.0, TO_POWERS, c, count, values, 0, count)
        g0, v0 = value_and_slope(rows, 0, h, 0.0)
        g1, v1 = value_and_slope(rows, 0, h, h)
        values[0] = (1.0 - NEAR_PEAK) * tally.peaks[p]
        peak, ends = Peak(values, 0, tally.times[p] - time), (g0, v0, g1, v1)
        at = raise_peak(rows, h, h, ends, math.inf, 0, peak)
        if at >= 0.0:
            size = abs(_acceleration_at(at, i, segment, amplitude, shared))
            if size > tally.peaks[p]:
                tally.peaks[p], tally.times[p] = size, time + at


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
