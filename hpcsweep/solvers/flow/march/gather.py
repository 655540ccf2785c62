r"""Gather what is requested along a linear segment and the passage at its end.

Peaks of absolute accelerations in a passage in closed form
-----------------------------------------------------------

Before its stop the force of a contact pulls, by r(x) <= 0.2785 beta / rho more than the linear
motion of a segment knows (`crossing`), and beyond it what is less than the linear spring is still
of one sign: only before the stop, and along e, the acceleration may exceed what the segments on
either side reach. With a and j of the row at the stop without the contact, a + |j| T + r bounds it,
T the time in the layer. Where that is above the peak the passage is integrated once more, on a copy
of the state, and observed (`layer`); elsewhere nothing is done. The motion itself is not touched.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, local_matrix, local_vector
from hpcsweep.model.observed import (
    ACCELERATION,
    ANY_PEAK,
    DRIFT,
    ENERGY,
    IMPACT,
    ROWS,
    WITHIN_PASSAGES,
)
from hpcsweep.solvers.flow.guard.elements import drifts_stay
from hpcsweep.solvers.flow.guard.extremum import SAME_PEAK
from hpcsweep.solvers.flow.layer.passage.passage import passage_at_end
from hpcsweep.solvers.flow.layer.passage.tangent import passage_tangent, speeds_of_passage
from hpcsweep.solvers.flow.layer.visit import Interval, visit_layer
from hpcsweep.solvers.flow.observe.energies import energies_on_segment
from hpcsweep.solvers.flow.observe.impacts import (
    impacts_on_segment,
    record_passing,
)
from hpcsweep.solvers.flow.observe.modal_norm import modal_norm_on_segment
from hpcsweep.solvers.flow.observe.peaks import drift_on_segment, peaks_on_segment
from hpcsweep.solvers.flow.observe.rows import rows_on_segment
from hpcsweep.solvers.flow.state.shared import NO_TALLY, wants_norms
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state, distance
from hpcsweep.solvers.flow.state.tables import OF_ACCELERATIONS
from hpcsweep.solvers.flow.step.polynomials import value_and_slope
from hpcsweep.solvers.flow.step.step import state_at, step_tangent
from hpcsweep.solvers.outcome import COMPLETE

MAX_PULL = 0.2785
"""Largest y / (1 + exp(y)), rounded up."""
BEYOND = 1.2
"""Part of T for which the passage is followed from the stop on."""
MAX_VISITS = 100
STEPS = 10_000


@inlined
def peaks_at_end(segment, ending, z, amplitude, wanted, packed, shared):
    """Raise the peaks that are wanted, `WITHIN_PASSAGES`, over that at the end of a segment."""
    model, step, outputs, tally = shared.model, shared.work.step, shared.outputs, shared.tally
    if not (ending.passed and model.rho < math.inf):
        return
    if wanted != ACCELERATION or _may_exceed(segment, ending, model, outputs, tally, step.rows):
        _integrate_again(segment, ending, amplitude, wanted, packed, shared)
        copy_state(z, step.z_end)


@inlined
def _time_in_layer(segment, ending, model, rows):
    """Return T and the velocity of the contact's row."""
    row = model.contacts.row[ending.contact]
    _, v = value_and_slope(rows, row, segment.h, ending.span)
    return model.layer / abs(v) if v != 0.0 else segment.h, v


@inlined
def _may_exceed(segment, ending, model, outputs, tally, rows):
    """Return whether the acceleration of a floor may exceed its peak before the stop."""
    contacts, k = model.contacts, ending.contact
    time, v = _time_in_layer(segment, ending, model, rows)
    touches = segment.key & contact_bit(k) != 0
    pull = MAX_PULL * contacts.beta[k] / model.rho
    for i in range(model.ground.shape[0]):
        e = contacts.kick[k, i]
        if e == 0.0:
            continue
        at = i + i // LANES * LANES
        a, jerk = outputs.end[at], outputs.end[at + LANES]
        if touches:
            jerk += contacts.beta[k] * contacts.sign[k] * v * e
        along = a if e > 0.0 else -a
        peak = tally.peaks[outputs.first[OF_ACCELERATIONS] + i]
        if along + abs(jerk) * time + pull * abs(e) > peak * (1.0 + SAME_PEAK):
            return True
    return False


@kernel
def _integrate_again(segment, ending, amplitude, wanted, packed, shared):
    """Integrate a passage through its layer, on a copy of the state, and observe it."""
    model, work, k = shared.model, shared.work, ending.contact
    z, pairs = local_vector(work.step.z_end.shape[0]), local_vector(work.forcing.shape[0])
    nothing = local_matrix(z.shape[0], 0)
    time, _ = _time_in_layer(segment, ending, model, work.step.rows)
    copy_state(work.forcing, pairs)
    s = ending.span
    for _ in range(10):
        s = max(s - time, 0.0)
        state_at(segment, s, shared.tables, work.step, z)
        if s == 0.0 or abs(distance(k, z, model.contacts)) > model.layer:
            break
    tau = segment.tau + s
    end = min(segment.tau + ending.span + BEYOND * time, segment.end)
    for _ in range(MAX_VISITS):
        if not tau < end:
            break
        interval = Interval(tau, end, STEPS)
        tau, outcome, _ = visit_layer(packed, interval, z, amplitude, wanted, nothing)
        if outcome != COMPLETE:
            break
    copy_state(pairs, work.forcing)


@inlined
def segment_tangent(segment, ending, shared, tangent):
    """Multiply `tangent` by the tangent map of a segment and of the passage at its end."""
    if tangent is None or tangent.shape[1] == 0:
        return
    model, work, contact = shared.model, shared.work, ending.contact
    is_kicked = ending.passed and model.rho < math.inf
    if is_kicked:
        passage = speeds_of_passage(contact, work.step.z_end, work.step.a, ending.jerk, model)
    step_tangent(segment, ending.span, 1, tangent, model, shared.tables, work.step.spectral)
    if is_kicked:
        passage_tangent(contact, segment.key ^ contact_bit(contact), passage, model, tangent)


@inlined
def gather(segment, past, span, whole, amplitude, wanted, elements, measures, shared):
    """Update what is wanted by the first `span` of a step, to ``work.step.z_end``.

    Parameters
    ----------
    segment : Segment
    past : uint64
        Contacts past their stops along it.
    span : float
    whole : float
        Length of the step, as it was before a guard ended it.
    amplitude, wanted, elements, measures, shared
        As of `interval.march_interval`.
    """
    if wanted == NO_TALLY:
        return
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    step = work.step
    tally.contact[0] |= past
    if measures is None or wanted & DRIFT == 0:  # see `observe.peaks.largest_of_storeys`
        drift_on_segment(segment, span, model, tables, tally, step)
    if measures is not None:
        peaks = wanted & ANY_PEAK
        if elements is not None and drifts_stay(
            whole, model.elements, tally.peaks, work.proof.ends
        ):
            peaks &= ~DRIFT
        if peaks != 0:
            peaks_on_segment(
                segment, span, amplitude, peaks, model, tables, shared.outputs, tally, step
            )
        if wanted & IMPACT:
            impacts_on_segment(segment, past, span, model, tables, tally, step)
        if wanted & ROWS:
            rows_on_segment(segment, span, model, tables, shared.asked, step)
        if elements is not None and wanted & ENERGY:
            energies_on_segment(segment, span, tables, tally, step)
    if wants_norms(wanted) and past == np.uint64(0):
        modal_norm_on_segment(segment, span, model, tables, tally, step)


@inlined
def gather_passing(
    segment, ending, passing, before, z, amplitude, wanted, elements, packed, shared
):
    """Update impacts and peaks by the contacts that pass their stops at the end of a segment.

    Parameters
    ----------
    passing, before : uint64
        Those, and the contacts past their stops along the segment.
    z : ndarray, shape (2R,)
        As `Ending` has it; the state after the passage is in ``work.step.z_end``.
    """
    model, work, tally = shared.model, shared.work, shared.tally
    if wanted & IMPACT:
        if model.layer == 0.0:
            record_passing(passing, before, model, tally, work.step.z_end)
        elif elements is None and ending.passed:
            passage_at_end(segment, ending, model, tally, work.step)
    if elements is None and wanted & WITHIN_PASSAGES:
        peaks_at_end(segment, ending, z, amplitude, wanted & WITHIN_PASSAGES, packed, shared)
