"""Impacts of rigid contacts and their rest; the mathematics is in `hpcsweep.model.rigid`."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_vector
from hpcsweep.model.observed import CLOSINGS, DISSIPATED, FORCE, IMPACT, ROUNDING, TIME, TOGETHER
from hpcsweep.solvers.flow.guard.contacts import AT_REST, accelerations
from hpcsweep.solvers.flow.observe.impacts import record
from hpcsweep.solvers.flow.state.shared import NO_TALLY
from hpcsweep.solvers.flow.state.state import (
    approach_speed,
    contact_bit,
    copy_state,
    distance,
    start,
)
from hpcsweep.solvers.flow.step.constraint import push, rigid_of, solve_for, take_out
from hpcsweep.solvers.flow.step.forcing import forcing_at
from hpcsweep.solvers.flow.step.series import accelerations_of

THERE = 2.0**-50
"""Part of the size of displacements, or of a gap, to which a distance is known at best."""
FAST = 2.0**-12
"""Part of the size of a state: what leaves a stop faster is not held there."""
MOST = 10_000
"""Most impacts of contacts that push each other at one instant; sets that are tried for rest."""


@kernel
def sizes_of(z):
    """Return the size of a state, at least a unit, below which speeds are rounding, and at rest."""
    size = 1.0
    for i in range(z.shape[0]):
        size = max(size, abs(z[i]))
    return size, ROUNDING * size, AT_REST * size


@kernel
def at_stops(z, contacts):
    """Return the rigid contacts at their stops, to rounding, which do not close."""
    found, (size, _, slow) = np.uint64(0), sizes_of(z)
    for k in range(contacts.bounce.shape[0]):
        near = ROUNDING * max(size, abs(contacts.gap[k]))
        if abs(distance(k, z, contacts)) <= near and approach_speed(k, z, contacts) <= slow:
            found |= contact_bit(k)
    return rigid_of(found, contacts)


@kernel
def rest_of(tau, key, touching, z, amplitude, shared, told):
    """Let those of the contacts at their stops rest, in state z, that are held there.

    Parameters
    ----------
    tau : float
    key : uint64
        Set of the motion so far.
    touching : uint64
    z : ndarray, shape (2R,)
        Those that rest are put at rest.
    amplitude : float
    shared : Shared
    told : bool
        Whether it is told.

    Returns
    -------
    uint64
        Set of the motion.
    """
    model, pairs, series = shared.model, shared.work.forcing, shared.work.step.series
    contacts, tally, (size, least, at_rest) = model.contacts, shared.tally, sizes_of(z)
    m, pressed, slow = contacts.row.shape[0], np.uint64(0), np.uint64(0)
    a, values, speeds = local_vector(series.field.shape[1]), local_vector(m), local_vector(m)
    fast = True
    for k in range(m):
        speeds[k] = approach_speed(k, z, contacts)
        if touching & contact_bit(k) and speeds[k] < -at_rest:
            key &= ~contact_bit(k)
        fast = fast and (touching & contact_bit(k) == np.uint64(0) or speeds[k] < -FAST * size)
    if fast:
        return key
    forcing_at(tau, amplitude, model, pairs, 0)
    accelerations(key, z, pairs, model, series, a)
    for k in range(m):
        w, way, bit = speeds[k], contacts.sign[k] * a[contacts.row[k]], contact_bit(k) & touching
        values[k] = 2.0 * w / (way * (1.0 - contacts.bounce[k])) if w < -at_rest else 0.0
        if w < 0.0 < contacts.bounce[k] and _is_struck(k, touching, least, speeds, contacts):
            continue
        slow |= bit if abs(w) <= at_rest else np.uint64(0)
        hop = w < 0.0 and w * w <= 2.0 * ROUNDING * max(size, abs(contacts.gap[k])) * way
        pressed |= bit if hop else slow & bit
    key, resting = key & ~touching, pressed
    for _ in range(MOST):
        wrong = _first_wrong(key, pressed, resting, z, pairs, model, series, a)
        if wrong < 0:
            break
        resting ^= contact_bit(wrong)
    for k in range(m if told else 0):
        if resting & contact_bit(k) and contacts.bounce[k] < 1.0:
            tally.impacts[TIME, k] += values[k]
    put_at_rest(resting | slow, z, contacts, values)
    if told:
        _tell(values, speeds, False, z, model, tally)
    return key | resting


@inlined
def _is_struck(k, touching, least, speeds, contacts):
    """Return whether a contact that pushes k closes at the same instant."""
    for j in range(contacts.oblique.shape[0]):
        if touching & contact_bit(j) and contacts.oblique[k, j] != 0.0 and speeds[j] > least:
            return True
    return False


@inlined
def _tell(values, speeds, together, z, model, tally):
    """Tell of impulses and the energy lost, by the speeds before and in state z."""
    contacts = model.contacts
    for k in range(values.shape[0]):
        if values[k] > 0.0:
            counted = tally.impacts[CLOSINGS, k]
            record(k, True, speeds[k], z, model, tally)
            if together:
                tally.impacts[TOGETHER, k] += tally.impacts[CLOSINGS, k] - counted
        tally.impacts[FORCE, k] += values[k]
        w = speeds[k] + approach_speed(k, z, contacts)
        tally.impacts[DISSIPATED, k] += 0.5 * values[k] * w


@kernel
def put_at_rest(some, z, contacts, values):
    """Put contacts of a set to their stops, where they are to rounding, without speed.

    By what their rows are made of: one that were put there alone would leave that as it was.
    `values` are what has been taken of speeds.
    """
    _place(some, 0, z, contacts, values)
    _place(some, z.shape[0] // 2, z, contacts, values)


@kernel
def into_stops(z, contacts):
    """Put rigid contacts that a state has past their stops to these."""
    past, values = np.uint64(0), local_vector(contacts.row.shape[0])
    for k in range(values.shape[0]):
        past |= contact_bit(k) if distance(k, z, contacts) > 0.0 else np.uint64(0)
    if rigid_of(past, contacts) != np.uint64(0):
        _place(rigid_of(past, contacts), 0, z, contacts, values)


@kernel
def _place(some, first, z, contacts, values):
    """Put displacements, of which z has the rows from `first` = 0 on, to stops, or speeds to 0."""
    n, m = z.shape[0] // 2, values.shape[0]
    for k in range(m):
        values[k] = -contacts.gap[k] if first == 0 else 0.0
        for i in range(contacts.reach.shape[1]):
            values[k] += contacts.reach[k, i] * z[first + i]
    solve_for(some, contacts, values)
    push(values, contacts, z[first : first + n])
    for k in range(m):
        if some & contact_bit(k):
            z[first + contacts.row[k]] = contacts.sign[k] * contacts.gap[k] if first == 0 else 0.0


@inlined
def _first_wrong(key, pressed, resting, z, pairs, model, series, a):
    """Return the first contact whose reaction pulls, or that closes without one; -1 if none."""
    contacts, x = model.contacts, local_vector(series.field.shape[0])
    start(x, z, pairs)
    accelerations_of(x, key | resting, model, series, a)
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if resting & bit:
            reaction = size = 0.0
            for i in range(x.shape[0]):
                reaction += series.reactions[k, i] * x[i]
                size += abs(series.reactions[k, i] * x[i])
            if reaction < -ROUNDING * size:
                return k
        elif pressed & bit and contacts.sign[k] * a[contacts.row[k]] > 0.0:
            return k
    return -1


@inlined
def _closing_there(touching, z, contacts):
    """Return the contacts with others that close at their stops, which z tells to a few units.

    They have just bounced, off one that pushes them back: the time until then would be rounding.
    """
    size, (_, least, _) = 0.0, sizes_of(z)
    for i in range(z.shape[0] // 2):
        size = max(size, abs(z[i]))
    for k in range(contacts.bounce.shape[0]):
        near = THERE * max(size, abs(contacts.gap[k]))
        if abs(distance(k, z, contacts)) <= near and approach_speed(k, z, contacts) > least:
            touching |= rigid_of(contact_bit(k), contacts)
    return touching


@inlined
def _struck_with(first, closing, contacts):
    """Return a contact with all that close or rest at their stops and that it, or those, push."""
    struck, before = contact_bit(first), np.uint64(0)
    while struck != before and contacts.oblique.shape[0] > 0:
        before = struck
        for j in range(contacts.row.shape[0]):
            for k in range(contacts.row.shape[0]):
                if before & contact_bit(k) and contacts.oblique[j, k] != 0.0:
                    struck |= closing & contact_bit(j)
    return struck


@kernel
def collide(tau, past, key, z, amplitude, wanted, tangent, shared):
    """Let the rigid contacts that have closed bounce, in state z, and rest.

    Parameters
    ----------
    tau : float
    past, key : uint64
        Contacts past their stops before, and the set with all that are now at theirs.
    z : ndarray, shape (2R,)
    amplitude, wanted
    tangent : ndarray, shape (2R, m), or None
        Multiplied by the saltation matrices, each of the first contact of those that push another.
    shared : Shared

    Returns
    -------
    uint64
        Set of the motion.
    """
    model, pairs, series = shared.model, shared.work.forcing, shared.work.step.series
    contacts, tally, n = model.contacts, shared.tally, z.shape[0] // 2
    m = contacts.row.shape[0]
    touching, released = rigid_of(key, contacts), rigid_of(past & ~key, contacts)
    if touching & ~past == np.uint64(0):
        put_at_rest(released, z, contacts, local_vector(m))
        return key
    key, told = key & ~touching | past & touching, wanted & IMPACT != 0
    speeds, values, a = local_vector(m), local_vector(m), local_vector(series.field.shape[1])
    before, rates, together = local_vector(n), local_vector(n), False
    rested = np.uint64(0)
    for _ in range(MOST):
        touching = _closing_there(touching, z, contacts)
        first, closing, (_, least, _) = -1, rigid_of(key, contacts), sizes_of(z)
        for k in range(m - 1, -1, -1):
            speeds[k] = approach_speed(k, z, contacts)
            if touching & contact_bit(k) and speeds[k] > least:
                first, closing = k, closing | contact_bit(k)
        if first < 0:
            if touching != rested:
                key = rest_of(tau, key, touching, z, amplitude, shared, told)
            return key
        if tangent is not None:
            forcing_at(tau, amplitude, model, pairs, 0)
            accelerations(key, z, pairs, model, series, a)
            copy_state(a[:n], rates)
        copy_state(z[n:], before)
        pull, struck = 0.0, _struck_with(first, closing, contacts)
        together = together or struck != contact_bit(first)
        take_out(struck, True, contacts, z[n:], values)
        for k in range(m):
            pull = min(pull, values[k])
        if pull < 0.0:
            copy_state(before, z[n:])
            struck = contact_bit(first)
            take_out(struck, True, contacts, z[n:], values)
        if wanted != NO_TALLY:
            tally.contact[0] |= struck
        if told:
            _tell(values, speeds, together, z, model, tally)
        key, rested = rest_of(tau, key, touching, z, amplitude, shared, told), touching
        if tangent is not None:
            accelerations(key, z, pairs, model, series, a)
            take_out(struck, True, contacts, rates, values)
            take_out(rigid_of(key, contacts), False, contacts, rates, values)
            for i in range(n):
                rates[i] = a[i] - rates[i]
                before[i] = z[n + i] - before[i]
            _change(first, speeds[first], struck, key, before, rates, contacts, tangent)
    return key


@inlined
def _change(first, speed, struck, key, jump, rates, contacts, tangent):
    """Multiply `tangent` by the saltation matrix of an impact, in place."""
    n, values = tangent.shape[0] // 2, local_vector(contacts.row.shape[0])
    for c in range(tangent.shape[1]):
        share = contacts.sign[first] * tangent[contacts.row[first], c] / speed
        take_out(struck, True, contacts, tangent[n:, c], values)
        for i in range(n):
            tangent[i, c] += share * jump[i]
            tangent[n + i, c] += share * rates[i]
    hold(key, contacts, tangent)


@kernel
def hold(key, contacts, tangent):
    """Take from `tangent` what the contacts that rest in a set do not let move."""
    n, resting = tangent.shape[0] // 2, rigid_of(key, contacts)
    values = local_vector(contacts.row.shape[0])
    for c in range(tangent.shape[1] if resting != np.uint64(0) else 0):
        take_out(resting, False, contacts, tangent[:n, c], values)
        take_out(resting, False, contacts, tangent[n:, c], values)
