"""The rest of a sample interval of a motion with dashpots, from where a contact may change."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.dashpot.contacts import changed, first_change, past_stops, pushing
from hpcsweep.solvers.flow.dashpot.gather import (
    impacts_on_piece,
    peaks_on_piece,
    record_passing,
)
from hpcsweep.solvers.flow.dashpot.period import start_next
from hpcsweep.solvers.flow.linear.forcing import forcing_at
from hpcsweep.solvers.flow.linear.propagators import table_of
from hpcsweep.solvers.flow.search.search import UNDECIDED
from hpcsweep.solvers.flow.search.steps import take_step
from hpcsweep.solvers.flow.state.augmented import start
from hpcsweep.solvers.flow.state.segment import Segment
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state, is_ordinary
from hpcsweep.solvers.flow.state.tally import PEAKS
from hpcsweep.solvers.outcome import COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT


@inlined
def rest_with_dashpots(packed, begun, time, z, amplitude, gathers):
    """Advance z over what is left of an interval; return the outcome.

    Parameters
    ----------
    begun : Segment
        Tells the start and the end.
    time : float
        At which the interval begins.
    gathers : bool
        Whether peaks and impacts are followed.
    """
    shared = read_shared(packed)
    model, tables, work, counts = shared.model, shared.tables, shared.work, shared.counts
    tau, end = begun.tau, begun.end
    past = past_stops(tau, z, amplitude, model, work)
    key = pushing(past, z, model.contacts)
    forcing_at(tau, amplitude, model, work.forcing, 0)
    start(work.x, z, work.forcing)
    steps = 0
    while tau < end:
        steps += 1
        if steps > shared.max_steps:
            return STEP_LIMIT
        index = table_of(key, tables, packed)
        segment = Segment(key, index, tables.h[index], tau, end)
        counts[0] += 1
        span = take_step(segment, False, tables, work)
        place, span = first_change(segment, past, span, model, tables, work)
        if place == UNDECIDED:
            return SOLVER_FAILED
        if span >= end - tau:
            place = -1  # what changes at the end does so at the start of what follows
        if not is_ordinary(work.z_end):
            return NON_FINITE
        if gathers:
            peaks_on_piece(segment, span, time + tau, amplitude, PEAKS, shared)
            impacts_on_piece(segment, past, span, model, tables, shared.tally, work)
        if place >= 0:
            counts[1] += 1
            before = past
            past, key, passing = changed(place, segment, before, model, work.z_end)
            if gathers:
                record_passing(passing, before, model, shared.tally, work.z_end)
        copy_state(work.z_end, z)
        start_next(segment, place, span, z, amplitude, model, tables, work)
        tau = end if span >= end - tau else tau + span
    return COMPLETE
