r"""What rows y = d . u of the displacements do over linear segments, and within layers.

Of each the largest and the smallest value, and the integrals of y, y^2, y cos(h Omega tau) and
y sin(h Omega tau): those of polynomials by Gauss' rule, exactly, and of their products with
harmonics to rounding, where a step is a small part of their period. A step longer than `TURN`
radians of the highest harmonic is cut.
"""

import math

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES, local_matrix
from hpcsweep.solvers.flow.guard.extremum import Peak, raise_peak, raise_to_ends, row_may_be_higher
from hpcsweep.solvers.flow.state.tables import (
    MODAL_NODES,
    MODAL_WEIGHTS,
    N_COEFFICIENTS,
    N_MODAL,
)
from hpcsweep.solvers.flow.step.polynomials import evaluate, fourth_derivative, value_and_slope
from hpcsweep.solvers.flow.step.step import expand

TURN = 4.0
"""Of the `N_MODAL` nodes: they integrate a harmonic over 4 radians, times a polynomial of degree
`DEGREE`, to 1e-15."""


@kernel
def rows_on_segment(segment, span, model, tables, asked, step):
    """Add what the rows that are asked for do over the first `span` of a step."""
    rows, signed = local_matrix(LANES, N_COEFFICIENTS), local_matrix(1, N_COEFFICIENTS)
    for r in range(asked.counts[0]):
        for p in range(N_COEFFICIENTS):
            rows[r, p] = 0.0
        for i in range(asked.rows.shape[1]):
            share = asked.rows[r, i]
            if share != 0.0:
                expand(i, segment, tables, step)
                for p in range(N_COEFFICIENTS):
                    rows[r, p] += share * step.rows[i, p]
        for side in range(2):
            for p in range(N_COEFFICIENTS):
                signed[0, p] = rows[r, p] if side == 0 else -rows[r, p]
            _raise_end(segment.h, span, signed, Peak(asked.sums[r], side, -math.inf))
    turn = asked.counts[1] * model.omega * span
    pieces = 1 + int(turn / TURN)
    for piece in range(pieces):
        _integrate(segment, piece * span / pieces, span / pieces, rows, model.omega, asked)


@kernel
def _raise_end(h, span, rows, peak):
    """Raise a `Peak` by polynomial 0 of `rows` over the first `span` of a step."""
    g0, v0 = value_and_slope(rows, 0, h, 0.0)
    g1, v1 = value_and_slope(rows, 0, h, span)
    ends, bound4 = (g0, v0, g1, v1), fourth_derivative(rows, h)
    raise_to_ends(ends, 1, span, peak)
    if row_may_be_higher(peak.values[peak.place], 1, span, ends, bound4):
        raise_peak(rows, h, span, ends, bound4, 1, peak)


@kernel
def _integrate(segment, begin, length, rows, omega, asked):
    """Add the integrals over a part of a step."""
    sums = asked.sums
    for node in range(N_MODAL):
        s = begin + 0.5 * length * (MODAL_NODES[node] + 1.0)
        weight, angle = 0.5 * length * MODAL_WEIGHTS[node], omega * (segment.tau + s)
        first_cosine, first_sine = math.cos(angle), math.sin(angle)
        for r in range(asked.counts[0]):
            y = evaluate(rows[r], s * (2.0 / segment.h) - 1.0)
            sums[r, 2] += weight * y
            sums[r, 3] += weight * y * y
            cosine, sine = first_cosine, first_sine
            for order in range(asked.counts[1]):
                sums[r, 4 + 2 * order] += weight * y * cosine
                sums[r, 5 + 2 * order] += weight * y * sine
                cosine, sine = (
                    cosine * first_cosine - sine * first_sine,
                    sine * first_cosine + cosine * first_sine,
                )
