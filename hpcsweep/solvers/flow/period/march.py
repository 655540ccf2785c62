"""Integrate consecutive forcing periods."""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.solvers.flow.period.period import march_period
from hpcsweep.solvers.flow.state.augmented import renew_rows
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.flow.state.tally import NO_TALLY
from hpcsweep.solvers.outcome import COMPLETE


@entry_point((INT, INT), BYTES, VECTOR, FLOAT, INT, MATRIX, INT, MATRIX, VECTOR, specialises=True)
def march(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z over `n_periods` forcing periods, in place, and gather what is requested.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`.
    points : ndarray, shape (n_periods, 2R) or (0, 2R)
        Receives z(T), z(2T), ...; not written if empty.
    wanted, tangent
        See `period.march_period`.
    growth : ndarray, shape (n_periods,) or (0,)
        If not empty, the first column of `tangent` is scaled to length 1 after each period, and the
        logarithm of its previous length is written here.

    Returns
    -------
    n_done : int
    outcome : int
    """
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    tangent = as_long_as(tangent, common.previous)
    previous = common.previous
    for period in range(n_periods):
        copy_state(z, previous)
        if common.model.rows.shape[0] > 0:
            renew_rows(z, tangent, common.model)
        outcome = march_period(shared, z, amplitude, common, wanted, tangent)
        if outcome != COMPLETE:
            copy_state(previous, z)
            return period, outcome
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
    return n_periods, COMPLETE


@kernel
def advance(shared, common, z, amplitude, n_periods, tangent):
    """Advance z, and `tangent`, like `march`, and gather nothing; `common` is `shared`, read."""
    no_points, no_growth = common.no_points, common.no_growth
    return march(shared, z, amplitude, n_periods, no_points, NO_TALLY, tangent, no_growth)
