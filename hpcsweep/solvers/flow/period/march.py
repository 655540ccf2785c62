"""Integrate consecutive forcing periods."""

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.model.kernel_model import DRIFT
from hpcsweep.solvers.flow.dashpot.contacts import has_dashpots
from hpcsweep.solvers.flow.dashpot.march import march_dashpot_period
from hpcsweep.solvers.flow.observe.drift import largest_of_storeys
from hpcsweep.solvers.flow.period.period import march_period
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import begin_period, copy_state, end_period
from hpcsweep.solvers.outcome import COMPLETE

MARCH = (INT, INT), BYTES, VECTOR, FLOAT, INT, MATRIX, INT, MATRIX, VECTOR


@entry_point(*MARCH, inner=True, specialises=True, on_demand=True)
def march_dashpots(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z as `march` does with dashpots at sharp contacts.

    A loop of its own, so that the periods of elastic contacts pay nothing for it: a call within
    their loop cost them 5 %.
    """
    kept = n_periods, points, growth
    return _march(shared, z, amplitude, kept, wanted, tangent, None, True)


@entry_point(*MARCH, inner=True, specialises=True, on_demand=True)
def march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z as `march` does where measures are requested."""
    kept = n_periods, points, growth
    return _march(shared, z, amplitude, kept, wanted, tangent, True, None)


@entry_point(*MARCH, specialises=True)
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
    if has_dashpots(read_shared(shared).model):
        return march_dashpots(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    if wanted & ANY_MEASURE:
        return march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    kept = n_periods, points, growth
    return _march(shared, z, amplitude, kept, wanted, tangent, None, None)


@inlined
def _march(shared, z, amplitude, kept, wanted, tangent, measures, dashpots):
    """Advance z; arguments of `march`, `kept` are its n_periods, points and growth.

    None for `measures` and `dashpots` leaves, in compiling, what belongs to them out.
    """
    n_periods, points, growth = kept
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    tangent = as_long_as(tangent, common.previous)
    for period in range(n_periods):
        begin_period(z, tangent, common)
        if dashpots is None:
            outcome = march_period(shared, z, amplitude, common, wanted, tangent, measures)
        else:
            outcome = march_dashpot_period(shared, z, amplitude, common, wanted, tangent)
        if outcome != COMPLETE:
            copy_state(common.previous, z)
            return period, outcome
        end_period(period, z, points, tangent, growth)
    if wanted & DRIFT:
        largest_of_storeys(common.model, common.tally)
    return n_periods, COMPLETE


@kernel
def advance(shared, common, z, amplitude, n_periods, tangent):
    """Advance z, and `tangent`, like `march`, and gather nothing; `common` is `shared`, read."""
    no_points, no_growth = common.no_points, common.no_growth
    return march(shared, z, amplitude, n_periods, no_points, NO_TALLY, tangent, no_growth)
