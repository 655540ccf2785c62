"""How long a step with one contact in its layer may be, and what the linear motion is meanwhile.

The poles of the sigmoid limit it (`layer.limits`). Damping, forcing and floors do not; that others
stay away from their layers does.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.solvers.flow.contacts import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.layer.limits import reach, stiffness_up_to
from hpcsweep.solvers.flow.layer.solitary.store import LEVELS
from hpcsweep.solvers.flow.propagators import table_of

ELLIPSE = 2.82
"""kappa + 1 / kappa with kappa = 2.41: kappa^-32 = 6e-13."""
CONTRACTION = 4.0
"""Most h sqrt(|df/dd|)."""
SURE = 1.5
"""How much further than it is seen to another contact may move on a step."""
AT_EDGE = 1.001
"""Distance, in half-widths of the layer, of a contact that counts as being inside."""
LEAST_PART = 0.1
"""Of a step that is shortened because another contact comes near its layer."""


@kernel
def solitary_contact(z, model):
    """Find the contact that is inside its layer or at its edge; -1 if there is none or more."""
    found = -1
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        if abs(distance(k, z, contacts)) < AT_EDGE * model.layer:
            if found >= 0:
                return -1
            found = k
    return found


@kernel
def plan_step(contact, z, a, most, model):
    """Choose the length of a step, `most` at most, from state z and accelerations a.

    Returns
    -------
    h : float
        0 if another contact is too near its layer, or less than half of a step is left.
    stiffness : float
        Largest |df/dd| expected.
    """
    contacts, rho = model.contacts, model.rho
    x, v = distance(contact, z, contacts), approach_speed(contact, z, contacts)
    pushed = contacts.sign[contact] * a[contacts.row[contact]]
    y = rho * x
    ahead = 1.0 if v >= 0.0 else -1.0
    slowing, v = ahead * pushed < 0.0, abs(v)
    pushed = abs(pushed)
    way = reach(ahead * y, ELLIPSE) / rho
    turn = 0.5 * v * v / pushed
    nearest = x + way
    if slowing and turn < way:
        # to where it turns, and as far as it may go from there
        way = reach(-ahead * (y + ahead * rho * turn), ELLIPSE) / rho
        h = v / pushed + math.sqrt(2.0 * way / pushed)
        nearest = x + turn
    else:
        square = v * v + (-2.0 if slowing else 2.0) * pushed * way
        h = 2.0 * way / (v + math.sqrt(max(square, 0.0)))
    beta = contacts.beta[contact]
    # beyond the stop the spring is part of the linear motion
    stiff = 0.5 * beta if y > 0.0 else abs(stiffness_up_to(nearest, beta, rho))
    if h * h * stiff > CONTRACTION * CONTRACTION:
        h = CONTRACTION / math.sqrt(stiff)
    if h > 2.0 * most:
        return 0.0, stiff
    h = min(h, most)
    for k in range(contacts.row.shape[0]):
        if k == contact:
            continue
        room = abs(distance(k, z, contacts)) - model.layer
        way = SURE * h * (abs(approach_speed(k, z, contacts)) + abs(a[contacts.row[k]]) * h)
        if way > room:
            if not way * LEAST_PART < room:
                return 0.0, stiff
            h *= room / way
    return h, stiff


@kernel
def others_stay_away(contact, before, after, model):
    """Tell whether all other contacts are outside their layers, on the same sides as before."""
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x = distance(k, after, contacts)
        if k != contact and not (abs(x) >= model.layer and x * distance(k, before, contacts) > 0.0):
            return False
    return True


@inlined
def level_of(h, longest):
    """Give the level of the longest step of the tables that is not longer than h, its length."""
    level = 0
    while level < LEVELS and longest > h:
        longest *= math.sqrt(0.5)
        level += 1
    return level, longest


@inlined
def linear_table(z, model, tables, packed):
    """Give the table of the contacts that touch in state z."""
    contacts = model.contacts
    key = np.uint64(0)
    for k in range(contacts.row.shape[0]):
        if distance(k, z, contacts) > 0.0:
            key |= contact_bit(k)
    return table_of(key, tables, packed)
