"""Motions with dashpots: linear segments from one change of the contacts to the next."""

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.dashpot.contacts import (
    change_tangent,
    changed,
    first_change,
    past_stops,
    pushing,
    rest_at_stops,
)
from hpcsweep.solvers.flow.dashpot.gather import (
    impacts_with_dashpots,
    observe_segment,
    peaks_with_dashpots,
    record_passing,
)
from hpcsweep.solvers.flow.linear.forcing import forcing_after, forcing_at, turn_forcing
from hpcsweep.solvers.flow.linear.propagators import table_of
from hpcsweep.solvers.flow.passage.tangent import coasted_tangent, linear_tangent
from hpcsweep.solvers.flow.search.search import UNDECIDED
from hpcsweep.solvers.flow.search.steps import coast, take_step
from hpcsweep.solvers.flow.state.augmented import start
from hpcsweep.solvers.flow.state.segment import Segment, Stretch
from hpcsweep.solvers.flow.state.state import OVERFLOW, copy_state, is_ordinary
from hpcsweep.solvers.flow.state.tally import IMPACTS, NO_TALLY, PEAKS
from hpcsweep.solvers.outcome import COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT


@inlined
def start_next(segment, place, span, z, amplitude, model, tables, work):
    """Write the start of the next segment, in state z, into ``work.x``."""
    tau = segment.tau + span
    if place >= 0:
        forcing_after(span, tau, amplitude, work.x, z.shape[0], model, work.forcing)
        start(work.x, z, work.forcing)
    else:
        copy_state(z, work.x)
        if span == segment.h:
            turn_forcing(work.x, z.shape[0], tables, segment.index)


@inlined
def march_period(packed, z, amplitude, shared, wanted, tangent):
    """Advance z over one forcing period, in place; see `flow.period.period.march_period`.

    Returns
    -------
    int
        An `Outcome`.
    """
    if not (is_ordinary(z) and abs(amplitude) < OVERFLOW):
        return NON_FINITE
    stretch = Stretch(0.0, shared.model.period)
    return march_with_dashpots(packed, stretch, z, amplitude, shared, wanted, tangent)


@inlined
def march_with_dashpots(packed, stretch, z, amplitude, shared, wanted, tangent):
    """Advance z over a part of a period or of a sample interval, in place; return the outcome.

    Parameters
    ----------
    stretch : Stretch
    wanted : int
        Flags of what to gather, see `tally`; of a record only `PEAKS` and `IMPACTS`, together.
    tangent : ndarray, shape (2R, m), or None
        Multiplied by the tangent map of a period. None, in compiling, is a record: steps are taken
        one by one.
    """
    model, tables, work, counts = shared.model, shared.tables, shared.work, shared.counts
    tau, end = stretch
    past = past_stops(tau, z, amplitude, model, work)
    key = pushing(past, z, model.contacts)
    past, key = rest_at_stops(tau, past, key, z, amplitude, model, work)
    forcing_at(tau, amplitude, model, work.forcing, 0)
    start(work.x, z, work.forcing)
    steps = 0
    while tau < end:
        steps += 1
        if steps > shared.max_steps:
            return STEP_LIMIT
        index = table_of(key, tables, packed)
        segment = Segment(key, index, tables.h[index], tau, end)
        known = False
        if tangent is not None and wanted == NO_TALLY and past == np.uint64(0):
            tau, coasted, known = coast(segment, shared.max_steps - steps, model, tables, work)
            coasted_tangent(tables, index, coasted, tangent, work.tangent)
            segment = Segment(key, index, segment.h, tau, end)
            counts[0] += coasted
            steps += coasted
        counts[0] += 1
        span = take_step(segment, known, tables, work)
        place, span = first_change(segment, past, span, model, tables, work)
        if place == UNDECIDED:
            return SOLVER_FAILED
        if span >= end - tau:
            place = -1  # what changes at the end does so at the start of what follows
        if not is_ordinary(work.z_end):
            return NON_FINITE
        if tangent is None:
            if wanted != NO_TALLY:
                peaks_with_dashpots(segment, span, amplitude, PEAKS, shared)
                impacts_with_dashpots(segment, past, span, model, tables, shared.tally, work)
        else:
            if tangent.shape[1] > 0:
                linear_tangent(tables, index, span, tangent, work.tangent)
            if wanted != NO_TALLY:
                observe_segment(segment, past, span, amplitude, wanted, shared)
        if place >= 0:
            counts[1] += 1
            before = past
            past, key = changed(place, segment, before, model, work.z_end)
            now = segment.tau + span
            past, key = rest_at_stops(now, past, key, work.z_end, amplitude, model, work)
            passing = past ^ before
            if tangent is not None:
                change_tangent(passing, before, segment.key, model, tangent)
            if wanted & IMPACTS:
                record_passing(passing, before, model, shared.tally, work.z_end)
        copy_state(work.z_end, z)
        start_next(segment, place, span, z, amplitude, model, tables, work)
        tau = end if span >= end - tau else tau + span
    return COMPLETE
