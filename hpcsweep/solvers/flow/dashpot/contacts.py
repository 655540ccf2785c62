r"""The contacts of a motion with dashpots, and what changes them.

A contact set alone does not tell the motion: a contact may be *past* its stop and *push*, or be
past it and have let go (`hpcsweep.model.dashpot`). The set of those that push makes the motion
linear, and is the key of its table; the set of those past their stops tells what ends it. A contact
changes

- where x = 0: it closes, and pushes at once; or it opens, whether it pushes (with tension) or not;
- without tension, while past its stop, where its force phi = beta x + drag x' falls to 0, or grows
  above 0 again.

Along a step phi is a polynomial as x and x' are. It is searched as a distance is (`search`), with
the bound |phi''''| <= sum_p |c_p| p (p - 1) (p - 2) (p - 3) (2 / h)^4 of its own coefficients, and
measured in units in which the larger of the two parts of its law is 1. All contacts here are sharp:
there is no layer, and the state does not jump.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.kernel_contacts import DASHPOT, DRAG, LETS_GO, SPRING
from hpcsweep.solvers.flow.linear.forcing import forcing_at, total_forcing
from hpcsweep.solvers.flow.linear.polynomials import (
    evaluate_rows,
    expand_row,
    expand_rows,
    value_and_slope,
)
from hpcsweep.solvers.flow.search.events import first_event, layer_edge
from hpcsweep.solvers.flow.search.search import (
    UNDECIDED,
    Bracket,
    Curve,
    Level,
    Part,
    first_passage,
    leaves,
    may_reach,
    rising_root,
)
from hpcsweep.solvers.flow.state.state import Segment, approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.measures import ROUNDING

SAME_INSTANT = 2.0**-40
"""Part of a step within which contacts are at their stops at one instant, see `period`."""
AT_REST = 2.0**-40
"""Part of the size of a state, or of a gap, that hides whether a contact at its stop moves: the
rounding of a speed that the restarts of a motion leave, some 1e-13, grown tenfold."""
AT_STOP = 1e-14
"""Distance (gaps) within which a contact that moves towards its stop is taken to be before it at
the start of a period or a sample interval: a change at the end of one belongs to the next, and is
found there whatever side rounding has put it on."""


@inlined
def has_dashpots(model):
    """Return whether motions go from one change of the dashpots' contacts to the next.

    Contacts of finite sharpness take the steps of their layers, with dashpots or without.
    """
    return model.rho == math.inf and not model.contacts.is_elastic


@kernel
def pushing(past, z, contacts):
    """Return which of the contacts past their stops push in a state."""
    key = past
    for k in range(contacts.row.shape[0]):
        if contacts.edges[k, LETS_GO] > 0.0 and past & contact_bit(k):
            x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
            if contacts.edges[k, SPRING] * x + contacts.edges[k, DASHPOT] * w < 0.0:
                key ^= contact_bit(k)
    return key


@kernel
def past_stops(tau, z, amplitude, model, work):
    """Return the contacts past their stops in a state.

    One at its stop that moves beyond passes it next, and is not; one that rests there is if it
    accelerates beyond.
    """
    past = resting = np.uint64(0)
    contacts = model.contacts
    for k in range(contacts.row.shape[0]):
        x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
        if x > (AT_STOP if w > 0.0 else 0.0):
            past |= contact_bit(k)
        elif x == 0.0 and w == 0.0:
            resting |= contact_bit(k)
    if resting != np.uint64(0):
        forcing_at(tau, amplitude, model, work.forcing, 0)
        _accelerations(pushing(past, z, contacts), z, model, work)
        for k in range(contacts.row.shape[0]):
            if resting & contact_bit(k) and contacts.sign[k] * work.a[contacts.row[k]] > 0.0:
                past |= contact_bit(k)
    return past


@kernel
def rest_at_stops(tau, past, key, z, amplitude, model, work):
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
        own = max(size, abs(contacts.gap[k]))
        x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
        if abs(x) <= ROUNDING * own and abs(w) <= AT_REST * own and (x != 0.0 or w != 0.0):
            resting |= contact_bit(k)
    if resting == np.uint64(0):
        return past, key
    forcing_at(tau, amplitude, model, work.forcing, 0)
    _accelerations(key & ~resting, z, model, work)
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if resting & bit == np.uint64(0):
            continue
        way = contacts.sign[k] * work.a[contacts.row[k]]
        if way == 0.0:
            continue
        own = math.copysign(ROUNDING * max(size, abs(contacts.gap[k])), way)
        z[contacts.row[k]] = contacts.sign[k] * (contacts.gap[k] + own)
        past = past | bit if way > 0.0 else past & ~bit
        key = key | bit if way > 0.0 else key & ~bit
    return past, key


@kernel
def _accelerations(key, z, model, work):
    """Evaluate y'' into ``work.a`` where the contacts of a set push; ``work.forcing`` shakes."""
    contacts, a = model.contacts, work.a
    n = a.shape[0]
    ground = total_forcing(work.forcing, 0, model)
    for i in range(n):
        force = model.forcing[i] * ground
        for j in range(n):
            force -= model.stiffness[i, j] * z[j] + model.damping[i, j] * z[n + j]
        a[i] = force
    for k in range(contacts.row.shape[0]):
        if key & contact_bit(k):
            x, w = distance(k, z, contacts), approach_speed(k, z, contacts)
            force = contacts.beta[k] * x + contacts.edges[k, DRAG] * w
            for p in range(contacts.first[k], contacts.first[k + 1]):
                a[contacts.push_row[p]] -= contacts.push[p] * force


@kernel
def force_polynomial(k, scale, index, model, tables, work):
    """Write the force of a contact along a step, times `scale`, into ``work.drift_rows``.

    Returns
    -------
    float
        Bound of its fourth derivative.
    """
    contacts, rows, out = model.contacts, work.rows, work.drift_rows
    row = contacts.row[k]
    speed_row = work.expanded.shape[0] // 2 + row
    for i in (row, speed_row):
        if not work.expanded[i]:
            expand_row(tables.poly, index, i, work.x, rows)
            work.expanded[i] = True
    spring, dashpot = scale * contacts.edges[k, SPRING], scale * contacts.edges[k, DASHPOT]
    sign = contacts.sign[k]
    bound4 = 0.0
    for p in range(N_COEFFICIENTS):
        out[0, p] = spring * sign * rows[row, p] + dashpot * sign * rows[speed_row, p]
        bound4 += abs(out[0, p]) * (p * (p - 1.0) * (p - 2.0) * (p - 3.0))
    out[0, 0] -= spring * contacts.gap[k]
    return bound4 * (2.0 / tables.h[index]) ** 4


@inlined
def first_change(segment, past, span, model, tables, work):
    """Find the first contact that changes along a step, from ``work.x`` to ``work.z_end``.

    Returns
    -------
    place : int
        The contact, if it is at its stop; m further on, if its force is 0; -1 if none changes
        (proved), `UNDECIDED` if rounding forbids to tell.
    time : float
        When, or `span`. ``work.z_end`` is the state then.
    """
    contacts, h, index = model.contacts, segment.h, segment.index
    m = contacts.row.shape[0]
    own = Segment(past, index, h, segment.tau, segment.end)
    place, bracket, _ = first_event(own, span, model, tables.poly, work)
    time = span
    if place >= 0:
        curve = Curve(work.rows, contacts.row[place], h)
        time = rising_root(curve, bracket, layer_edge(past, place, model))
    for k in range(m):
        if place != UNDECIDED and contacts.edges[k, LETS_GO] > 0.0 and past & contact_bit(k):
            found = _force_root(k, segment, time, model, tables, work)
            if found == UNDECIDED:
                place = UNDECIDED
            elif found >= 0.0:
                place, time = m + k, found
    if place >= 0:
        expand_rows(tables.poly, index, work.x, work.rows, work.expanded, work.z_end.shape[0])
        evaluate_rows(work.rows, h, time, work.z_end)
    return place, time


@kernel
def _force_root(k, segment, end, model, tables, work):
    """Return when the force of a contact first falls, or grows, through 0 up to `end`.

    -1 if it does not (proved), `UNDECIDED` if rounding forbids to tell.
    """
    edges = model.contacts.edges
    scale = 1.0 / max(edges[k, SPRING], edges[k, DASHPOT])
    bound4 = force_polynomial(k, scale, segment.index, model, tables, work)
    curve = Curve(work.drift_rows, 0, segment.h)
    level = Level(-1.0 if segment.key & contact_bit(k) else 1.0, 0.0)
    g0, slope0 = value_and_slope(curve.rows, 0, curve.h, 0.0)
    g1, slope1 = value_and_slope(curve.rows, 0, curve.h, end)
    g0, slope0, g1, slope1 = (
        level.sign * g0,
        level.sign * slope0,
        level.sign * g1,
        level.sign * slope1,
    )
    if not may_reach(end, g0, slope0, g1, slope1, bound4) or leaves(
        end, g0, slope0, g1, slope1, bound4
    ):
        return -1.0
    part = Part(0.0, g0, slope0, end, g1, slope1)
    a, ga, b, gb = first_passage(curve, part, level, bound4, work.stack)
    if a < 0.0:
        return a
    return rising_root(curve, Bracket(a, ga, b, gb), level)


@inlined
def changed(place, segment, past, model, z):
    """Let contacts change in a state z, the stop of the first of them put where it is.

    Contacts at their stops at one instant pass together (`period.passing_contacts`).

    Returns
    -------
    past, key : uint64
        Contacts past their stops, and those that push, afterwards.
    """
    contacts, key = model.contacts, segment.key
    m = contacts.row.shape[0]
    if place >= m:
        return past, key ^ contact_bit(place - m)
    z[contacts.row[place]] = contacts.sign[place] * contacts.gap[place]
    passing = contact_bit(place)
    for k in range(m):
        bit = contact_bit(k)
        w = approach_speed(k, z, contacts)
        goes_on = w < 0.0 if past & bit else w > 0.0
        near = SAME_INSTANT * segment.h * abs(w)
        if k != place and goes_on and abs(distance(k, z, contacts)) <= near:
            passing |= bit
    closing = passing & ~past
    return past ^ passing, (key & ~passing) | closing


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
