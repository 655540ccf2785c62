"""The end of a step at the stop of an elastic contact, or at the edge of its layer.

If the passage of a contact through its layer is fast, and no other comes near its layer meanwhile,
it is done in closed form (`passage`); if not, the motion is integrated from the edge until no
contact is within its layer (`layer`). For infinite sharpness the layer has no width and every
passage is the closed form with zero impulse. Contacts that are at their stops at the same instant
then pass together: separately, each would need a segment without length and a table of its own.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.solvers.flow.guard.events import layer_edge
from hpcsweep.solvers.flow.guard.search import (
    SAME_INSTANT,
    Bracket,
    Level,
    Trace,
    rising_root,
)
from hpcsweep.solvers.flow.layer.passage.passage import (
    EXTRAPOLATION,
    first_at_stop,
    pass_layer,
    time_at_stop,
)
from hpcsweep.solvers.flow.state.state import (
    Ending,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
)
from hpcsweep.solvers.flow.step.forcing import forcing_after
from hpcsweep.solvers.flow.step.step import expand_contacts, state_at

SHORTEST = 0.01
"""Fraction of a step after which a contact that reaches its stop beyond the step is tried again."""


@inlined
def end_at_event(segment, event, promised, z, amplitude, packed, shared):
    """End a segment where a contact passes its stop, or otherwise at the edge of its layer.

    `event` is from `first_event`. Without a passage ``work.step.z_end`` is the state at the end.
    """
    model, work = shared.model, shared.work
    rows, h, tau = work.step.rows, segment.h, segment.tau
    contacts = model.contacts
    contact, bracket, near = event
    expand_contacts(segment, near, model, shared.tables, work.step)
    edge = layer_edge(segment.key, contact, model)
    direction = -1.0 if segment.key & contact_bit(contact) else 1.0
    curve = Trace(rows, contacts.row[contact], h)
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
            expand_contacts(segment, near, model, shared.tables, work.step)
        contact, at_stop = first_at_stop(contact, at_stop, near, segment.key, rows, h, contacts)
    passed, jerk = False, 0.0
    if bracket.a <= at_stop <= EXTRAPOLATION * h and tau + at_stop < segment.end:
        state_at(segment, at_stop, shared.tables, work.step, z)
        copy_state(z, work.step.z_end)
        forcing_after(
            at_stop, tau + at_stop, amplitude, work.step.x, z.shape[0], model, work.forcing
        )
        passed, jerk, promised = pass_layer(
            contact, segment, tau + at_stop, z, promised, amplitude, packed
        )
    if passed:
        return Ending(at_stop, contact, True, False, False, jerk, promised)
    span = rising_root(curve, bracket, edge)
    beyond = at_stop > EXTRAPOLATION * h and span > SHORTEST * h
    rounded = model.rho == math.inf and at_stop < bracket.a
    state_at(segment, span, shared.tables, work.step, work.step.z_end)
    return Ending(span, contact, False, beyond, rounded, jerk, promised)


@inlined
def passing_contacts(segment, ending, z, model):
    """Return the contacts, a set, that pass their stops at the end of a segment, in state z.

    A contact of infinite sharpness whose force begins or ends by the time t too early changes the
    speed by no more than beta |w| t^2 / 2, w its own: with t = `SAME_INSTANT` h and beta h^2 of the
    order of 10 that is 1e-23 |w|.
    """
    contacts, contact = model.contacts, ending.contact
    if contact < 0 or ending.beyond or not (ending.passed or ending.rounded):
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
