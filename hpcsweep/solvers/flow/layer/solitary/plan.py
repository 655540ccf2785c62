"""Choose the length of a step with one contact in its layer, and its linear motion.

The force is an analytic function of time except where the contact is at a pole of the sigmoid, rho
x = +-i pi. With the initial motion, x + v t + a t^2 / 2, that is at two complex times, ahead or
behind, and their conjugates,

    t = -2 (x - i pi / rho) / (v + w),  -(v + w) / a,        w^2 = v^2 - 2 a (x - i pi / rho).

The step is as long as the ellipse of `layer.limits` excludes the nearer of them. Damping, forcing
and floors do not limit it; the condition that others stay outside their layers does.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.solvers.flow.layer.scheme import reach, stiffness_up_to
from hpcsweep.solvers.flow.linear.step import table_of
from hpcsweep.solvers.flow.state.state import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.state.tables import LEVELS

ELLIPSE = 3.0
"""kappa + 1 / kappa with kappa = 2.62: kappa^-32 = 4e-14."""


CONTRACTION = 4.0
"""Largest h sqrt(|df/dd|)."""


SURE = 1.5
"""Factor by which another contact may move further on a step than estimated."""


AT_EDGE = 1.001
"""Distance, in half-widths of the layer, of a contact that counts as being inside."""


MIN_PART = 0.1
"""Least fraction of a step that is shortened because another contact comes near its layer."""


@kernel
def solitary_contact(z, model):
    """Return the only contact inside its layer or at its edge; -1 if there is none or several."""
    found = -1
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        if abs(distance(k, z, contacts)) < AT_EDGE * model.layer:
            if found >= 0:
                return -1
            found = k
    return found


@kernel
def until_poles(x, v, pushed, rho):
    """Return the length of a step from the times at which the contact is at a pole; see the module.

    Parameters
    ----------
    x, v, pushed : float
        Distance past the stop, speed and acceleration towards it.
    rho : float
    """
    pole = math.pi / rho
    # w = u + i s, the root of v^2 - 2 a (x - i pi / rho) that has the sign of v
    square, twist = v * v - 2.0 * pushed * x, 2.0 * pushed * pole
    larger = math.sqrt(0.5 * (math.sqrt(square * square + twist * twist) + abs(square)))
    smaller = 0.5 * abs(twist) / larger if larger > 0.0 else 0.0
    u, s = (larger, smaller) if square >= 0.0 else (smaller, larger)
    ahead = 1.0 if v >= 0.0 else -1.0
    pushing = 1.0 if pushed >= 0.0 else -1.0
    s *= pushing * ahead
    # v + w
    u = u * ahead + v
    size = u * u + s * s
    if not size > 0.0:
        return math.inf
    # t = -2 (x - i pi / rho) / (v + w) and -(v + w) / a
    first = 2.0 * math.sqrt((x * x + pole * pole) / size)
    h = reach(first, -2.0 * (x * u - pole * s) / size, ELLIPSE)
    if pushed != 0.0:
        h = min(h, reach(math.sqrt(size), -u * pushing, ELLIPSE) / abs(pushed))
    return h


@kernel
def plan_step(contact, z, a, most, model):
    """Return the length of a step, at most `most`, from state z and accelerations a.

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
    beta = contacts.beta[contact]
    h = until_poles(x, v, pushed, rho)
    if x > 0.0:
        stiff = 0.5 * beta  # the spring is part of the linear motion
    else:
        turn = min(h, v / -pushed) if v > 0.0 and pushed < 0.0 else h
        nearest = x + max(0.0, v + 0.5 * pushed * turn) * turn
        stiff = abs(stiffness_up_to(nearest, beta, rho))
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
            if not way * MIN_PART < room:
                return 0.0, stiff
            h *= room / way
    return h, stiff


@kernel
def others_stay_away(contact, before, after, model):
    """Return whether all other contacts stay outside their layers, on the same sides."""
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x = distance(k, after, contacts)
        if k != contact and not (abs(x) >= model.layer and x * distance(k, before, contacts) > 0.0):
            return False
    return True


@inlined
def level_of(h, longest):
    """Return level and length of the longest step of the tables not longer than h."""
    level = 0
    while level < LEVELS and longest > h:
        longest *= math.sqrt(0.5)
        level += 1
    return level, longest


@inlined
def linear_table(z, without, model, tables, packed):
    """Return the table of the contact set of state z, less one contact unless `without` is -1."""
    contacts = model.contacts
    key = np.uint64(0)
    for k in range(contacts.row.shape[0]):
        if k != without and distance(k, z, contacts) > 0.0:
            key |= contact_bit(k)
    return table_of(key, tables, packed)
