"""Fast passage of a contact: which one is at its stop, and whether it may pass in closed form.

The passage itself is that of `crossing`. What may not pass that way is integrated by `layer`.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import FULL_POTENTIAL, contact_force
from hpcsweep.solvers.flow.contacts import contact_bit, distance
from hpcsweep.solvers.flow.crossing import NEGLECTED, add_kick, moments, passage_is_fast
from hpcsweep.solvers.flow.forcing import forcing_rate, steepest_forcing, total_forcing
from hpcsweep.solvers.flow.polynomials import value_and_slope
from hpcsweep.solvers.flow.slow_passage import (
    DISPLACED,
    cross_half,
    half_is_smooth,
    passage_is_smooth,
)
from hpcsweep.solvers.flow.tables import lookup

EXTRAPOLATION = 1.005
"""How far beyond its step a polynomial is used, in steps: its error grows less than fivefold."""


INTEGRATED, FAST, SLOW, ARRIVED = range(4)
"""How a passage is taken: integrated; by `crossing`; by `slow_passage`, on both sides or to where
the contact is at its stop."""


class Arrival(NamedTuple):
    """A contact at its stop."""

    contact: int
    key: np.uint64
    """Contact set before."""
    tau: float
    forcing: np.ndarray
    """Pairs of sine and cosine, see `forcing`."""


@kernel
def time_at_stop(rows, k, contacts, h, s, direction):
    """Follow a contact from the edge of its layer (time s) to the stop; NaN if it turns.

    `direction` is 1 on the way in, -1 on the way out.
    """
    row, sign = contacts.row[k], contacts.sign[k]
    stop = sign * contacts.gap[k]
    for _ in range(40):
        value, slope = value_and_slope(rows, row, h, s)
        if not direction * sign * slope > 0.0:
            return math.nan
        step = (stop - value) / slope
        s += step
        if abs(step) <= 1e-15 * h:
            return s
    return s


@kernel
def first_at_stop(contact, at_stop, key, rows, h, contacts):
    """Choose the contact that is first at its stop, not after `at_stop`.

    The one that is first at the edge of its layer may be overtaken inside by a faster one.
    """
    for k in range(contacts.row.shape[0]):
        if k != contact and at_stop <= h * EXTRAPOLATION:
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
def _coupling(k, model, span):
    """Bound |D_kl| + |K_kl| t over all other contacts l; inf if one pushes contact k itself."""
    contacts = model.contacts
    row = contacts.row[k]
    coupling = 0.0
    for other in range(contacts.row.shape[0]):
        if other == k:
            continue
        if contacts.is_oblique and contacts.oblique[k, other] != 0.0:
            return math.inf
        stiff = 0.0
        for p in range(contacts.first[other], contacts.first[other + 1]):
            stiff += model.stiffness[row, contacts.push_row[p]] * contacts.push[p]
        coupling = max(coupling, abs(contacts.damped[other, row]) + abs(stiff) * span)
    return coupling


@kernel
def passes_apart(arrival, z, a, amplitude, model):
    """Tell whether the contact at its stop may pass its layer apart from all other contacts.

    That holds where no other comes near its layer meanwhile, and also where those that do will
    pass as fast. While two are inside their layers the force of one moves the other only through
    the coupling D_12 + K_12 t, t the time both take: it changes the speed of the second by J_1
    coupling t and hence its impulse J_2 by J_1 J_2 coupling t / v, which must be negligible. It
    does not hold for contacts that push each other directly.

    Returns
    -------
    bool
    promised : uint64
        The contacts on their way to the stop that were found to pass fast. They may be inside their
        layers already, so that they have to be taken through in closed form, too.
    """
    contacts, key, tau = model.contacts, arrival.key, arrival.tau
    stiffness, damping = model.stiffness, model.damping
    rho, omega, layer = model.rho, model.omega, model.layer
    n = stiffness.shape[0]
    end = 2.0 * math.pi / omega
    least = abs(z[n + contacts.row[arrival.contact]])
    span = 2.0 * layer / least
    strongest = contacts.beta[arrival.contact]
    promised = np.uint64(0)
    found = contact_bit(arrival.contact)
    searching = True
    while searching:
        searching = False
        if tau - span < 0.0 or tau + span > end:
            return False, promised
        for k in range(contacts.row.shape[0]):
            bit = contact_bit(k)
            i = contacts.row[k]
            x = abs(distance(k, z, contacts))
            w = abs(z[n + i])
            if found & bit or x - (w + abs(a[i]) * span) * span > layer:
                continue
            beta = contacts.beta[k]
            way = 2.0 * layer + x
            square = w * w - 2.0 * (abs(a[i]) + beta * way) * way
            if not square > 0.25 * w * w:
                return False, promised
            slowest = math.sqrt(square)
            span = max(span, way / slowest)
            least = min(least, slowest)
            strongest = max(strongest, beta)
            energy = 2.0 * FULL_POTENTIAL * strongest / (rho * rho)
            jerk = steepest_forcing(amplitude, model) * abs(model.forcing[i])
            for j in range(n):
                jerk += abs(stiffness[i, j] * z[n + j]) + abs(damping[i, j] * a[j])
            coupling = _coupling(k, model, span)
            if not energy * energy * coupling * span <= NEGLECTED * least**3:
                return False, promised
            if not passage_is_fast(slowest, abs(a[i]), jerk, k, model):
                return False, promised
            found |= bit
            if (contacts.sign[k] * z[n + i] < 0.0) == (key & bit != np.uint64(0)):
                promised |= bit
            searching = True
    return True, promised


@inlined
def table_at_hand(key, model, tables):
    """Find or build the table of a contact set; -1 where that would empty the store of tables."""
    count = tables.count[0]
    for index in range(count):
        if tables.keys[index] == key:
            return index
    return lookup(key, model, tables) if count < tables.keys.shape[0] else -1


@kernel
def jerk_at_stop(arrival, z, a, model):
    """Differentiate the acceleration a of the row of a contact that exerts no force."""
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


@kernel
def pass_layer(arrival, z, index, promised, amplitude, shared):
    """Take the contact at its stop, in state z, through its layer if it need not be integrated.

    Parameters
    ----------
    arrival : Arrival
    z : ndarray, shape (2R,)
    index : int
        Of the table of the motion before.
    promised : uint64
    amplitude : float
    shared : Shared

    Returns
    -------
    how : int
        `INTEGRATED`, with z unchanged, if the passage has to be integrated instead. ``work.a``
        then holds the accelerations at the stop without the force of the contact.
    float
        Jerk of its row, likewise.
    promised : uint64
        Contacts whose next passage has to be in closed form, see `passes_apart`; brought up to
        date.
    """
    model, tables, work = shared.model, shared.tables, shared.work
    contact, contacts, a = arrival.contact, model.contacts, work.a
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
    if promised & contact_bit(contact) == np.uint64(0) or how == ARRIVED:
        apart, more = passes_apart(arrival, z, a, amplitude, model)
        if not apart or (how == ARRIVED and (more | promised) != np.uint64(0)):
            return INTEGRATED, jerk, promised
        promised |= more
    if how == FAST:
        found = moments(v, pushed, bend, contacts.beta[contact], rho)
        add_kick(found, contact, arrival.key, model, z)
    else:
        how = _pass_slowly(how, arrival, z, index, model, tables, work)
    if how == INTEGRATED:
        return how, jerk, promised
    return how, jerk, promised & ~contact_bit(contact)


@inlined
def _pass_slowly(how, arrival, z, index, model, tables, work):
    """Take the contact at its stop by `slow_passage`; say how it was taken."""
    contact, forcing = arrival.contact, arrival.forcing
    after = index
    if how == SLOW:
        after = table_at_hand(arrival.key ^ contact_bit(contact), model, tables)
        if after < 0:
            return INTEGRATED
    z_end = work.z_end
    for i in range(z.shape[0]):
        z_end[i] = z[i]
    if not cross_half(-1.0, index, contact, forcing, z_end, model, tables, work.arriving):
        return INTEGRATED
    if how == SLOW and not cross_half(
        1.0, after, contact, forcing, z_end, model, tables, work.departing
    ):
        return INTEGRATED
    for i in range(z.shape[0]):
        z[i] = z_end[i]
    return how


@kernel
def leave_layer(contact, tau, z, a, amplitude, forcing, model, tables, work):
    """Go over to the linear motion before a stop that a contact has just reached from beyond it.

    Parameters
    ----------
    contact : int
    tau : float
    z : ndarray, shape (2R,)
        True state; on success that of the linear motion.
    a : ndarray, shape (R,)
        Its accelerations.
    amplitude : float
    forcing : ndarray
        Pairs at `tau`.
    model : Model
    tables : Tables
    work : Workspace

    Returns
    -------
    int
        The table of that motion; -1, with z unchanged, if the passage has to be integrated.
    """
    contacts = model.contacts
    key = np.uint64(0)
    for k in range(contacts.row.shape[0]):
        x = distance(k, z, contacts)
        if k == contact:
            if not model.rho * abs(x) <= 0.8 * DISPLACED:
                return -1
        elif abs(x) < model.layer:
            return -1
        elif x > 0.0:
            key |= contact_bit(k)
    row, sign = contacts.row[contact], contacts.sign[contact]
    arrival = Arrival(contact, key, tau, forcing)
    v = sign * z[model.stiffness.shape[0] + row]
    pushed = sign * a[row] + contact_force(
        distance(contact, z, contacts), contacts.beta[contact], model.rho
    )
    bend = sign * jerk_at_stop(arrival, z, a, model)
    if not (v < 0.0 and half_is_smooth(v, pushed, bend, False, contact, model)):
        return -1
    apart, more = passes_apart(arrival, z, a, amplitude, model)
    if not apart or more != np.uint64(0):
        return -1
    index = table_at_hand(key, model, tables)
    if index >= 0 and cross_half(1.0, index, contact, forcing, z, model, tables, work.departing):
        return index
    return -1
