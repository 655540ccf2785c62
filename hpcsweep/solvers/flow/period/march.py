"""Integrate consecutive forcing periods."""

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.model.kernel_model import DRIFT
from hpcsweep.solvers.flow.elements.contacts import by_elements
from hpcsweep.solvers.flow.elements.march import march_periods
from hpcsweep.solvers.flow.observe.drift import largest_of_storeys
from hpcsweep.solvers.flow.period.period import march_period
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import begin_period, copy_state, end_period
from hpcsweep.solvers.outcome import COMPLETE


@entry_point(
    (INT, INT),
    BYTES,
    VECTOR,
    FLOAT,
    INT,
    MATRIX,
    INT,
    MATRIX,
    VECTOR,
    inner=True,
    specialises=True,
    on_demand=True,
)
def march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z as `march` does where measures are requested."""
    common = read_shared(shared)
    gathered = (points, wanted, tangent, growth)
    done = _march(shared, common, z, amplitude, n_periods, gathered, True)
    if wanted & DRIFT:
        largest_of_storeys(common.model, common.tally)
    return done


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
    if by_elements(common.model):
        return march_periods(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    if wanted & ANY_MEASURE:
        return march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    gathered = (points, wanted, tangent, growth)
    return _march(shared, common, z, amplitude, n_periods, gathered, None)


@inlined
def _march(shared, common, z, amplitude, n_periods, gathered, measures):
    """Advance z; arguments of `march`, the last four as one, and, `measures`, of `march_period`."""
    points, wanted, tangent, growth = gathered
    z = as_long_as(z, common.previous)
    tangent = as_long_as(tangent, common.previous)
    for period in range(n_periods):
        begin_period(z, tangent, common)
        outcome = march_period(shared, z, amplitude, common, wanted, tangent, measures)
        if outcome != COMPLETE:
            copy_state(common.previous, z)
            return period, outcome
        end_period(period, z, points, tangent, growth)
    return n_periods, COMPLETE


@kernel
def advance(shared, common, z, amplitude, n_periods, tangent):
    """Advance z, and `tangent`, like `march`, and gather nothing; `common` is `shared`, read."""
    no_points, no_growth = common.no_points, common.no_growth
    return march(shared, z, amplitude, n_periods, no_points, NO_TALLY, tangent, no_growth)
