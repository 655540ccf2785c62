"""Largest storey drift over continuous time, and the peak of a row on any step."""

import math

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.guard.extremum import (
    Peak,
    raise_peak,
    raise_to_ends,
    row_at_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.flow.step.step import bound_all_rows, bound_of_row, expand


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
        expand_difference(row, segment, tables, step)
        rows, h, bound4 = step.combined, segment.h, bound_of_row(segment, bound4)
        higher = raise_peak(rows, h, span, ends, bound4, side, peak, step.stack)
        at = higher if higher >= 0.0 else at
    return at


@inlined
def largest_of_storeys(model, tally):
    """Raise the largest drift to the peaks of the storeys, where these are gathered instead."""
    for d in range(model.drift_rows.shape[0]):
        tally.peak_drift[0] = max(tally.peak_drift[0], tally.peaks[d])


@inlined
def expand_difference(row, segment, tables, step):
    """Write the polynomial of a row, as of `row_at_ends`, into ``step.combined``."""
    i, below, side, gap = row
    sign = -1.0 if side < 0 else 1.0
    expand(i, segment, tables, step)
    if below >= 0:
        expand(below, segment, tables, step)
    for p in range(N_COEFFICIENTS):
        step.combined[0, p] = sign * step.rows[i, p]
        if below >= 0:
            step.combined[0, p] -= sign * step.rows[below, p]
    step.combined[0, 0] -= gap
