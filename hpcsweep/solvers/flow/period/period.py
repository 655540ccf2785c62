"""One forcing period: linear steps, fast passages, and visits to the layer.

One period runs from tau = 0 to T = 2 pi / Omega, so that the phase is exact in every period.
Between contact changes the motion takes linear steps of the present contact set (`tables`). A step
is accepted when no contact can have reached the edge of its layer, which is proved (`events`);
otherwise the first one that does is found. If its passage through the layer is fast, and no other
comes near its layer meanwhile, the passage is done in closed form (`crossing`); if not, the motion
is integrated from the edge until no contact is inside its layer (`layer`). For infinite sharpness
the layer has no width and every passage is the closed form with zero impulse. Contacts that are at
their stops at the same instant then pass together: separately, each would need a segment without
length and a table of its own (`passing_contacts`).
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.layer.visit import (
    Interval,
    inside_layer,
    visit_layer,
)
from hpcsweep.solvers.flow.linear.forcing import forcing_after, forcing_at, turn_forcing
from hpcsweep.solvers.flow.linear.propagators import table_of
from hpcsweep.solvers.flow.linear.spectral import rows_of_contacts, step_state
from hpcsweep.solvers.flow.passage.passage import (
    EXTRAPOLATION,
    FAST,
    INTEGRATED,
    SLOW,
    first_at_stop,
    pass_layer,
    time_at_stop,
)
from hpcsweep.solvers.flow.passage.tangent import coast_on
from hpcsweep.solvers.flow.period.gather import (
    measure_segment,
    observe_segment,
    segment_tangent,
)
from hpcsweep.solvers.flow.search.events import (
    contact_key,
    first_event,
    go_on,
    layer_edge,
    look_ahead,
    take_step,
)
from hpcsweep.solvers.flow.search.search import (
    SAME_INSTANT,
    UNDECIDED,
    Bracket,
    Curve,
    Level,
    rising_root,
)
from hpcsweep.solvers.flow.state.shared import (
    LAYER_STEPS,
    NO_TALLY,
    PASSAGES,
    VISITS,
)
from hpcsweep.solvers.flow.state.state import (
    NO_TABLE,
    OVERFLOW,
    Ending,
    Segment,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
    is_ordinary,
    start,
)
from hpcsweep.solvers.outcome import COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT

AT_EDGE = -2
"""As `NO_TABLE`: a contact is at the edge of its layer, possibly just outside it by rounding."""
SHORTEST = 0.01
"""Fraction of a step after which a contact that reaches its stop beyond the step is tried again."""


@inlined
def _end_at_event(segment, event, promised, z, amplitude, packed, shared):
    """End a segment where a contact passes its stop, or otherwise at the edge of its layer.

    `event` is from `first_event`. Without a passage ``work.z_end`` is the state at the end.
    """
    model, work = shared.model, shared.work
    rows, h, tau = work.rows, segment.h, segment.tau
    contacts = model.contacts
    contact, bracket, near = event
    rows_of_contacts(segment, near, model, shared.tables, work)
    edge = layer_edge(segment.key, contact, model)
    direction = -1.0 if segment.key & contact_bit(contact) else 1.0
    curve = Curve(rows, contacts.row[contact], h)
    if bracket.a < bracket.b and bracket.gb >= model.layer:
        # at its stop before any other is at its layer
        a, ga, b, gb = bracket
        through = Bracket(a, ga - model.layer, b, gb - model.layer)
        stop = contacts.sign[contact] * contacts.gap[contact]
        at_stop = rising_root(curve, through, Level(edge.sign, stop))
    else:
        if model.rho == math.inf:
            at_edge = rising_root(curve, bracket, edge)
            bracket = Bracket(at_edge, bracket.ga, at_edge, bracket.gb)
        at_stop = time_at_stop(rows, contact, contacts, h, bracket.b, direction)
        if not at_stop <= min(h, segment.end - tau):
            near = ~np.uint64(0)
            rows_of_contacts(segment, near, model, shared.tables, work)
        contact, at_stop = first_at_stop(contact, at_stop, near, segment.key, rows, h, contacts)
    how = INTEGRATED
    jerk = 0.0
    if bracket.a <= at_stop <= EXTRAPOLATION * h and tau + at_stop < segment.end:
        step_state(segment, at_stop, shared.tables, work, z)
        copy_state(z, work.z_end)
        forcing_after(at_stop, tau + at_stop, amplitude, work.x, z.shape[0], model, work.forcing)
        how, jerk, promised = pass_layer(
            contact, segment, tau + at_stop, z, promised, amplitude, packed
        )
    if how != INTEGRATED:
        return Ending(at_stop, contact, how, False, False, jerk, promised)
    span = rising_root(curve, bracket, edge)
    beyond = at_stop > EXTRAPOLATION * h and span > SHORTEST * h
    rounded = model.rho == math.inf and at_stop < bracket.a
    step_state(segment, span, shared.tables, work, work.z_end)
    return Ending(span, contact, INTEGRATED, beyond, rounded, jerk, promised)


@inlined
def passing_contacts(segment, ending, z, model):
    """Return the contacts, a set, that pass their stops at the end of a segment, in state z.

    A contact of infinite sharpness whose force begins or ends by the time t too early changes the
    speed by no more than beta |w| t^2 / 2, w its own: with t = `SAME_INSTANT` h and beta h^2 of the
    order of 10 that is 1e-23 |w|.
    """
    contacts, contact = model.contacts, ending.contact
    if contact < 0 or ending.beyond or not (ending.how in (FAST, SLOW) or ending.rounded):
        return np.uint64(0)
    passing = contact_bit(contact)
    if model.rho != math.inf:
        return passing
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        w = approach_speed(k, z, contacts)
        goes_on = w < 0.0 if segment.key & bit else w > 0.0
        near = SAME_INSTANT * segment.h * abs(w)
        if k != contact and goes_on and abs(distance(k, z, contacts)) <= near:
            passing |= bit
    return passing


@inlined
def next_segment(segment, ending, passing, tau, z, amplitude, packed, shared):
    """Write the start of the next segment into ``work.x``; return its contact set and table.

    The table is `NO_TABLE` or `AT_EDGE` where the motion does not continue as a linear one.
    """
    model, tables, work = shared.model, shared.tables, shared.work
    key, index = segment.key, segment.index
    x = work.x
    if ending.contact < 0:
        copy_state(z, x)
        if ending.span == segment.h:
            turn_forcing(x, z.shape[0], tables, index)
    elif ending.beyond:
        forcing_at(tau, amplitude, model, work.forcing, 0)
        start(x, z, work.forcing)
    elif passing != np.uint64(0):
        if ending.rounded:
            forcing_at(tau, amplitude, model, work.forcing, 0)
        key ^= passing
        index = table_of(key, tables, packed)
        start(x, z, work.forcing)
    else:
        index = AT_EDGE if model.rho != math.inf else NO_TABLE
    return key, index


@inlined
def take_segment(segment, known, clear, promised, z, amplitude, packed, shared):
    """Take a linear step, at most to the first passage or edge of a layer in it.

    Parameters
    ----------
    segment : Segment
        From ``work.x``.
    known : bool
        See `coast`.
    clear : bool
        Whether no contact can end it (proved).

    Returns
    -------
    Ending
        Its contact is `UNDECIDED` if rounding prevents a decision.
    """
    span = take_step(segment, known, shared.model, shared.tables, shared.work)
    if clear:
        return Ending(span, -1, INTEGRATED, False, False, 0.0, promised)
    event = first_event(segment, span, shared.model, shared.tables, shared.work)
    if event[0] >= 0:
        return _end_at_event(segment, event, promised, z, amplitude, packed, shared)
    return Ending(span, event[0], INTEGRATED, False, False, 0.0, promised)


@inlined
def march_period(packed, z, amplitude, shared, wanted, tangent, measures):
    """Advance z over one forcing period, in place.

    Parameters
    ----------
    packed : ndarray of bytes
        `shared`, packed.
    z : ndarray, shape (2R,)
        State at tau = 0; on success the state at tau = T, else the last state reached.
    amplitude : float
        A.
    shared : Shared
    wanted : int
        Flags of what to gather in ``shared.tally``, see `tally`.
    tangent : ndarray, shape (2R, m)
        Multiplied by the tangent map of the period, in place.
    measures
        None leaves the gathering of measures, a third of the compiled code, out.

    Returns
    -------
    int
        An `Outcome`.
    """
    if not (is_ordinary(z) and abs(amplitude) < OVERFLOW):
        return NON_FINITE
    whole = Segment(np.uint64(0), NO_TABLE, 0.0, 0.0, shared.model.period)
    return march_segments(packed, whole, z, amplitude, shared, wanted, tangent, measures)


@inlined
def march_segments(packed, part, z, amplitude, shared, wanted, tangent, measures):
    """Advance z over a part of a period or of a sample interval, in place; return the outcome.

    Parameters
    ----------
    part : Segment
        From its start to its end, with the contact set at the start, and its table, which may be
        `NO_TABLE`.
    wanted : int
        Of a record only `PEAKS` and `IMPACTS`, together.
    tangent : ndarray, shape (2R, m), or None
        None, in compiling, is a record: steps are taken one by one.
    measures
        See `march_period`.
    """
    model, tables, work, counts = shared.model, shared.tables, shared.work, shared.counts
    key, index, _, tau, end = part
    steps = ahead = 0
    promised = np.uint64(0)
    while tau < end:
        steps += index != AT_EDGE
        if steps > shared.max_steps:
            return STEP_LIMIT
        if index == AT_EDGE or (index == NO_TABLE and inside_layer(z, model)):
            interval = Interval(tau, end, shared.max_steps - steps)
            counts[VISITS] += 1
            moved = shared.no_tangent if tangent is None else tangent
            tau, outcome, used = visit_layer(packed, interval, z, amplitude, wanted, moved)
            counts[LAYER_STEPS] += used
            steps += used
            if outcome != COMPLETE:
                return outcome
            index = NO_TABLE
            continue
        if index == NO_TABLE:
            key = contact_key(tau, z, amplitude, model, work)
            index = table_of(key, tables, packed)
            forcing_at(tau, amplitude, model, work.forcing, 0)
            start(work.x, z, work.forcing)
        segment = Segment(key, index, tables.h[index], tau, end)
        segment, known, steps = coast_on(segment, wanted == NO_TALLY, steps, tangent, shared)
        tau = segment.tau
        if tangent is not None and wanted != NO_TALLY and ahead == 0:
            ahead, known = look_ahead(segment, shared.max_steps - steps, model, tables, work)
        clear = ahead > 0
        ending = take_segment(segment, known, clear, promised, z, amplitude, packed, shared)
        if ending.contact == UNDECIDED:
            return SOLVER_FAILED
        promised = ending.promised
        counts[PASSAGES] += ending.how != INTEGRATED
        if tangent is not None and tangent.shape[1] > 0:
            segment_tangent(segment, ending, packed, shared, tangent)
        if ending.how != INTEGRATED:
            copy_state(z, work.z_end)
        if not is_ordinary(work.z_end):
            return NON_FINITE
        if tangent is not None and wanted != NO_TALLY:
            observe_segment(segment, ending.span, wanted, measures, shared)
        passing = passing_contacts(segment, ending, work.z_end, model)
        if measures is not None:  # in compiling; an array that is no None would not be left out
            measure_segment(segment, ending, passing, z, amplitude, wanted, packed, shared)
        copy_state(work.z_end, z)
        tau = end if ending.span >= end - tau else tau + ending.span
        key, index = next_segment(segment, ending, passing, tau, z, amplitude, packed, shared)
        if ahead == 1:
            tau = go_on(index, z, tables, work)
        ahead = max(ahead - 1, 0)
    return COMPLETE
