r"""The contacts of a motion that goes from one change of its elements to the next.

A contact set alone does not tell the motion: a contact may be *past* its stop and *push*, or be
past it and have let go (`hpcsweep.model.dashpot`). The set of those that push makes the motion
linear, and is in the key of its table; the set of those past their stops tells what ends it. Both
follow from a state where a stretch begins. The state does not jump. Smooth contacts are past their
stops here from the near edge of their layers on, and push beyond the far one; within they do
neither, and the motion is that of `layer.elements`.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_vector
from hpcsweep.model.elements import LET_GO, OPEN, PUSHING
from hpcsweep.model.kernel_contacts import DASHPOT, DRAG, LETS_GO, SPRING
from hpcsweep.model.observed import ROUNDING
from hpcsweep.solvers.flow.state.state import approach_speed, contact_bit, distance, start
from hpcsweep.solvers.flow.step.constraint import rigid_of
from hpcsweep.solvers.flow.step.forcing import forcing_at
from hpcsweep.solvers.flow.step.series import accelerations_of

AT_REST = 2.0**-40
"""Part of the size of a state, or of a gap, that hides whether a contact at its stop moves: the
rounding of a speed that the restarts of a motion leave, some 1e-13, grown tenfold."""
AT_STOP = 1e-14
"""Distance (gaps) within which a contact that moves towards its stop is taken to be before it at
the start of a period or a sample interval: a change at the end of one belongs to the next, and is
found there whatever side rounding has put it on."""


@inlined
def by_elements(model):
    """Return whether motions go from one change of their elements to the next."""
    return model.elements.first.shape[0] > 0


@inlined
def set_contacts(past, key, modes, contacts):
    """Set the modes of the contacts, from those past their stops and those that push."""
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        mode = OPEN if past & bit == np.uint64(0) else LET_GO
        modes.mode[k] = (LET_GO + 1) * k + (PUSHING if key & bit else mode)


@kernel
def pushing(past, z, model):
    """Return which of the contacts past their stops push in a state; smooth ones beyond a layer."""
    contacts, key = model.contacts, past
    for k in range(contacts.row.shape[0]):
        if model.layer > 0.0:
            if past & contact_bit(k) and distance(k, z, contacts) < model.layer:
                key ^= contact_bit(k)
        elif contacts.edges[k, LETS_GO] > 0.0 and past & contact_bit(k):
            x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
            if contacts.edges[k, SPRING] * x + contacts.edges[k, DASHPOT] * w < 0.0:
                key ^= contact_bit(k)
    return key


@kernel
def past_stops(tau, z, amplitude, model, pairs, series):
    """Return the contacts past their stops in a state.

    One at its stop that moves beyond passes it next, and is not; one that rests there is if it
    accelerates beyond. A smooth one is from the edge of its layer on.
    """
    past = resting = np.uint64(0)
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
        if model.layer > 0.0:
            past |= contact_bit(k) if x > -model.layer else np.uint64(0)
        elif x > (AT_STOP if w > 0.0 else 0.0):
            past |= contact_bit(k)
        elif x == 0.0 and w == 0.0:
            resting |= contact_bit(k)
    if resting != np.uint64(0):
        forcing_at(tau, amplitude, model, pairs, 0)
        a = local_vector(series.field.shape[1])
        accelerations(pushing(past, z, model), z, pairs, model, series, a)
        for k in range(contacts.row.shape[0]):
            if resting & contact_bit(k) and contacts.sign[k] * a[contacts.row[k]] > 0.0:
                past |= contact_bit(k)
    return past


@kernel
def rest_at_stops(tau, past, key, z, amplitude, model, pairs, series):
    """Let contacts that rest at their stops, to rounding, go where they accelerate to.

    About the moment at which such a contact turns rounding has the last word on its distance and on
    its speed, and would let it pass its stop again and again. It is put on the side to which it
    accelerates, as far from its stop as rounding may have moved it. One whose speed is above
    rounding takes the time of that speed to come back.

    Returns
    -------
    past, key : uint64
        Contacts past their stops, and those that push, afterwards.
    """
    contacts, size = model.contacts, 0.0
    for i in range(z.shape[0]):
        size = max(size, abs(z[i]))
    resting = np.uint64(0)
    for k in range(contacts.row.shape[0]):
        scale = max(size, abs(contacts.gap[k]))
        x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
        if abs(x) <= ROUNDING * scale and abs(w) <= AT_REST * scale and (x != 0.0 or w != 0.0):
            resting |= contact_bit(k)
    resting ^= rigid_of(resting, contacts)  # see `march.impact`
    if resting == np.uint64(0):
        return past, key
    forcing_at(tau, amplitude, model, pairs, 0)
    a = local_vector(series.field.shape[1])
    accelerations(key & ~resting, z, pairs, model, series, a)
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if resting & bit == np.uint64(0):
            continue
        way = contacts.sign[k] * a[contacts.row[k]]
        if way == 0.0:
            continue
        away = math.copysign(ROUNDING * max(size, abs(contacts.gap[k])), way)
        z[contacts.row[k]] = contacts.sign[k] * (contacts.gap[k] + away)
        past = past | bit if way > 0.0 else past & ~bit
        key = key | bit if way > 0.0 else key & ~bit
    return past, key


@inlined
def accelerations(key, z, pairs, model, series, out):
    """Evaluate y'' of all rows, padded, in state z for a set; `pairs` are the forcing and loads."""
    x = local_vector(series.field.shape[0])
    start(x, z, pairs)
    accelerations_of(x, key, model, series, out)


@inlined
def change_tangent(passing, past, key, model, tangent):
    """Multiply `tangent` by the saltation matrices of contacts that pass their stops, in place.

    Where a contact closes, its distance x rising through 0, the field jumps from f_- to f_+ =
    f_- - drag x' e, and a tangent vector w becomes

        w + (f_+ - f_-) (grad x . w) / (grad x . f_-),        grad x . f_- = x':

    the speeds change by -drag e times the distance of w, and by drag e times that where the
    contact opens while it pulls. Where a force is 0 nothing jumps.

    Parameters
    ----------
    passing, past, key : uint64
        Those that pass; past their stops, and pushing, before.
    """
    contacts = model.contacts
    n = tangent.shape[0] // 2
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if passing & bit == np.uint64(0):
            continue
        jump = -contacts.edges[k, DRAG]
        if past & bit:
            jump = contacts.edges[k, DRAG] if key & bit else 0.0
        for column in range(tangent.shape[1]):
            away = jump * contacts.sign[k] * tangent[contacts.row[k], column]
            for p in range(contacts.first[k], contacts.first[k + 1]):
                tangent[n + contacts.push_row[p], column] += contacts.push[p] * away
