"""Peaks of rows and their times over continuous time: of each quantity of `observed.PEAKS`.

Drifts, floors and distances of closed contacts past their stops are taken from the states at both
ends of any step (`raise_row`); a peak is first raised to what is reached at the ends, and then
looked for only where the Hermite bound of `search` allows more. Accelerations of floors are those
of `accelerations`. What a step raises is said in `peaks_on_segment`, `peaks_may_rise` and
`peaks_in_layer` alone; who marches only hands on what is wanted.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_matrix
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.observed import ACCELERATION, CONTACT, DRIFT, FLOOR
from hpcsweep.solvers.flow.guard.extremum import (
    Peak,
    raise_peak,
    raise_to_ends,
    row_at_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.observe.accelerations import (
    acceleration_may_be_higher,
    accelerations_in_layer,
    accelerations_on_segment,
)
from hpcsweep.solvers.flow.state.state import contact_bit, time_of
from hpcsweep.solvers.flow.state.tables import (
    N_COEFFICIENTS,
    OF_ACCELERATIONS,
    OF_CONTACTS,
    OF_FLOORS,
)
from hpcsweep.solvers.flow.step.polynomials import value_and_slope
from hpcsweep.solvers.flow.step.step import bound_all_rows, bound_of_row, expand, write_row

DISPLACEMENT_KINDS = 3
DISPLACEMENTS = DRIFT | FLOOR | CONTACT


@inlined
def _rows_of_kind(kind, model, outputs):
    """Return the flag of drifts, floors or contacts, where in `Model.watched`, and how many."""
    if kind == 0:
        return DRIFT, 0, model.drift_rows.shape[0]
    if kind == 1:
        return FLOOR, outputs.first[OF_FLOORS], model.ground.shape[0]
    return CONTACT, outputs.first[OF_CONTACTS], model.contacts.row.shape[0]


@inlined
def peaks_on_segment(segment, span, amplitude, wanted, model, tables, outputs, tally, step):
    """Raise the peaks that are wanted over the first `span` of a linear step to ``step.z_end``.

    ``step.expanded`` tells which polynomials are there, and ``step.bounds`` the bounds of the
    fourth derivatives on the step.
    """
    if wanted & DISPLACEMENTS:
        displacements_on_segment(segment, span, wanted, False, model, tables, outputs, tally, step)
    if wanted & ACCELERATION:
        accelerations_on_segment(segment, span, amplitude, model, tables, outputs, tally, step)


@inlined
def peaks_may_rise(segment, ground0, ground1, wanted, shared):
    """Return whether a step inside a layer may raise a wanted peak.

    Parameters
    ----------
    segment : Segment
    ground0, ground1 : float
        The forcing at both ends.
    wanted : int
    shared : Shared
        Its present step has the accelerations at both ends.
    """
    model, outputs, tally, work = shared.model, shared.outputs, shared.tally, shared.work
    if wanted & DISPLACEMENTS and displacements_on_segment(
        segment, segment.h, wanted, True, model, shared.tables, outputs, tally, work.step
    ):
        return True
    return wanted & ACCELERATION != 0 and acceleration_may_be_higher(
        ground0, ground1, outputs.first[OF_ACCELERATIONS], model, tally, work
    )


@inlined
def peaks_in_layer(segment, amplitude, ground0, ground1, wanted, shared):
    """Raise the wanted peaks over a step inside a layer; see `peaks_may_rise`."""
    model, outputs, tally, step = shared.model, shared.outputs, shared.tally, shared.work.step
    if wanted & DISPLACEMENTS:
        displacements_on_segment(
            segment, segment.h, wanted, False, model, shared.tables, outputs, tally, step
        )
    if wanted & ACCELERATION:
        accelerations_in_layer(segment, amplitude, ground0, ground1, shared)


@inlined
def displacements_on_segment(segment, span, wanted, only_look, model, tables, outputs, tally, step):
    """Raise the wanted peaks of drifts, floors and closed contacts over the present step.

    With `only_look` none is raised; return then whether one may be.
    """
    contacts, peaks = model.contacts, tally.peaks
    time = time_of(segment.tau, model)
    bound_all_rows(segment, tables, step)
    for kind in range(DISPLACEMENT_KINDS):
        flag, first, count = _rows_of_kind(kind, model, outputs)
        if wanted & flag == 0 or (flag == CONTACT and segment.key == np.uint64(0)):
            continue
        for k in range(count):
            gap = 0.0
            if flag == CONTACT:
                if segment.key & contact_bit(k) == np.uint64(0):
                    continue
                if contacts.edges[k, DASHPOT] > 0.0:
                    _raise_force(k, first + k, segment, span, model, tables, tally, step)
                    continue
                gap = contacts.gap[k]
            p = first + k
            i, below, side, _ = model.watched[p]
            row = (i, below, side, gap)
            if only_look:
                ends, bound4 = row_at_ends(row, step.x, step.z_end, step.bounds)
                if row_may_be_higher(peaks[p], side, span, ends, bound4):
                    return True
                continue
            peak = Peak(peaks, p, tally.times[p] - time)
            at = raise_row(row, peak, segment, span, tables, step)
            if at >= 0.0:
                tally.times[p] = time + at
    return False


@kernel
def _raise_force(k, w, segment, span, model, tables, tally, step):
    """Raise the peak w of the force, over its unit, of a contact with a dashpot that pushes."""
    rows, h, time = local_matrix(1, N_COEFFICIENTS), segment.h, time_of(segment.tau, model)
    edges, row = model.contacts.edges[k], model.contacts.row[k]
    spring, dashpot = edges[SPRING], edges[DASHPOT]
    law = (edges[0] * spring, edges[0] * dashpot, spring * model.contacts.gap[k])
    bound4 = write_row((row, -1), law, segment, tables, step, rows)
    g0, v0 = value_and_slope(rows, 0, h, 0.0)
    g1, v1 = value_and_slope(rows, 0, h, span)
    ends = (g0, v0, g1, v1)
    peak = Peak(tally.peaks, w, tally.times[w] - time)
    at = raise_to_ends(ends, 1, span, peak)
    if row_may_be_higher(tally.peaks[w], 1, span, ends, bound4):
        higher = raise_peak(rows, h, span, ends, bound4, 1, peak)
        at = higher if higher >= 0.0 else at
    if at >= 0.0:
        tally.times[w] = time + at


@inlined
def drift_on_segment(segment, span, model, tables, tally, step):
    """Update the largest drift over the first `span` of the present step."""
    bound_all_rows(segment, tables, step)
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        peak = Peak(tally.peak_drift, 0, -math.inf)
        raise_row((i, below, 0, 0.0), peak, segment, span, tables, step)


@inlined
def raise_row(row, peak, segment, span, tables, step):
    """Raise a `Peak` to that of a row, as of `row_at_ends`, over the first `span` of a step.

    Returns
    -------
    float
        Time of the peak in the step, -1 if it has not been raised.
    """
    side = row[2]
    ends, bound4 = row_at_ends(row, step.x, step.z_end, step.bounds)
    at = raise_to_ends(ends, side, span, peak)
    if row_may_be_higher(peak.values[peak.place], side, span, ends, bound4):
        rows, bound4 = local_matrix(1, N_COEFFICIENTS), bound_of_row(segment, bound4)
        expand_difference(row, segment, tables, step, rows)
        higher = raise_peak(rows, segment.h, span, ends, bound4, side, peak)
        at = higher if higher >= 0.0 else at
    return at


@inlined
def largest_of_storeys(model, tally):
    """Raise the largest drift to the peaks of the storeys, where these are gathered instead."""
    for d in range(model.drift_rows.shape[0]):
        tally.peak_drift[0] = max(tally.peak_drift[0], tally.peaks[d])


@inlined
def expand_difference(row, segment, tables, step, out):
    """Write the polynomial of a row, as of `row_at_ends`, into polynomial 0 of `out`."""
    i, below, side, gap = row
    sign = -1.0 if side < 0 else 1.0
    expand(i, segment, tables, step)
    if below >= 0:
        expand(below, segment, tables, step)
    for p in range(N_COEFFICIENTS):
        out[0, p] = sign * step.rows[i, p]
        if below >= 0:
            out[0, p] -= sign * step.rows[below, p]
    out[0, 0] -= gap
