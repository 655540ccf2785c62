"""What every forcing period begins and ends with."""

import math

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.state.augmented import renew_rows
from hpcsweep.solvers.flow.state.state import copy_state


@inlined
def begin_period(z, tangent, shared):
    """Keep the state at the start of a period, and renew the rows beyond n."""
    copy_state(z, shared.previous)
    if shared.model.rows.shape[0] > 0:
        renew_rows(z, tangent, shared.model)


@inlined
def end_period(period, z, points, tangent, growth):
    """Write the point that a period has reached, and the growth of the first tangent vector."""
    if growth.shape[0] > 0:
        square = 0.0
        for k in range(z.shape[0]):
            square += tangent[k, 0] ** 2
        size = math.sqrt(square)
        growth[period] = math.log(size) if size > 0.0 else -math.inf
        for k in range(z.shape[0]):
            tangent[k, 0] /= size if size > 0.0 else 1.0
    if points.shape[0] > 0:
        copy_state(z, points[period])
