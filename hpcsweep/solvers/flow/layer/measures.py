"""Observe a step inside a layer (`linear.step`): contact set, drift, norms and other measures."""

import math

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, VECTOR, entry_point, type_of
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, modulus, root, total
from hpcsweep.model.kernel_model import ACCELERATION, DRIFT
from hpcsweep.solvers.flow.layer.acceleration import accelerations_in_layer, may_be_higher
from hpcsweep.solvers.flow.layer.impacts import MISSED, impacts_in_layer, may_change
from hpcsweep.solvers.flow.layer.scheme import accelerations_at_stages, allowed_error
from hpcsweep.solvers.flow.layer.solitary.plan import solitary_contact
from hpcsweep.solvers.flow.layer.solitary.step import (
    integral_of_force,
    motion_in_halves,
    second_half,
)
from hpcsweep.solvers.flow.linear.forcing import forcing_at, total_forcing
from hpcsweep.solvers.flow.linear.step import begin_layer_step, layer_segment
from hpcsweep.solvers.flow.observe.drift import Peak, drift_on_segment, raise_row
from hpcsweep.solvers.flow.observe.modal_norm import TINY
from hpcsweep.solvers.flow.observe.peaks import DISPLACEMENTS, displacements_on_segment
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, WEIGHTS
from hpcsweep.solvers.flow.state.shared import IMPACTS, MAXIMA, NORMS, read_shared, wants_norms
from hpcsweep.solvers.flow.state.state import (
    accelerations,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
)
from hpcsweep.solvers.flow.state.tables import ZERO
from hpcsweep.solvers.measures import FORCE

STEP = type_of((0.0, 0.0, 0.0, 0.0, 0.0))
COLLOCATED, SOLITARY, FORCE_KNOWN = range(3)
"""Kinds of steps, the last a solitary one whose contact's force has been added."""
FIRST_HALF, SECOND_HALF, WHOLE = range(3)
"""Parts of a step: two halves of a solitary one, or the whole of a collocated one."""


@inlined
def observe_layer_step(segment, z0, wanted, shared):
    """Update maxima and norms by a step inside a layer, from z0 to ``work.z_end``.

    It becomes the present step (`linear.step`); ``work.a`` and ``work.a_end`` hold the
    accelerations at the ends.
    """
    model, tally, work = shared.model, shared.tally, shared.work
    n, stage, h = model.stiffness.shape[0], work.layer, segment.h
    copy_state(z0, work.x)
    begin_layer_step(h, work)
    touching = False
    if wanted & (MAXIMA | NORMS):
        touching = _note_contacts(segment, shared)
        if wanted & DRIFT == 0:
            drift_on_segment(segment, h, model, shared.tables, tally, work)
    if wants_norms(wanted):
        modes = tally.modal.shape[0]
        share = _free_share(h, work.x, work.z_end, model.contacts) if touching else 1.0
        if share > 0.0:
            tally.free_time[0] += share * h
            q = work.modal_nodes
            transform = model.modal_transform
            for j in range(modes):
                combine(q, j * LANES, ZERO, 0, 1.0, stage.u, 0, N_STAGES, transform, j * n, modes)
            square = load(q, 0) * load(q, 0) + TINY
            for j in range(1, modes):
                square = fma(load(q, j * LANES), load(q, j * LANES), square)
            weight = load(WEIGHTS, 0) / root(square)
            for j in range(modes):
                tally.modal[j] += share * h * total(weight * modulus(load(q, j * LANES)))


@inlined
def _note_contacts(segment, shared):
    """Update the contact set by the present step; return whether one is closed at an end."""
    model, work, tally = shared.model, shared.work, shared.tally
    contacts, highest, touching = model.contacts, work.layer.highest, False
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if distance(k, work.x, contacts) >= 0.0 or distance(k, work.z_end, contacts) >= 0.0:
            tally.contact[0] |= bit
            touching = True
        elif tally.contact[0] & bit == np.uint64(0):
            i, _, side, _ = model.watched[shared.outputs.first_contact + k]
            row, h = (i, -1, side, contacts.gap[k]), segment.h
            highest[0] = 0.0
            peak = Peak(highest, 0, -math.inf)
            if raise_row(row, peak, segment, h, shared.tables, work) >= 0.0:
                tally.contact[0] |= bit
    return touching


@kernel
def _free_share(h, z0, z1, contacts):
    """Return the share of a step without contact, where a contact closes or opens in it."""
    share = 1.0
    for k in range(contacts.row.shape[0]):
        x0, x1 = distance(k, z0, contacts), distance(k, z1, contacts)
        if x0 >= 0.0 and x1 >= 0.0:
            return 0.0
        if (x0 < 0.0) != (x1 < 0.0):
            v0, v1 = h * approach_speed(k, z0, contacts), h * approach_speed(k, z1, contacts)
            part = _crossing(x0, v0, x1, v1)
            share = min(share, part if x0 < 0.0 else 1.0 - part)
    return share


@kernel
def _crossing(x0, v0, x1, v1):
    """Return where a distance crosses 0 on [0, 1], from values and slopes at both ends (cubic)."""
    bend, third = 3.0 * (x1 - x0) - 2.0 * v0 - v1, 2.0 * (x0 - x1) + v0 + v1
    low, high, s = 0.0, 1.0, x0 / (x0 - x1)
    for _ in range(4):
        value = x0 + s * (v0 + s * (bend + s * third))
        if (value < 0.0) == (x0 < 0.0):
            low = s
        else:
            high = s
        slope = v0 + s * (2.0 * bend + 3.0 * s * third)
        step = s - value / slope if slope != 0.0 else low
        s = step if low <= step <= high else 0.5 * (low + high)
    return s


@entry_point(INT, BYTES, STEP, VECTOR, INT, INT, inner=True, specialises=True)
def _measure_by_parts(packed, step, z0, wanted, kind):
    """Update peaks and impacts by the present step; arguments of `measure_layer_step`."""
    shared = read_shared(packed)
    z0 = as_long_as(z0, shared.previous)
    model, work = shared.model, shared.work
    tau, h, amplitude, before, after = step
    ground, contact = after, -1
    if kind != COLLOCATED:
        contact = solitary_contact(z0, model)
    alone = contact if kind == FORCE_KNOWN else -1
    pairs, between = work.x[z0.shape[0] :], work.layer.between
    # every function at one place, where it becomes part of this kernel
    for part in range(WHOLE if kind == COLLOCATED else FIRST_HALF, WHOLE + (kind == COLLOCATED)):
        if part == FIRST_HALF:
            motion_in_halves(contact, tau, h, amplitude, z0, packed, shared)
            h *= 0.5
            for row in range(between.shape[0]):
                between[row], work.z_end[row] = work.z_end[row], between[row]
        elif part == SECOND_HALF:
            second_half(work.layer)
            copy_state(work.a_end, work.a)
            tau, before, ground = tau + h, ground, after
            copy_state(work.z_end, work.x)
            copy_state(between, work.z_end)
        if part != WHOLE:
            accelerations_at_stages(tau, h, work.x, amplitude, pairs, model, work)
            if part == FIRST_HALF:
                forcing_at(tau + h, amplitude, model, pairs, 0)
                ground = total_forcing(pairs, 0, model)
            accelerations(ground, work.z_end, model, work.a_end)
            begin_layer_step(h, work)
            for k in range(work.layer.missed.shape[0]):
                work.layer.missed[k] = math.inf if k == contact and alone < 0 else 0.0
        segment = layer_segment(tau, h)
        if wanted & DISPLACEMENTS:
            displacements_on_segment(segment, h, wanted, False, shared)
        if wanted & ACCELERATION:
            accelerations_in_layer(segment, amplitude, before, ground, shared)
        if wanted & IMPACTS:
            impacts_in_layer(segment, alone, shared)
    return 0


@entry_point(INT, BYTES, STEP, VECTOR, INT, INT, inner=True, specialises=True, on_demand=True)
def measure_layer_step(packed, step, z0, wanted, kind):
    """Update peaks and impacts by the present step, inside a layer and from z0; return 0.

    Most steps can raise no peak, and open or close no contact, which this small kernel tells:
    `_measure_by_parts` takes 0.13 us only to begin.

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
    tau, h, _, before, after = step
    segment, alone, changes = layer_segment(tau, h), -1, False
    if wanted & DISPLACEMENTS:
        changes = displacements_on_segment(segment, h, wanted, True, shared)
    if wanted & ACCELERATION and not changes:
        changes = may_be_higher(before, after, shared.outputs.first, model, tally, work)
    if wanted & IMPACTS:
        if kind == SOLITARY:
            alone, z1 = solitary_contact(z0, model), work.z_end
            integral, missed = integral_of_force(alone, h, z0, z1, model.rho, model, work)
            if missed <= allowed_error(z1, MISSED):
                tally.impacts[FORCE, alone] += integral
                kind = FORCE_KNOWN
        changes = changes or kind == SOLITARY
        for k in range(model.contacts.row.shape[0]):
            changes = changes or may_change(k, h, model.contacts, tally, work)
        if not changes:
            impacts_in_layer(segment, alone, shared)
    return _measure_by_parts(packed, step, z0, wanted, kind) if changes else 0
