r"""What is gathered along a linear segment of a motion with dashpots, and where contacts change.

A contact takes the energy int F x' dt less what its spring holds, kappa x^2 / 2. While it pushes
that grows by c int x'^2 dt; once it has let go the spring relaxes by itself, without force, and its
energy is lost to the dashpot: (kappa / 2) times what x^2 falls by.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, total
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.kernel_model import CONTACT, DRIFT
from hpcsweep.solvers.flow.dashpot.contacts import force_polynomial
from hpcsweep.solvers.flow.linear.polynomials import (
    evaluate,
    expand_row,
    integral,
    value_and_slope,
)
from hpcsweep.solvers.flow.observe.drift import (
    drift_on_segment,
    raise_peak,
    raise_to_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.observe.impacts import come_apart, record
from hpcsweep.solvers.flow.observe.modal_norm import modal_norm_on_segment
from hpcsweep.solvers.flow.observe.peaks import peaks_on_segment
from hpcsweep.solvers.flow.state.contacts import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.state.segment import time_of
from hpcsweep.solvers.flow.state.tables import MODAL_NODES, MODAL_WEIGHTS, N_MODAL
from hpcsweep.solvers.flow.state.tally import IMPACTS, PEAKS, wants_norms
from hpcsweep.solvers.measures import DISSIPATED, FORCE, TIME


@inlined
def observe_segment(segment, past, span, amplitude, wanted, shared):
    """Bring the tally up to date with a segment of that length, to ``work.z_end``."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    index = segment.index
    tally.contact[0] |= past
    if wanted & DRIFT == 0:
        drift_on_segment(index, work.x, work.z_end, span, model, tables, tally, work)
    if wanted & PEAKS:
        peaks_with_dashpots(segment, span, amplitude, wanted & PEAKS, shared)
    if wanted & IMPACTS:
        impacts_with_dashpots(segment, past, span, model, tables, tally, work)
    if wants_norms(wanted) and past == np.uint64(0):
        modal_norm_on_segment(index, work.x, span, model, tables, tally, work)


@inlined
def peaks_with_dashpots(segment, span, amplitude, wanted, shared):
    """Raise the peaks that are wanted over a segment; see `peaks.peaks_on_segment`."""
    peaks_on_segment(segment, span, amplitude, wanted & ~CONTACT, shared)
    if wanted & CONTACT:
        _force_peaks(segment, span, shared)


@kernel
def _force_peaks(segment, span, shared):
    """Raise the peaks of the forces, over their units, of the contacts that push."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    rows, h, time = work.drift_rows, segment.h, time_of(segment.tau, model)
    for k in range(model.contacts.row.shape[0]):
        if segment.key & contact_bit(k) == np.uint64(0):
            continue
        w = shared.outputs.first_contact + k
        bound4 = force_polynomial(k, 1.0, segment.index, model, tables, work)
        g0, v0 = value_and_slope(rows, 0, h, 0.0)
        g1, v1 = value_and_slope(rows, 0, h, span)
        ends = (g0, v0, g1, v1)
        at = raise_to_ends(ends, 1, span, w, tally.peaks)
        if row_may_be_higher(tally.peaks[w], 1, span, ends, bound4):
            near = tally.times[w] - time
            found = raise_peak(rows, h, span, ends, bound4, 1, w, near, tally.peaks, work.stack)
            at = found if found >= 0.0 else at
        if at >= 0.0:
            tally.times[w] = time + at


@kernel
def impacts_with_dashpots(segment, past, span, model, tables, tally, work):
    """Add force, time and energy of the contacts past their stops on the first `span` of a step."""
    contacts, index, h = model.contacts, segment.index, segment.h
    n = work.z_end.shape[0] // 2
    tally.closed[0] = past
    tally.beside[0] |= past
    if tally.beside[0] & ~past != np.uint64(0):
        come_apart(segment, past, span, model, tables, tally, work)
    for k in range(contacts.row.shape[0]):
        if past & contact_bit(k) == np.uint64(0):
            continue
        tally.impacts[TIME, k] += span
        spring, dashpot = contacts.edges[k, SPRING], contacts.edges[k, DASHPOT]
        x0, x1 = distance(k, work.x, contacts), distance(k, work.z_end, contacts)
        if segment.key & contact_bit(k) == np.uint64(0):
            tally.impacts[DISSIPATED, k] += 0.5 * spring * (x0 - x1) * (x0 + x1)
            continue
        row = contacts.row[k]
        for i in (row, n + row):
            if not work.expanded[i]:
                expand_row(tables.poly, index, i, work.x, work.rows)
                work.expanded[i] = True
        way = contacts.sign[k] * integral(work.rows, row, h, span) - contacts.gap[k] * span
        tally.impacts[FORCE, k] += spring * way + dashpot * (x1 - x0)
        if dashpot > 0.0:
            tally.impacts[DISSIPATED, k] += dashpot * _square(work.rows[n + row], h, span)


@kernel
def _square(coefficients, h, span):
    """Integrate the square of a polynomial over the first `span` of a step, exactly."""
    found = 0.0
    for first in range(0, N_MODAL, LANES):
        s = 0.5 * span * (load(MODAL_NODES, first) + 1.0)
        value = evaluate(coefficients, fma(s, 2.0 / h, -1.0))
        found += total(load(MODAL_WEIGHTS, first) * value * value)
    return 0.5 * span * found


@inlined
def record_passing(passing, past, model, tally, z):
    """Record the contacts that pass their stops in a state; `past` is as it was before."""
    for k in range(model.contacts.row.shape[0]):
        bit = contact_bit(k)
        if passing & bit:
            closing = past & bit == np.uint64(0)
            record(k, closing, abs(approach_speed(k, z, model.contacts)), z, model, tally)
