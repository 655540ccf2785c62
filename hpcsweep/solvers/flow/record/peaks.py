"""Peaks of the outputs and their times, over continuous time or at the samples."""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, greatest, load, negative
from hpcsweep.solvers.flow.linear.polynomials import expand_row
from hpcsweep.solvers.flow.observe.drift import SAME_PEAK, search_peak
from hpcsweep.solvers.flow.search.search import HERMITE_MIDDLE
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, product, product_of_moduli

LEAST = 1e-200
"""Excess over a peak that is not looked for, however small the peak is."""
ALL = (1 << LANES) - 1


@kernel
def look(index, x, outputs, out):
    """Write values and slopes of the outputs in an augmented state."""
    product(outputs.pair, index, x, out)


@inlined
def peaks_on_step(index, span, time, model, tables, outputs, work):
    """Raise the peaks over the first `span` of a linear step from ``work.x``.

    ``outputs.start`` and ``outputs.end`` have values and slopes at its ends, and
    ``work.expanded`` tells which polynomials are there. `time` is that of its start.
    """
    product_of_moduli(outputs.bound4, index, work.x, outputs.bounds)
    wide = outputs.peaks.shape[0]
    start, end = outputs.start, outputs.end
    quarter, sixth = 0.25 * span, span * (1.0 / 6.0)
    fourth = HERMITE_MIDDLE * (span * span) * (span * span)
    for first in range(0, wide, LANES):
        # the quartics above and below of `search`, of eight outputs at once
        g0, g1 = load(start, first), load(end, first)
        slope0, slope1 = load(start, wide + first), load(end, wide + first)
        middle = fma(slope0 - slope1, sixth, 0.5 * (g0 + g1))
        more = load(outputs.bounds, first) * fourth
        early, late = fma(slope0, quarter, g0), fma(slope1, -quarter, g1)
        top = greatest(greatest(greatest(g0, g1), greatest(early, late)), middle + more)
        bottom = greatest(
            greatest(greatest(-1.0 * g0, -1.0 * g1), -1.0 * middle + more),
            greatest(-1.0 * early, -1.0 * late),
        )
        size = greatest(top, bottom * load(outputs.sides, first))
        low = negative(size - load(outputs.peaks, first) * (1.0 + SAME_PEAK) - LEAST)
        if low != ALL:
            for p in range(first, min(first + LANES, outputs.rows.shape[1])):
                if not low >> (p - first) & 1:
                    _search(p, index, span, time, tables, outputs, work)


@kernel
def _search(p, index, span, time, tables, outputs, work):
    """Raise one peak by the extrema of its polynomial on a step."""
    rows, expanded = outputs.rows, work.expanded
    for c in range(N_COEFFICIENTS):
        work.drift_rows[0, c] = 0.0
    for j in range(rows.shape[2]):
        weight = rows[index, p, j]
        if weight != 0.0:
            if not expanded[j]:
                expand_row(tables.poly, index, j, work.x, work.rows)
                expanded[j] = True
            for c in range(N_COEFFICIENTS):
                work.drift_rows[0, c] += weight * work.rows[j, c]
    work.drift_rows[0, 0] += outputs.constant[index, p]
    side = 0 if outputs.sides[p] > 0.0 else 1
    at = search_peak(
        work.drift_rows,
        tables.h[index],
        span,
        outputs.bounds[p],
        side,
        p,
        outputs.peaks,
        work.stack,
    )
    if at >= 0.0:
        outputs.times[p] = time + at


@kernel
def peaks_at_sample(time, values, outputs):
    """Raise the peaks by the values at one time."""
    for p in range(outputs.rows.shape[1]):
        size = abs(values[p]) if outputs.sides[p] > 0.0 else values[p]
        if size > outputs.peaks[p]:
            outputs.peaks[p], outputs.times[p] = size, time
