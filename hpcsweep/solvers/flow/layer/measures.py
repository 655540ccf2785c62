"""Gather the requested measures over a step inside a layer, from its stages (dense output)."""

import math

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.compile.entry_points import BYTES, INT, VECTOR, entry_point, type_of
from hpcsweep.kernels.simd.vectors import LANES, load
from hpcsweep.model.kernel_model import ACCELERATION
from hpcsweep.solvers.flow.layer.acceleration import accelerations_in_layer, may_be_higher
from hpcsweep.solvers.flow.layer.impacts import (
    impacts_in_layer,
    impacts_without_change,
    missed_force,
)
from hpcsweep.solvers.flow.layer.observation import (
    displacements_in_layer,
    keeps_sign,
    longest_ways,
    range_of,
    stays,
)
from hpcsweep.solvers.flow.layer.scheme import accelerations_at_stages
from hpcsweep.solvers.flow.layer.solitary.plan import solitary_contact
from hpcsweep.solvers.flow.layer.solitary.step import (
    integral_of_force,
    motion_in_halves,
    second_half,
)
from hpcsweep.solvers.flow.linear.forcing import forcing_at, total_forcing
from hpcsweep.solvers.flow.observe.impacts import note_apart
from hpcsweep.solvers.flow.state.shared import IMPACTS, PEAKS, read_shared
from hpcsweep.solvers.flow.state.state import accelerations, contact_bit, copy_state, distance
from hpcsweep.solvers.measures import FORCE, TIME

STEP = type_of((0.0, 0.0, 0.0, 0.0, 0.0))
DISPLACEMENTS = PEAKS & ~ACCELERATION
COLLOCATED, SOLITARY, FORCE_KNOWN = range(3)
"""Kinds of steps, the last a solitary one whose contact's force has been added."""
FIRST_HALF, SECOND_HALF, WHOLE = range(3)
"""Parts of a step: two halves of a solitary one, or the whole of a collocated one."""


@entry_point(INT, BYTES, STEP, VECTOR, INT, INT, inner=True, specialises=True)
def _measure_by_parts(packed, step, z0, wanted, kind):
    """Update peaks and impacts by one step; arguments of `measure_layer_step`."""
    shared = read_shared(packed)
    z0 = as_long_as(z0, shared.previous)
    model, tally, work = shared.model, shared.tally, shared.work
    tau, h, amplitude, before, after = step
    ground, contact = 0.0, -1
    if kind != COLLOCATED:
        contact = solitary_contact(z0, model)
    alone = contact if kind == FORCE_KNOWN else -1
    pairs, between = work.x[z0.shape[0] :], work.layer.between
    start, end = z0, work.z_end
    # every function at one place, where it becomes part of this kernel
    for part in range(WHOLE if kind == COLLOCATED else FIRST_HALF, WHOLE + (kind == COLLOCATED)):
        if part == FIRST_HALF:
            motion_in_halves(contact, tau, h, amplitude, z0, packed, shared)
            h *= 0.5
            end = between
        elif part == SECOND_HALF:
            second_half(work.layer)
            copy_state(work.a_end, work.a)
            tau, before = tau + h, ground
            start, end = between, work.z_end
        ground = after
        if part != WHOLE:
            accelerations_at_stages(tau, h, start, amplitude, pairs, model, work)
            if part == FIRST_HALF:
                forcing_at(tau + h, amplitude, model, pairs, 0)
                ground = total_forcing(pairs, 0, model)
            accelerations(ground, end, model, work.a_end)
            if wanted & (DISPLACEMENTS | IMPACTS):
                longest_ways(h, start, work)
                for k in range(work.layer.missed.shape[0]):
                    work.layer.missed[k] = math.inf if k == contact and alone < 0 else 0.0
        if wanted & DISPLACEMENTS:
            displacements_in_layer(tau, h, start, end, wanted, False, shared)
        if wanted & ACCELERATION:
            own, first = (tau, h, amplitude, before, ground), shared.outputs.first
            accelerations_in_layer(own, start, end, first, model, tally, work)
        if wanted & IMPACTS:
            impacts_in_layer(h, start, end, alone, model, work.ways, tally, work)
    return 0


@entry_point(INT, BYTES, STEP, VECTOR, INT, INT, inner=True, specialises=True, on_demand=True)
def measure_layer_step(packed, step, z0, wanted, kind):
    """Update peaks and impacts by one step inside a layer, from z0 to ``work.z_end``; return 0.

    Most steps can raise no peak between their ends, and open or close no contact, which this small
    kernel tells: `_measure_by_parts` takes 0.13 us only to begin.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`.
    step : tuple of float
        Its start, its length, A, and the forcing at both ends.
    z0 : ndarray, shape (2R,)
        ``work.a`` and ``work.a_end`` hold the accelerations at both ends.
    wanted : int
        See `tally`.
    kind : int
        `SOLITARY`, or `COLLOCATED`, with its stages in ``work.layer``.
    """
    shared = read_shared(packed)
    z0 = as_long_as(z0, shared.previous)
    model, tally, work = shared.model, shared.tally, shared.work
    h, z1 = step[1], work.z_end
    changes = False
    if wanted & DISPLACEMENTS:
        changes = displacements_in_layer(step[0], h, z0, z1, wanted, True, shared)
    if wanted & ACCELERATION and not changes:
        changes = may_be_higher(step, shared.outputs.first, model, tally, work)
    if wanted & IMPACTS:
        if kind == SOLITARY:
            contact = solitary_contact(z0, model)
            integral, missed = integral_of_force(contact, h, z0, z1, model.rho, model, work)
            if missed <= missed_force(z1):
                tally.impacts[FORCE, contact] += integral
                kind = FORCE_KNOWN
            changes = changes or _may_close(contact, kind, h, z0, z1, model, tally, work)
        else:
            changes = changes or not impacts_without_change(h, z0, z1, model, tally, work)
    return _measure_by_parts(packed, step, z0, wanted, kind) if changes else 0


@inlined
def _may_close(contact, kind, h, z0, z1, model, tally, work):
    """Return whether a step of `solitary` may change more than force and time of its contact.

    If not, the time is added.
    """
    if kind != FORCE_KNOWN:
        return True
    for k in range(model.contacts.row.shape[0]):
        if k != contact and distance(k, z0, model.contacts) >= 0.0:
            return True
    first, last = distance(contact, z0, model.contacts), distance(contact, z1, model.contacts)
    bottom, top = range_of(load(work.solitary.x, 0), first, last)
    bottom, top = range_of(load(work.solitary.x, LANES), bottom, top)
    closed = tally.closed[0] & contact_bit(contact) != np.uint64(0)
    if not closed:
        note_apart(contact, bottom, model.contacts, tally)
    if not stays(closed, bottom, top):
        row, n = model.contacts.row[contact], model.stiffness.shape[0]
        slowest, fastest = range_of(load(work.layer.v, row * LANES), z0[n + row], z1[n + row])
        if (last >= 0.0) != closed or not keeps_sign(slowest, fastest):
            return True
    tally.impacts[TIME, contact] += h if closed else 0.0
    return False
