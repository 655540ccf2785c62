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
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.kernel_model import ACCELERATION, DRIFT
from hpcsweep.solvers.flow.layer.visit import Interval, visit_layer
from hpcsweep.solvers.flow.linear.polynomials import value_and_slope
from hpcsweep.solvers.flow.linear.propagators import table_of
from hpcsweep.solvers.flow.linear.spectral import step_state
from hpcsweep.solvers.flow.observe.drift import SAME_PEAK, drift_on_segment
from hpcsweep.solvers.flow.observe.impacts import impacts_at_end, impacts_on_segment
from hpcsweep.solvers.flow.observe.modal_norm import modal_norm_on_segment
from hpcsweep.solvers.flow.observe.peaks import peaks_on_segment
from hpcsweep.solvers.flow.passage.passage import FAST, INTEGRATED, SLOW, Arrival
from hpcsweep.solvers.flow.passage.slow_passage import half_tangent
from hpcsweep.solvers.flow.passage.tangent import linear_tangent, passage_tangent
from hpcsweep.solvers.flow.state.shared import IMPACTS, PEAKS, wants_norms
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state, distance
from hpcsweep.solvers.outcome import COMPLETE

MAX_PULL = 0.2785
"""Largest y / (1 + exp(y)), rounded up."""
BEYOND = 1.2
"""Part of T for which the passage is followed from the stop on."""
MAX_VISITS = 100
STEPS = 10_000


@inlined
def accelerations_at_end(segment, ending, z, amplitude, packed, shared):
    """Raise the peaks of absolute accelerations over the passage at the end of a segment."""
    closed_form = ending.how != INTEGRATED and shared.model.rho < math.inf
    if closed_form and _may_exceed(segment, ending, shared):
        _integrate_again(segment, ending, amplitude, packed, shared)
        copy_state(z, shared.work.z_end)


@inlined
def _time_in_layer(segment, ending, model, work):
    """Return T and the velocity of the contact's row."""
    row = model.contacts.row[ending.contact]
    _, v = value_and_slope(work.rows, row, segment.h, ending.span)
    return model.layer / abs(v) if v != 0.0 else segment.h, v


@inlined
def _may_exceed(segment, ending, shared):
    """Return whether the acceleration of a floor may exceed its peak before the stop."""
    model, outputs, tally = shared.model, shared.outputs, shared.tally
    contacts, k = model.contacts, ending.contact
    time, v = _time_in_layer(segment, ending, model, shared.work)
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
        if along + abs(jerk) * time + pull * abs(e) > tally.peaks[outputs.first + i] * (
            1.0 + SAME_PEAK
        ):
            return True
    return False


@kernel
def _integrate_again(segment, ending, amplitude, packed, shared):
    """Integrate a passage through its layer, on a copy of the state, and observe it."""
    model, work, outputs = shared.model, shared.work, shared.outputs
    z, k = work.moved, ending.contact
    time, _ = _time_in_layer(segment, ending, model, work)
    copy_state(work.forcing, outputs.pairs)
    s = ending.span
    for _ in range(10):
        s = max(s - time, 0.0)
        step_state(segment, s, shared.tables, work, z)
        if s == 0.0 or abs(distance(k, z, model.contacts)) > model.layer:
            break
    tau = segment.tau + s
    end = min(segment.tau + ending.span + BEYOND * time, segment.end)
    for _ in range(MAX_VISITS):
        if not tau < end:
            break
        interval = Interval(tau, end, STEPS)
        tau, outcome, _ = visit_layer(
            packed, interval, z, amplitude, ACCELERATION, shared.no_tangent
        )
        if outcome != COMPLETE:
            break
    copy_state(outputs.pairs, work.forcing)


@inlined
def segment_tangent(segment, ending, packed, shared, tangent):
    """Multiply `tangent` by the tangent map of a segment and of the passage at its end."""
    model, tables, work = shared.model, shared.tables, shared.work
    linear_tangent(segment.index, ending.span, tangent, shared)
    if ending.how == FAST:
        z = work.z_end
        contact = ending.contact
        z[model.contacts.row[contact]] = model.contacts.sign[contact] * model.contacts.gap[contact]
        arrival = Arrival(
            contact,
            segment.key ^ contact_bit(contact),
            segment.tau + ending.span,
            work.forcing,
        )
        passage_tangent(arrival, z, work.a, ending.jerk, model, work.tangent, tangent)
    elif ending.how != INTEGRATED:
        contact = ending.contact
        half_tangent(-1.0, segment.index, contact, tangent, packed)
        if ending.how == SLOW:
            after = table_of(segment.key ^ contact_bit(contact), tables, packed)
            half_tangent(1.0, after, contact, tangent, packed)


@inlined
def observe_segment(segment, span, wanted, measures, shared):
    """Update contact set, drift and modal norms by a segment of length `span`.

    `measures` as of `period.march_period`.
    """
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    key, index = segment.key, segment.index
    if key != np.uint64(0):
        tally.contact[0] |= key
    if measures is None or wanted & DRIFT == 0:  # see `observe.drift.largest_of_storeys`
        drift_on_segment(segment, span, model, tables, tally, work)
    if wants_norms(wanted) and key == np.uint64(0):
        modal_norm_on_segment(index, work.x, span, model, tables, tally, work)


@inlined
def measure_segment(segment, ending, passing, z, amplitude, wanted, packed, shared):
    """Update peaks and impacts by a segment and the passage of contacts at its end.

    Parameters
    ----------
    passing : uint64
        Contacts, a set, that pass their stops at the end.
    z : ndarray, shape (2R,)
        As `Ending` has it.
    """
    model, work, tally = shared.model, shared.work, shared.tally
    if wanted & PEAKS:
        peaks_on_segment(segment, ending.span, amplitude, wanted, shared)
    if wanted & IMPACTS:
        impacts_on_segment(segment, ending.span, model, shared.tables, tally, work)
        impacts_at_end(segment, ending, passing, model, tally, work)
    if wanted & ACCELERATION:
        accelerations_at_end(segment, ending, z, amplitude, packed, shared)
