"""Observe a step inside a layer (`step.step`): contact set, drift, norms and other measures."""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, entry_point, type_of
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    load,
    local_matrix,
    local_vector,
    maximum,
    modulus,
    root,
    store,
    total,
)
from hpcsweep.model.observed import DRIFT, IMPACT, ROWS
from hpcsweep.solvers.flow.guard.extremum import Peak
from hpcsweep.solvers.flow.layer.impacts import impacts_in_layer, may_change
from hpcsweep.solvers.flow.observe.modal_norm import TINY
from hpcsweep.solvers.flow.observe.peaks import (
    drift_on_segment,
    peaks_in_layer,
    peaks_may_rise,
    raise_row,
)
from hpcsweep.solvers.flow.observe.rows import rows_on_segment
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, WEIGHTS
from hpcsweep.solvers.flow.state.shared import MAXIMA, NORMS, read_shared, wants_norms
from hpcsweep.solvers.flow.state.state import (
    approach_speed,
    contact_bit,
    copy_state,
    distance,
)
from hpcsweep.solvers.flow.state.tables import OF_CONTACTS, ZERO
from hpcsweep.solvers.flow.step.polynomials import evaluate
from hpcsweep.solvers.flow.step.step import begin_layer_step, expand, layer_segment

PIECES = 4
"""Of a step on which a mode changes its sign, or a contact closes or opens."""
STEP = type_of((0.0, 0.0, 0.0, 0.0, 0.0))


@inlined
def observe_layer_step(segment, z0, wanted, shared):
    """Update maxima and norms by a step inside a layer, from z0 to ``work.step.z_end``.

    It becomes the present step (`step.step`); ``work.step.a`` and ``work.step.a_end`` hold the
    accelerations at the ends.
    """
    model, tally, work = shared.model, shared.tally, shared.work
    n, stage, h = model.stiffness.shape[0], work.step.layer, segment.h
    copy_state(z0, work.step.x)
    begin_layer_step(h, work.step)
    touching = False
    if wanted & (MAXIMA | NORMS):
        touching = _note_contacts(segment, shared)
        if wanted & DRIFT == 0:
            drift_on_segment(segment, h, model, shared.tables, tally, work.step)
    if wants_norms(wanted):
        begin, end = 0.0, 1.0
        if touching:
            begin, end = _free_part(h, work.step.x, work.step.z_end, model.contacts)
        if end > begin:
            time, whole, between = (end - begin) * h, end - begin == 1.0, local_matrix(n, LANES)
            tally.free_time[0] += time
            if not (whole and _add_norms(stage.u, time, model, tally, True)):
                for row in range(n):
                    expand(row, segment, shared.tables, work.step)
                for piece in range(PIECES):
                    width = 2.0 * (end - begin) / PIECES
                    sigma = fma(load(NODES, 0), width, 2.0 * begin - 1.0 + piece * width)
                    for row in range(n):
                        store(between, row * LANES, evaluate(work.step.rows[row], sigma))
                    _add_norms(between, time / PIECES, model, tally, False)


@kernel
def _add_norms(u, time, model, tally, whole):
    """Add the norms of modes with displacements u at the nodes; return whether that is done.

    Not if one changes its sign on a step, `whole`; of a part of one they are added anyway.
    """
    n, modes, transform = model.stiffness.shape[0], tally.modal.shape[0], model.modal_transform
    q = local_vector(modes * LANES)
    for j in range(modes):
        combine(q, j * LANES, ZERO, 0, 1.0, u, 0, N_STAGES, transform, j * n, modes)
        values = load(q, j * LANES)
        if whole and maximum(values) > 0.0 and maximum(0.0 - values) > 0.0:
            return False
    square = load(q, 0) * load(q, 0) + TINY
    for j in range(1, modes):
        square = fma(load(q, j * LANES), load(q, j * LANES), square)
    weight = load(WEIGHTS, 0) / root(square)
    for j in range(modes):
        tally.modal[j] += time * total(weight * modulus(load(q, j * LANES)))
    return True


@inlined
def _note_contacts(segment, shared):
    """Update the contact set by the present step; return whether one is closed at an end."""
    model, work, tally = shared.model, shared.work, shared.tally
    contacts, highest, touching = model.contacts, local_vector(1), False
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if (
            distance(k, work.step.x, contacts) >= 0.0
            or distance(k, work.step.z_end, contacts) >= 0.0
        ):
            tally.contact[0] |= bit
            touching = True
        elif tally.contact[0] & bit == np.uint64(0):
            i, _, side, _ = model.watched[shared.outputs.first[OF_CONTACTS] + k]
            row, h = (i, -1, side, contacts.gap[k]), segment.h
            highest[0] = 0.0
            peak = Peak(highest, 0, -math.inf)
            if raise_row(row, peak, segment, h, shared.tables, work.step) >= 0.0:
                tally.contact[0] |= bit
    return touching


@kernel
def _free_part(h, z0, z1, contacts):
    """Return from where to where, on [0, 1], a step is without contact, which may end or begin."""
    begin, end = 0.0, 1.0
    for k in range(contacts.row.shape[0]):
        x0, x1 = distance(k, z0, contacts), distance(k, z1, contacts)
        if x0 >= 0.0 and x1 >= 0.0:
            return 0.0, 0.0
        if (x0 < 0.0) != (x1 < 0.0):
            v0, v1 = h * approach_speed(k, z0, contacts), h * approach_speed(k, z1, contacts)
            part = _crossing(x0, v0, x1, v1)
            begin, end = (begin, min(end, part)) if x0 < 0.0 else (max(begin, part), end)
    return begin, end


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


@entry_point(INT, BYTES, STEP, INT, inner=True, specialises=True)
def _measure_changes(packed, step, wanted):
    """Update peaks and impacts by the present step; arguments of `measure_layer_step`."""
    shared = read_shared(packed)
    tau, h, amplitude, before, after = step
    segment = layer_segment(tau, h)
    peaks_in_layer(segment, amplitude, before, after, wanted, shared)
    if wanted & IMPACT:
        impacts_in_layer(segment, shared)
    return 0


@entry_point(INT, BYTES, STEP, INT, inner=True, specialises=True, on_demand=True)
def measure_layer_step(packed, step, wanted):
    """Update peaks and impacts by the present step, inside a layer; return 0.

    Most steps can raise no peak, and open or close no contact, which this small kernel tells:
    `_measure_changes` takes 0.13 us only to begin.

    Parameters
    ----------
    packed : ndarray of bytes
        A packed `Shared`; the present step has the accelerations at both ends.
    step : tuple of float
        Its start, its length, A, and the forcing at both ends.
    wanted : int
        See `tally`.
    """
    shared = read_shared(packed)
    model, tally, work = shared.model, shared.tally, shared.work
    tau, h, _, before, after = step
    segment = layer_segment(tau, h)
    changes = peaks_may_rise(segment, before, after, wanted, shared)
    if wanted & ROWS:
        rows_on_segment(segment, h, model, shared.tables, shared.asked, work.step)
    if wanted & IMPACT:
        for k in range(model.contacts.row.shape[0]):
            changes = changes or may_change(k, h, model.contacts, tally, work)
        if not changes:
            impacts_in_layer(segment, shared)
    return _measure_changes(packed, step, wanted) if changes else 0
