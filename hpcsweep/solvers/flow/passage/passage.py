"""Passage of a contact: choose which one is at its stop, and whether it passes in closed form.

The passage itself is that of `crossing`. Passages without a closed form are integrated by `layer`.
"""

import math

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, KEY, VECTOR, entry_point
from hpcsweep.solvers.flow.linear.forcing import forcing_rate, total_forcing
from hpcsweep.solvers.flow.linear.polynomials import value_and_slope, value_slope_bend
from hpcsweep.solvers.flow.linear.propagators import table_at_hand
from hpcsweep.solvers.flow.passage.apart import Arrival, is_alone, passes_apart
from hpcsweep.solvers.flow.passage.crossing import add_kick, moments, passage_is_fast
from hpcsweep.solvers.flow.passage.slow_passage import (
    cross_half,
    half_is_smooth,
    passage_is_smooth,
)
from hpcsweep.solvers.flow.search.search import LAST_STEP
from hpcsweep.solvers.flow.state.contacts import contact_bit, distance
from hpcsweep.solvers.flow.state.segment import SEGMENT
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state

EXTRAPOLATION = 1.005
"""Extent, in steps, to which a polynomial is used: its error grows less than fivefold."""


INTEGRATED, FAST, SLOW, ARRIVED = range(4)
"""How a passage is taken: integrated; by `crossing`; by `slow_passage`, on both sides or to where
the contact is at its stop."""


@kernel
def time_at_stop(rows, k, contacts, h, s, direction):
    """Return when a contact at the edge of its layer (time s) is at the stop; NaN if it turns.

    `direction` is 1 on the way in, -1 on the way out.
    """
    row, sign = contacts.row[k], direction * contacts.sign[k]
    stop = contacts.sign[k] * contacts.gap[k]
    for _ in range(40):
        value, slope, bend = value_slope_bend(rows, row, h, s)
        left, speed = sign * (stop - value), sign * slope
        if not speed > 0.0:
            return math.nan
        square = speed * speed + 2.0 * left * sign * bend
        step = 2.0 * left / (speed + math.sqrt(square)) if square > 0.0 else left / speed
        s += step
        # the remainder, u''' step^3 / 6, is below rounding
        if abs(step) <= LAST_STEP * h:
            return s
    return s


@kernel
def first_at_stop(contact, at_stop, near, key, rows, h, contacts):
    """Return the contact that is first at its stop, not after `at_stop`.

    The first one at the edge of its layer may be overtaken inside by a faster one of `near`.
    """
    for k in range(contacts.row.shape[0]):
        if k != contact and near & contact_bit(k) and at_stop <= h * EXTRAPOLATION:
            direction = -1.0 if key & contact_bit(k) else 1.0
            sign = direction * contacts.sign[k]
            value, slope = value_and_slope(rows, contacts.row[k], h, at_stop)
            if sign * (value - contacts.sign[k] * contacts.gap[k]) > 0.0 and sign * slope > 0.0:
                earlier = time_at_stop(rows, k, contacts, h, at_stop, direction)
                if earlier < at_stop:
                    contact = k
                    at_stop = earlier
    return contact, at_stop


@kernel
def jerk_at_stop(arrival, z, a, model):
    """Return the jerk of the row of a contact that exerts no force, with acceleration a."""
    contact, contacts = arrival.contact, model.contacts
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    row, sign = contacts.row[contact], contacts.sign[contact]
    jerk = model.forcing[row] * forcing_rate(arrival.forcing, 0, model)
    for j in range(n):
        jerk -= stiffness[row, j] * z[n + j] + damping[row, j] * a[j]
    if contacts.is_oblique:
        for k in range(contacts.row.shape[0]):
            if k != contact and arrival.key & contact_bit(k):
                pull = contacts.beta[k] * contacts.sign[k] * z[n + contacts.row[k]]
                jerk -= sign * contacts.oblique[contact, k] * pull
    return jerk


@entry_point(
    (INT, FLOAT, KEY), INT, SEGMENT, FLOAT, VECTOR, KEY, FLOAT, BYTES, inner=True, specialises=True
)
def pass_layer(contact, before, tau, z, promised, amplitude, packed):
    """Take the contact at its stop, in state z, through its layer in closed form if possible.

    Parameters
    ----------
    contact : int
    before : Segment
        The motion up to the stop.
    tau : float
        Time at the stop; ``work.forcing`` is the forcing at that time.
    z : ndarray, shape (2R,)
    promised : uint64
    amplitude : float
    packed : ndarray of bytes
        A packed `Shared`.

    Returns
    -------
    how : int
        `INTEGRATED`, with z unchanged, if the passage has to be integrated. ``work.a`` then holds
        the accelerations at the stop without the force of the contact.
    float
        Jerk of its row, likewise.
    promised : uint64
        Contacts whose next passage has to be in closed form, see `passes_apart`; updated.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.previous)
    model, work = shared.model, shared.work
    arrival = Arrival(contact, before.key, tau, work.forcing)
    contacts, a = model.contacts, work.a
    stiffness, damping, rho = model.stiffness, model.damping, model.rho
    n = stiffness.shape[0]
    row, sign = contacts.row[contact], contacts.sign[contact]
    z[row] = sign * contacts.gap[contact]
    ground = total_forcing(arrival.forcing, 0, model)
    for i in range(n):
        force = model.forcing[i] * ground
        k = contacts.solo[i]
        if k >= 0 and k != contact and arrival.key & contact_bit(k):
            force -= contacts.sign[k] * contacts.beta[k] * distance(k, z, contacts)
        for j in range(n):
            force -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        a[i] = force
    for other in range(contacts.others.shape[0]):
        k = contacts.others[other]
        if k != contact and arrival.key & contact_bit(k):
            force = contacts.beta[k] * distance(k, z, contacts)
            for p in range(contacts.first[k], contacts.first[k + 1]):
                a[contacts.push_row[p]] -= contacts.push[p] * force
    jerk = jerk_at_stop(arrival, z, a, model)
    if not contacts.is_elastic:
        return INTEGRATED, jerk, promised
    v, pushed, bend = sign * z[n + row], sign * a[row], sign * jerk
    free = arrival.key & contact_bit(contact) == np.uint64(0)
    if passage_is_fast(v, pushed, bend, contact, model):
        how = FAST
    elif rho == math.inf:
        return INTEGRATED, jerk, promised
    elif passage_is_smooth(v, pushed, bend, contact, model):
        how = SLOW
    elif free and half_is_smooth(v, pushed, bend, False, contact, model):
        how = ARRIVED
    else:
        return INTEGRATED, jerk, promised
    if rho == math.inf:
        return how, jerk, promised
    if how != FAST:
        if promised != np.uint64(0) or not is_alone(arrival, z, a, amplitude, model):
            return INTEGRATED, jerk, promised
    elif promised & contact_bit(contact) == np.uint64(0):
        apart, more = passes_apart(arrival, z, a, amplitude, model)
        if not apart:
            return INTEGRATED, jerk, promised
        promised |= more
    if how == FAST:
        found = moments(v, pushed, bend, contacts.beta[contact], rho)
        add_kick(found, contact, arrival.key, model, z)
    else:
        how = _pass_slowly(how, arrival, z, before.index, packed, shared)
    if how == INTEGRATED:
        return how, jerk, promised
    return how, jerk, promised & ~contact_bit(contact)


@inlined
def _pass_slowly(how, arrival, z, index, packed, shared):
    """Take the contact at its stop by `slow_passage`; return how it was taken."""
    contact, moved = arrival.contact, shared.work.moved
    after = index
    if how == SLOW:
        after = table_at_hand(arrival.key ^ contact_bit(contact), shared.tables, packed)
        if after < 0:
            return INTEGRATED
    copy_state(z, moved)
    if cross_half(-1.0, index, contact, moved, packed) == 0:
        return INTEGRATED
    if how == SLOW and cross_half(1.0, after, contact, moved, packed) == 0:
        return INTEGRATED
    copy_state(moved, z)
    return how
