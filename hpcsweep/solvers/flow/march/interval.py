"""One march: the motion over a forcing period, or over the interval between two samples.

A forcing period runs from tau = 0 to T = 2 pi / Omega, so that the phase is exact in every period;
of a record an interval has a ramp in place of harmonics. Between two changes the motion takes steps
of the present set (`step.step`). A step ends where the first guard is passed, which is found, or
proved to be none (`search`, `guard.elements`); it is observed, the guard is passed, and the motion
goes on. A guard of an elastic contact is the edge of its layer, and passing it changes the bit of
the set, through the layer in closed form where that is so (`ending`); those of elements lead to
other modes (`elements`). A motion with a contact within its layer is that of `layer`.

What a motion is, is told in compiling: with `elements` None all contacts are elastic and there are
no sliders and limits; `tangent` None is a record, whose steps are taken one by one; with `measures`
None peaks and impacts are left out, a third of the compiled code.

The sets of a motion where a stretch of it begins are the contacts past their stops, and the
table's. Those past their stops tell what ends the motion; those that push, and sliders that slip,
make it linear and are the key of its table. They are the same where all contacts are elastic. A
smooth contact within its layer is past its stop and does not push: a motion with such a one is
`layer`'s.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import local_matrix
from hpcsweep.model.elements import ENDS, OWNER
from hpcsweep.solvers.flow.guard.contacts import (
    change_tangent,
    past_stops,
    pushing,
    rest_at_stops,
    set_contacts,
)
from hpcsweep.solvers.flow.guard.elements import (
    change,
    first_change,
    sets_of,
    write_loads,
    write_windows,
)
from hpcsweep.solvers.flow.guard.events import (
    contact_key,
    first_event,
    go_on,
    look_ahead,
    take_step,
)
from hpcsweep.solvers.flow.guard.search import UNDECIDED
from hpcsweep.solvers.flow.layer.elements import visit_layers
from hpcsweep.solvers.flow.layer.passage.tangent import coast_on
from hpcsweep.solvers.flow.layer.visit import Interval, inside_layer, visit_layer
from hpcsweep.solvers.flow.march.ending import end_at_event, passing_contacts
from hpcsweep.solvers.flow.march.gather import gather, gather_passing, segment_tangent
from hpcsweep.solvers.flow.march.impact import at_stops, collide, hold, into_stops, rest_of
from hpcsweep.solvers.flow.state.shared import (
    LAYER_STEPS,
    LINEAR_STEPS,
    NO_TALLY,
    PASSAGES,
    VISITS,
)
from hpcsweep.solvers.flow.state.state import (
    OVERFLOW,
    Ending,
    copy_state,
    is_ordinary,
    start,
    time_of,
)
from hpcsweep.solvers.flow.step.constraint import rigid_of
from hpcsweep.solvers.flow.step.forcing import forcing_after, forcing_at, turn_forcing
from hpcsweep.solvers.flow.step.step import is_series, series_step, step_of, table_of
from hpcsweep.solvers.outcome import COLLAPSED, COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT

ANY = ~np.uint64(0)
"""In place of the contacts past their stops: some are within their layers."""


@inlined
def is_within(past, key, model):
    """Return whether a smooth contact is within its layer, by the sets of a motion."""
    return model.layer > 0.0 and past & ~key != np.uint64(0)


@inlined
def begin(tau, z, amplitude, elements, shared):
    """Begin a stretch in a state; return the contacts past their stops, and the set of the table.

    Sliders go on as they are. `elements` is that of `march`.
    """
    model, work, modes = shared.model, shared.work, shared.modes
    pairs, step, proof = work.forcing, work.step, work.proof
    if elements is None:
        past = key = np.uint64(0)
        if inside_layer(z, model):
            past = ANY
        else:
            past = key = contact_key(tau, z, amplitude, model, pairs, step.a)
    else:
        write_loads(modes, model.elements, pairs, step.series)
        if model.contacts.bounce.shape[0] > 0:
            into_stops(z, model.contacts)
        past = past_stops(tau, z, amplitude, model, pairs, step.series)
        past ^= rigid_of(past, model.contacts)
        key = pushing(past, z, model)
        if model.contacts.bounce.shape[0] > 0:
            key = rest_of(tau, key, at_stops(z, model.contacts), z, amplitude, shared, False)
            past |= rigid_of(key, model.contacts)
        set_contacts(past, key, modes, model.contacts)
        past, key = sets_of(modes, model.elements)
        past, key = settle(tau, past, key, z, amplitude, model, modes, pairs, step.series, proof)
    begin_at(tau, z, amplitude, model, pairs, step.x)
    return past, key


@inlined
def begin_at(tau, z, amplitude, model, pairs, x):
    """Write the augmented state at tau into x."""
    forcing_at(tau, amplitude, model, pairs, 0)
    start(x, z, pairs)


@inlined
def settle(tau, past, key, z, amplitude, model, modes, pairs, series, proof):
    """Let contacts that rest at their stops go; return the sets, and write the windows, of all."""
    if model.layer == 0.0 and model.contacts.row.shape[0] > 0:
        past, key = rest_at_stops(tau, past, key, z, amplitude, model, pairs, series)
    set_contacts(past, key, modes, model.contacts)
    write_windows(modes, model.elements, proof)
    return past, key


UNKNOWN = np.uint64(0), np.uint64(0), True
"""In place of the sets with which an interval begins: they follow from the state."""


@inlined
def _visit(packed, interval, z, amplitude, wanted, elements, tangent, shared):
    """Integrate while contacts are within their layers; return time, outcome and steps."""
    shared.counts[VISITS] += 1
    if elements is None:
        moved = local_matrix(z.shape[0], 0) if tangent is None else tangent
        tau, outcome, used = visit_layer(packed, interval, z, amplitude, wanted, moved)
    else:
        tau, outcome, used = visit_layers(packed, interval, z, amplitude, wanted)
    shared.counts[LAYER_STEPS] += used
    return tau, outcome, used


@inlined
def _step(packed, past, key, index, interval, wanted, ahead, elements, tangent, shared):
    """Take a step of a set to ``work.step.z_end``, after those that coasting takes.

    `index` is that of the table of the step before, -1 if it was of another set.

    Returns
    -------
    segment : Segment
    span : float
        Length of the step.
    steps : int
        Steps taken.
    ahead : int
        So many steps are proved to be ended by no guard, from this one on.
    """
    model, tables, work = shared.model, shared.tables, shared.work
    tau, end, left = interval
    if (
        elements is not None
        and tangent is None
        and is_series(key, tau, end, model, shared.modes, tables)
    ):
        segment = series_step(key, tau, end, model, work.step)
        shared.counts[LINEAR_STEPS] += 1
        return segment, segment.h, 1, 0
    index = index if index >= 0 else table_of(key, tables, packed)
    segment = step_of(key, index, tau, end, tables)
    coasts = wanted == NO_TALLY
    if elements is not None:
        coasts = coasts and model.elements.stiffness.shape[0] == 0 and past == np.uint64(0)
    segment, tried, steps = coast_on(segment, coasts, left, tangent, shared)
    if elements is None and tangent is not None and wanted != NO_TALLY and ahead == 0:
        ahead, tried = look_ahead(segment, left - steps, model, tables, work.step)
    return segment, take_step(segment, tried, model, tables, work.step), steps, ahead


@inlined
def _ending(segment, span, ahead, promised, z, amplitude, elements, packed, shared):
    """Find the first guard within a step, and end the step there, in ``work.step.z_end``."""
    model, tables, work = shared.model, shared.tables, shared.work
    if elements is None:
        if ahead > 0:
            return Ending(span, -1, False, False, False, 0.0, promised)
        event = first_event(segment, span, model, tables, work.step)
        if event[0] >= 0:
            return end_at_event(segment, event, promised, z, amplitude, packed, shared)
        return Ending(span, event[0], False, False, False, 0.0, promised)
    guard, span = first_change(segment, span, shared.modes, tables, model, work.proof, work.step)
    if guard >= 0 and span >= segment.end - segment.tau:
        guard = -1  # what changes at the end does so at the start of what follows
    return Ending(span, guard, False, False, False, 0.0, promised)


@inlined
def _pass_guard(segment, ending, past, z, amplitude, wanted, elements, tangent, shared):
    """Pass the guard at the end of a step, in state z.

    Returns
    -------
    past, key : uint64
        The sets that follow ...
    begins : bool
        ... unless they follow from the state.
    passing : uint64
        Contacts that pass their stops.
    outcome : int
    """
    model, work, modes, key = shared.model, shared.work, shared.modes, segment.key
    if elements is None:
        shared.counts[PASSAGES] += ending.passed
        passing = passing_contacts(segment, ending, z, model)
        if ending.beyond or passing != np.uint64(0):
            return past ^ passing, key ^ passing, False, passing, COMPLETE
        return ANY, np.uint64(0), model.layer == 0.0, passing, COMPLETE
    shared.counts[PASSAGES] += 1
    guard, before = ending.contact, past
    rules, tables, proof = model.elements, shared.tables, work.proof
    change(guard, segment, ending.span, z, modes, model, tables, proof, work.step)
    if rules.guard[guard, ENDS] > 0.0:
        modes.path[rules.ways[guard, OWNER]] = time_of(segment.tau + ending.span, model)
        return past, key, False, np.uint64(0), COLLAPSED
    past, key = sets_of(modes, rules)
    pairs, series, tau = work.forcing, work.step.series, segment.tau + ending.span
    write_loads(modes, rules, pairs, series)
    if model.contacts.bounce.shape[0] > 0:
        key = collide(tau, before, key, z, amplitude, wanted, tangent, shared)
        past ^= rigid_of(past ^ key, model.contacts)
    past, key = settle(tau, past, key, z, amplitude, model, modes, pairs, series, proof)
    passing = past ^ before
    if tangent is not None:
        change_tangent(passing, before, segment.key, model, tangent)
    return past, key, False, passing, COMPLETE


@inlined
def _go_on(segment, ending, tau, ahead, z, amplitude, elements, shared):
    """Write the augmented state in which the next step begins, in state z, into ``work.step.x``.

    Return its time, and how many steps are proved from there on.
    """
    model, tables, work = shared.model, shared.tables, shared.work
    if ending.contact < 0 and segment.index >= 0:
        copy_state(z, work.step.x)
        if ending.span == segment.h:
            turn_forcing(work.step.x, z.shape[0], tables, segment.index)
        if ahead == 1:
            tau = go_on(segment.index, z, tables, work.step)
        return tau, max(ahead - 1, 0)
    if elements is not None:
        forcing_after(ending.span, tau, amplitude, work.step.x, z.shape[0], model, work.forcing)
    elif ending.beyond or ending.rounded:
        forcing_at(tau, amplitude, model, work.forcing, 0)
    start(work.step.x, z, work.forcing)
    return tau, 0


@inlined
def march_interval(packed, shared, length, sets, z, amplitude, wanted, elements, tangent, measures):
    """Advance z from tau = 0 of a forcing period, or of a sample interval, in place.

    Parameters
    ----------
    packed : ndarray of bytes
        `shared`, packed.
    length : float
        Where the interval ends.
    sets : (uint64, uint64, bool)
        Contacts past their stops, and the set of the table; with True both follow from z.
    z : ndarray, shape (2R,)
        On success the state at the end, else the last one reached.
    amplitude : float
        A.
    wanted : int
        What to gather, see `tally`; of a record peaks and impacts together, and energies.
    elements, tangent, measures
        Told in compiling, see the module; `tangent`, shape (2R, m), is multiplied by the tangent
        map of the interval, in place.

    Returns
    -------
    outcome : int
        An `Outcome`.
    sets : (uint64, uint64, bool)
        With which the next interval may begin.
    """
    model, work = shared.model, shared.work
    past, key, begins = sets
    if not (is_ordinary(z) and abs(amplitude) < OVERFLOW):
        return NON_FINITE, UNKNOWN
    if not begins:
        begin_at(0.0, z, amplitude, model, work.forcing, work.step.x)
    tau, end, steps, ahead, promised, changed = 0.0, length, 0, 0, np.uint64(0), begins
    index = -1
    while tau < end:
        if begins:
            past, key = begin(tau, z, amplitude, elements, shared)
            index = -1
            if elements is not None and tangent is not None:
                hold(key, model.contacts, tangent)
        if steps >= shared.max_steps:
            return STEP_LIMIT, UNKNOWN
        interval = Interval(tau, end, shared.max_steps - steps)
        begins = is_within(past, key, model)
        if begins:
            tau, outcome, used = _visit(
                packed, interval, z, amplitude, wanted, elements, tangent, shared
            )
            steps, changed = steps + used + 1, True
            if outcome != COMPLETE:
                return outcome, UNKNOWN
            continue
        segment, span, taken, ahead = _step(
            packed, past, key, index, interval, wanted, ahead, elements, tangent, shared
        )
        steps, tau, index = steps + taken, segment.tau, segment.index
        ending = _ending(segment, span, ahead, promised, z, amplitude, elements, packed, shared)
        if ending.contact == UNDECIDED:
            return SOLVER_FAILED, UNKNOWN
        promised = ending.promised
        segment_tangent(segment, ending, shared, tangent)
        if ending.passed:
            copy_state(z, work.step.z_end)
        if not is_ordinary(work.step.z_end):
            return NON_FINITE, UNKNOWN
        gather(segment, past, ending.span, span, amplitude, wanted, elements, measures, shared)
        if ending.contact >= 0:
            before, changed, index = past, True, -1
            past, key, begins, passing, outcome = _pass_guard(
                segment, ending, past, work.step.z_end, amplitude, wanted, elements, tangent, shared
            )
            if outcome != COMPLETE:
                copy_state(work.step.z_end, z)
                return outcome, UNKNOWN
            if measures is not None:
                gather_passing(
                    segment, ending, passing, before, z, amplitude, wanted, elements, packed, shared
                )
        copy_state(work.step.z_end, z)
        tau = end if ending.span >= end - tau else tau + ending.span
        tau, ahead = _go_on(segment, ending, tau, ahead, z, amplitude, elements, shared)
    return COMPLETE, (past, key, changed or not (elements is None or past == np.uint64(0)))
