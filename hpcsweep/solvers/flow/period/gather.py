"""Gather what is requested along a linear segment and the passage at its end."""

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.model.kernel_model import ACCELERATION, DRIFT
from hpcsweep.solvers.flow.linear.propagators import table_of
from hpcsweep.solvers.flow.observe.drift import drift_on_segment
from hpcsweep.solvers.flow.observe.impacts import impacts_at_end, impacts_on_segment
from hpcsweep.solvers.flow.observe.modal_norm import modal_norm_on_segment
from hpcsweep.solvers.flow.observe.peaks import peaks_on_segment
from hpcsweep.solvers.flow.passage.apart import Arrival
from hpcsweep.solvers.flow.passage.passage import FAST, INTEGRATED, SLOW
from hpcsweep.solvers.flow.passage.slow_tangent import half_tangent
from hpcsweep.solvers.flow.passage.tangent import linear_tangent, passage_tangent
from hpcsweep.solvers.flow.period.accelerations import accelerations_at_end
from hpcsweep.solvers.flow.state.contacts import contact_bit
from hpcsweep.solvers.flow.state.tally import IMPACTS, PEAKS, wants_norms


@inlined
def segment_tangent(segment, ending, packed, shared, tangent):
    """Multiply `tangent` by the tangent map of a segment and of the passage at its end."""
    model, tables, work = shared.model, shared.tables, shared.work
    linear_tangent(tables, segment.index, ending.span, tangent, work.tangent)
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
        drift_on_segment(index, work.x, work.z_end, span, model, tables, tally, work)
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
