"""Forcing periods in a row, of a motion with dashpots."""

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.model.kernel_model import DRIFT
from hpcsweep.solvers.flow.dashpot.period import march_period
from hpcsweep.solvers.flow.observe.drift import largest_of_storeys
from hpcsweep.solvers.flow.state.periods import begin_period, end_period
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.outcome import COMPLETE


@entry_point(
    (INT, INT),
    *(BYTES, VECTOR, FLOAT, INT, MATRIX, INT, MATRIX, VECTOR),
    inner=True,
    specialises=True,
    on_demand=True,
)
def march_dashpots(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z over `n_periods` forcing periods, in place; see `flow.period.march.march`.

    A loop of its own, so that the periods of elastic contacts pay nothing for it: a call within
    their loop cost them 5 %.
    """
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    tangent = as_long_as(tangent, common.previous)
    for period in range(n_periods):
        begin_period(z, tangent, common)
        outcome = march_period(shared, z, amplitude, common, wanted, tangent)
        if outcome != COMPLETE:
            copy_state(common.previous, z)
            return period, outcome
        end_period(period, z, points, tangent, growth)
    if wanted & DRIFT:
        largest_of_storeys(common.model, common.tally)
    return n_periods, COMPLETE
