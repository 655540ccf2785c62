"""Peaks of the outputs (`outputs`) and their times over continuous time, on linear segments.

A peak is first raised to what is reached at the ends of a segment, and then looked for only where
the Hermite bound of `search` allows more: eight outputs at once.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, greatest, load, negative
from hpcsweep.solvers.flow.linear.forcing import forcing_after, turn_forcing
from hpcsweep.solvers.flow.linear.polynomials import expand_row
from hpcsweep.solvers.flow.observe.drift import SAME_PEAK, search_peak
from hpcsweep.solvers.flow.observe.outputs import (
    bound_outputs,
    differentiate,
    fill_outputs,
    forced_row,
    look,
)
from hpcsweep.solvers.flow.search.search import HERMITE_MIDDLE
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS

LEAST = 1e-200
"""Excess over a peak that is not looked for, however small the peak is."""
ALL = (1 << LANES) - 1


@inlined
def peaks_on_segment(segment, span, time, amplitude, wanted, shared):
    """Raise the peaks that are wanted over the first `span` of a linear step to ``work.z_end``.

    `time` is that of its start, from which the times of peaks count.
    """
    model, tables, work, outputs = shared.model, shared.tables, shared.work, shared.outputs
    index, size = segment.index, work.z_end.shape[0]
    fill_outputs(index, wanted, model, tables, outputs)
    if outputs.place[0] == index and outputs.place[1] == segment.tau:
        copy_state(outputs.end, outputs.start)
    else:
        look(index, work.x, wanted, model, outputs, outputs.start)
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
    look(index, x_end, wanted, model, outputs, outputs.end)
    outputs.place[0], outputs.place[1] = index, segment.tau + span
    _peaks_on_step(index, span, time, wanted, shared)


@inlined
def _peaks_on_step(index, span, time, wanted, shared):
    """Raise the peaks that are wanted over the first `span` of a linear step from ``work.x``.

    ``outputs.start`` and ``outputs.end`` have values and slopes at its ends, and
    ``work.expanded`` tells which polynomials are there. `time` is that of its start.
    """
    model, outputs, peaks = shared.model, shared.outputs, shared.tally.peaks
    start, end = outputs.start, outputs.end
    quarter, sixth = 0.25 * span, span * (1.0 / 6.0)
    fourth = HERMITE_MIDDLE * (span * span) * (span * span)
    for first in range(0, peaks.shape[0], LANES):
        if model.watched[first, 3] & wanted == 0:
            continue
        at = 2 * first
        g0, g1, sides = load(start, at), load(end, at), load(outputs.sides, first)
        reached = greatest(greatest(g0, g1), greatest(-1.0 * g0, -1.0 * g1) * sides)
        raised = negative(load(peaks, first) - reached)
        if raised != 0:
            _raise_to_ends(first, raised, span, time, shared.tally, outputs)
        # the quartics above and below of `search`
        slope0, slope1 = load(start, at + LANES), load(end, at + LANES)
        middle = fma(slope0 - slope1, sixth, 0.5 * (g0 + g1))
        bound_outputs(index, shared.work.x, first, outputs)
        more = load(outputs.bounds, first) * fourth
        early, late = fma(slope0, quarter, g0), fma(slope1, -quarter, g1)
        top = greatest(greatest(early, late), middle + more)
        bottom = greatest(greatest(-1.0 * early, -1.0 * late), -1.0 * middle + more)
        size = greatest(top, bottom * sides)
        low = negative(size - load(peaks, first) * (1.0 + SAME_PEAK) - LEAST)
        if low != ALL:
            for p in range(first, first + LANES):
                if not low >> (p - first) & 1 and model.watched[p, 3] & wanted != 0:
                    _search(p, index, span, time, shared)


@kernel
def _raise_to_ends(first, raised, span, time, tally, outputs):
    """Raise peaks, a set of `LANES` from `first` on, to the values at the ends of a step."""
    for lane in range(LANES):
        if raised >> lane & 1:
            p = first + lane
            at = first + p
            g0, g1 = outputs.start[at], outputs.end[at]
            if outputs.sides[p] > 0.0:
                g0, g1 = abs(g0), abs(g1)
            tally.peaks[p] = max(g0, g1)
            tally.times[p] = time if g0 > g1 else time + span


@kernel
def _search(p, index, span, time, shared):
    """Raise one peak by the extrema of its polynomial on a step."""
    tables, work, outputs, tally = shared.tables, shared.work, shared.outputs, shared.tally
    rows, expanded, h = outputs.rows, work.expanded, tables.h[index]
    forced = forced_row(p, shared.model)
    for c in range(N_COEFFICIENTS):
        work.drift_rows[0, c] = 0.0
    for j in range(rows.shape[2]):
        weight = rows[index, p, j] if forced < 0 else 1.0 * (j == forced)
        if weight != 0.0:
            if not expanded[j]:
                expand_row(tables.poly, index, j, work.x, work.rows)
                expanded[j] = True
            for c in range(N_COEFFICIENTS):
                work.drift_rows[0, c] += weight * work.rows[j, c]
    if forced >= 0:
        differentiate(work.drift_rows[0], h, work.drift_rows[0])
    else:
        work.drift_rows[0, 0] += outputs.constant[index, p]
    side = 0 if outputs.sides[p] > 0.0 else 1
    bound4 = outputs.bounds[p]
    at = search_peak(work.drift_rows, h, span, bound4, side, p, tally.peaks, work.stack)
    if at >= 0.0:
        tally.times[p] = time + at
