r"""A step as polynomials of its rows, on a linear segment or inside a contact layer.

The present step leads from the state in ``work.x`` to ``work.z_end``. What is observed of it are
its rows' polynomials in sigma = 2 s / h - 1, in ``work.rows`` where ``work.expanded``, and bounds
of their fourth derivatives, ``work.bounds``. On a linear segment both come from its table
(`tables`). Inside a layer the polynomials are those of the stages, and the bounds tell alone how
far a row is from the cubic Hermite interpolant of its ends: with D the largest distance of the
accelerations from the straight line through those at the ends, the fourth derivative that could
take it as far is less than 32 D / h^2.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, maximum, modulus, store
from hpcsweep.solvers.flow.linear.series import IN_SERIES, expand_term_row
from hpcsweep.solvers.flow.linear.spectral import step_row
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, STAGE_POLYNOMIALS
from hpcsweep.solvers.flow.state.state import Segment
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO

IN_LAYER = -1
"""In place of the table of a segment: a step inside a layer, with its stages in ``work.layer``."""
HERMITE_DISTANCE = 40.0
"""That factor, with a quarter more for what lies between the stages."""


@inlined
def layer_segment(tau, h):
    """Return a step inside a layer, where any contact may be closed."""
    return Segment(~np.uint64(0), IN_LAYER, h, tau, tau + h)


@inlined
def begin_layer_step(h, work):
    """Make a step inside a layer the present one; it has stages and states at both ends."""
    for row in range(work.z_end.shape[0]):
        work.expanded[row] = False
    for i in range(work.a.shape[0]):
        line = fma(load(NODES, 0), work.a_end[i] - work.a[i], work.a[i])
        apart = maximum(modulus(load(work.layer.g, i * N_STAGES) - line))
        work.bounds[i] = HERMITE_DISTANCE * apart / (h * h)


@inlined
def expand(row, segment, tables, work):
    """Write the polynomial of a row along the present step into ``work.rows``, if it is not."""
    if not work.expanded[row]:
        work.expanded[row] = True
        if segment.index == IN_LAYER:
            stage = work.layer
            _expand_stages(row, segment.h, work.x, stage.v, stage.g, stage.values, work.rows)
        elif segment.index == IN_SERIES:
            expand_term_row(row, work.series, work.rows)
        else:
            step_row(row, segment.index, tables, work)


@kernel
def _expand_stages(row, h, x, v, g, data, rows):
    """Write the polynomial of a row by the stages of a step; see `tableau`."""
    n = v.shape[0]
    i, speed = row % n, x[n + row % n]
    store(data, 0, (load(v, i * N_STAGES) - speed) * h)
    store(data, LANES, load(g, i * N_STAGES) * (h * h))
    table, count = STAGE_POLYNOMIALS, N_COEFFICIENTS
    first = row // n * table.shape[1] * count
    scale = 1.0 if row < n else 1.0 / h
    for p in range(0, count, LANES):
        at = row * count + p
        combine(rows, at, ZERO, 0, scale, table, first + p, count, data, 0, 2 * N_STAGES)
    if row < n:
        rows[row, 0] += x[row] + 0.5 * h * speed
        rows[row, 1] += 0.5 * h * speed
    else:
        rows[row, 0] += speed
