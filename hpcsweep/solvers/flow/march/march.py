"""Integrate consecutive forcing periods."""

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import local_matrix, local_vector
from hpcsweep.model.observed import DRIFT
from hpcsweep.solvers.flow.guard.contacts import by_elements
from hpcsweep.solvers.flow.march.interval import UNKNOWN, march_interval
from hpcsweep.solvers.flow.observe.peaks import largest_of_storeys
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import begin_period, copy_state, end_period
from hpcsweep.solvers.outcome import COMPLETE

MARCH = BYTES, VECTOR, FLOAT, INT, MATRIX, INT, MATRIX, VECTOR
"""Types of the arguments of `march`."""


@entry_point((INT, INT), *MARCH, inner=True, specialises=True, on_demand=True)
def march_elements(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z as `march` does where some contacts have dashpots or there are sliders, limits."""
    return _march(shared, z, amplitude, n_periods, points, wanted, tangent, growth, True, True)


@entry_point((INT, INT), *MARCH, inner=True, specialises=True, on_demand=True)
def march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z as `march` does where measures are requested."""
    return _march(shared, z, amplitude, n_periods, points, wanted, tangent, growth, None, True)


@entry_point((INT, INT), *MARCH, specialises=True)
def march(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z over `n_periods` forcing periods, in place, and gather what is requested.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`.
    points : ndarray, shape (n_periods, 2R) or (0, 2R)
        Receives z(T), z(2T), ...; not written if empty.
    wanted, tangent
        See `interval.march_interval`.
    growth : ndarray, shape (n_periods,) or (0,)
        If not empty, the first column of `tangent` is scaled to length 1 after each period, and the
        logarithm of its previous length is written here.

    Returns
    -------
    n_done : int
    outcome : int
    """
    if by_elements(read_shared(shared).model):
        return march_elements(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    if wanted & ANY_MEASURE:
        return march_measured(shared, z, amplitude, n_periods, points, wanted, tangent, growth)
    return _march(shared, z, amplitude, n_periods, points, wanted, tangent, growth, None, None)


@inlined
def _march(packed, z, amplitude, n_periods, points, wanted, tangent, growth, elements, measures):
    """Advance z; arguments of `march`, and those of `interval.march_interval`."""
    shared = read_shared(packed)
    z = as_long_as(z, shared.work.step.z_end)
    tangent = as_long_as(tangent, shared.work.step.z_end)
    length, sets, previous = shared.model.period, UNKNOWN, local_vector(z.shape[0])
    for period in range(n_periods):
        begin_period(z, tangent, shared.model, previous)
        outcome, _ = march_interval(
            packed, shared, length, sets, z, amplitude, wanted, elements, tangent, measures
        )
        if outcome != COMPLETE:
            copy_state(previous, z)
            return period, outcome
        end_period(period, z, points, tangent, growth)
    if measures is not None and wanted & DRIFT:
        largest_of_storeys(shared.model, shared.tally)
    return n_periods, COMPLETE


@kernel
def advance(shared, z, amplitude, n_periods, tangent):
    """Advance z, and `tangent` if it is not None, like `march`, and gather nothing."""
    nothing = local_matrix(z.shape[0], 0)
    moved = nothing if tangent is None else tangent
    return march(shared, z, amplitude, n_periods, nothing[:0], NO_TALLY, moved, nothing[0])
