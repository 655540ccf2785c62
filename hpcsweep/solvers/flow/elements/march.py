r"""Motions of elements: linear segments from one change of a mode to the next.

A contact takes the energy int F x' dt less what its spring holds, kappa x^2 / 2. While it pushes
that grows by c int x'^2 dt; once it has let go the spring relaxes by itself, without force, and its
energy is lost to the dashpot: (kappa / 2) times what x^2 falls by.
"""

import math

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import LANES, fma, load, total
from hpcsweep.model.elements import ENDS
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.kernel_model import CONTACT, DRIFT
from hpcsweep.solvers.flow.elements.contacts import (
    change_tangent,
    past_stops,
    pushing,
    rest_at_stops,
    set_contacts,
)
from hpcsweep.solvers.flow.elements.guards import (
    change,
    drifts_stay,
    first_change,
    sets_of,
    write_loads,
    write_row,
    write_windows,
)
from hpcsweep.solvers.flow.elements.layers import visit_layers
from hpcsweep.solvers.flow.layer.visit import Interval
from hpcsweep.solvers.flow.linear.forcing import forcing_after, forcing_at, turn_forcing
from hpcsweep.solvers.flow.linear.polynomials import evaluate, integral, value_and_slope
from hpcsweep.solvers.flow.linear.propagators import is_tabled, table_of
from hpcsweep.solvers.flow.linear.series import IN_SERIES, expand_series, sum_series
from hpcsweep.solvers.flow.observe.dense_output import expand
from hpcsweep.solvers.flow.observe.drift import (
    Peak,
    drift_on_segment,
    largest_of_storeys,
    raise_peak,
    raise_to_ends,
    row_may_be_higher,
)
from hpcsweep.solvers.flow.observe.energies import energies_on_segment
from hpcsweep.solvers.flow.observe.impacts import note_closed, record
from hpcsweep.solvers.flow.observe.modal_norm import modal_norm_on_segment
from hpcsweep.solvers.flow.observe.peaks import peaks_on_segment
from hpcsweep.solvers.flow.passage.tangent import coast_on, linear_tangent
from hpcsweep.solvers.flow.search.events import take_step
from hpcsweep.solvers.flow.search.search import UNDECIDED
from hpcsweep.solvers.flow.state.shared import (
    ENERGY,
    IMPACTS,
    LINEAR_STEPS,
    NO_TALLY,
    PASSAGES,
    PEAKS,
    read_shared,
    wants_norms,
)
from hpcsweep.solvers.flow.state.state import (
    NO_TABLE,
    OVERFLOW,
    Segment,
    approach_speed,
    begin_period,
    contact_bit,
    copy_state,
    distance,
    end_period,
    is_ordinary,
    start,
    time_of,
)
from hpcsweep.solvers.flow.state.tables import MODAL_NODES, MODAL_WEIGHTS, N_MODAL, THETA
from hpcsweep.solvers.measures import DISSIPATED, FORCE, TIME
from hpcsweep.solvers.outcome import COLLAPSED, COMPLETE, NON_FINITE, SOLVER_FAILED, STEP_LIMIT


@inlined
def observe_segment(segment, past, span, amplitude, wanted, tangent, shared):
    """Bring tangent and tally up to date with a segment of that length, to ``work.z_end``."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    index = segment.index
    if tangent.shape[1] > 0:
        linear_tangent(index, span, tangent, shared)
    if wanted == NO_TALLY:
        return
    tally.contact[0] |= past
    if wanted & DRIFT == 0:
        drift_on_segment(segment, span, model, tables, tally, work)
    if wanted & PEAKS:
        peaks_of_elements(segment, span, amplitude, wanted & PEAKS, shared)
    if wanted & IMPACTS:
        impacts_of_elements(segment, past, span, model, tables, tally, work)
    if wants_norms(wanted) and past == np.uint64(0):
        modal_norm_on_segment(index, work.x, span, model, tables, tally, work)


@inlined
def measure_segment(segment, past, span, whole, amplitude, wanted, shared):
    """Bring peaks, impacts and energies of a record up to date, likewise.

    The step is the first `span` of the `whole` of which `write_ends` has told.
    """
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    if wanted != NO_TALLY:
        all_peaks_of_elements(segment, span, whole, amplitude, shared)
        impacts_of_elements(segment, past, span, model, tables, tally, work)
    if wanted & ENERGY:
        energies_on_segment(segment, span, model, tables, work, tally)


@inlined
def peaks_of_elements(segment, span, amplitude, wanted, shared):
    """Raise the peaks that are wanted over a segment; see `peaks.peaks_on_segment`."""
    peaks_on_segment(segment, span, amplitude, wanted & ~CONTACT, shared)
    if wanted & CONTACT:
        _force_peaks(segment, span, shared)


@kernel
def all_peaks_of_elements(segment, span, whole, amplitude, shared):
    """Raise all peaks, of a step that is the first `span` of the one of which `write_ends` told."""
    known = drifts_stay(whole, shared.model.elements, shared.tally.peaks, shared.work)
    peaks_of_elements(segment, span, amplitude, PEAKS ^ DRIFT if known else PEAKS, shared)


@kernel
def _force_peaks(segment, span, shared):
    """Raise the peaks of the forces, over their units, of the contacts that push."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    rows, h, time = work.drift_rows, segment.h, time_of(segment.tau, model)
    for k in range(model.contacts.row.shape[0]):
        if segment.key & contact_bit(k) == np.uint64(0):
            continue
        w = shared.outputs.first_contact + k
        edges, row = model.contacts.edges[k], (model.contacts.row[k], -1)
        spring, dashpot = edges[SPRING], edges[DASHPOT]
        law = (edges[0] * spring, edges[0] * dashpot, spring * model.contacts.gap[k])
        bound4 = write_row(row, law, segment, tables, work)
        g0, v0 = value_and_slope(rows, 0, h, 0.0)
        g1, v1 = value_and_slope(rows, 0, h, span)
        ends = (g0, v0, g1, v1)
        peak = Peak(tally.peaks, w, tally.times[w] - time)
        at = raise_to_ends(ends, 1, span, peak)
        if row_may_be_higher(tally.peaks[w], 1, span, ends, bound4):
            found = raise_peak(rows, h, span, ends, bound4, 1, peak, work.stack)
            at = found if found >= 0.0 else at
        if at >= 0.0:
            tally.times[w] = time + at


@kernel
def impacts_of_elements(segment, past, span, model, tables, tally, work):
    """Add force, time and energy of the contacts past their stops on the first `span` of a step."""
    contacts, h, n = model.contacts, segment.h, work.z_end.shape[0] // 2
    note_closed(segment, past, span, model, tables, tally, work)
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
        expand(row, segment, tables, work)
        expand(n + row, segment, tables, work)
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


@inlined
def start_next(segment, place, span, z, amplitude, model, tables, work):
    """Write the start of the next segment, in state z, into ``work.x``, if there is one."""
    tau = segment.tau + span
    if tau >= segment.end:
        return
    if place >= 0 or segment.index == IN_SERIES:
        forcing_after(span, tau, amplitude, work.x, z.shape[0], model, work.forcing)
        start(work.x, z, work.forcing)
    else:
        copy_state(z, work.x)
        if span == segment.h:
            turn_forcing(work.x, z.shape[0], tables, segment.index)


@inlined
def begin(tau, z, amplitude, shared):
    """Begin a segment in a state: set the modes of the contacts; return the sets of all elements.

    Sliders go on as they are.
    """
    model, work, modes = shared.model, shared.work, shared.modes
    write_loads(modes, model.elements, work.forcing)
    past = past_stops(tau, z, amplitude, model, work)
    key = pushing(past, z, model)
    set_contacts(past, key, modes, model.contacts)
    past, key = sets_of(modes, model.elements)
    past, key = settle(tau, past, key, z, amplitude, shared)
    forcing_at(tau, amplitude, model, work.forcing, 0)
    start(work.x, z, work.forcing)
    return past, key


@inlined
def settle(tau, past, key, z, amplitude, shared):
    """Let contacts that rest at their stops go; return the sets, and write the windows, of all."""
    model, work, modes = shared.model, shared.work, shared.modes
    if model.layer == 0.0 and model.contacts.row.shape[0] > 0:
        past, key = rest_at_stops(tau, past, key, z, amplitude, model, work)
    set_contacts(past, key, modes, model.contacts)
    write_windows(modes, model.elements, work)
    return past, key


@inlined
def _is_last(part, model):
    """Return whether a series of one step reaches the end, where there are sliders."""
    most = THETA / math.sqrt(model.stiffness_bound + model.hardest)
    return model.elements.stiffness.shape[0] > 0 and part.end - part.tau <= most


@inlined
def _step(packed, part, coasts, steps, tangent, shared):
    """Take a step to ``work.z_end``, after those that `coast_on` takes.

    Under records those of sets without a table are series, and beside sliders the last ones of an
    interval: where a slider changes no step is a whole one. Return the segment, the length of the
    step and the number of steps.
    """
    model, tables, work, key = shared.model, shared.tables, shared.work, part.key
    if tangent is None and (_is_last(part, model) or not is_tabled(key, model, tables)):
        h = expand_series(key, part.end - part.tau, model, work)
        sum_series(1.0, work)
        shared.counts[LINEAR_STEPS] += 1
        return Segment(key, IN_SERIES, h, part.tau, part.end), h, steps
    index = table_of(key, tables, packed)
    segment = Segment(key, index, tables.h[index], part.tau, part.end)
    segment, known, steps = coast_on(segment, coasts, steps, tangent, shared)
    return segment, take_step(segment, known, model, tables, work), steps


@inlined
def march_period(packed, z, amplitude, shared, wanted, tangent):
    """Advance z over one forcing period, in place; see `flow.period.period.march_period`.

    Returns
    -------
    int
        An `Outcome`.
    """
    if not (is_ordinary(z) and abs(amplitude) < OVERFLOW):
        return NON_FINITE
    whole = Segment(np.uint64(0), NO_TABLE, 0.0, 0.0, shared.model.period)
    return march_elements(packed, whole, z, amplitude, shared, wanted, tangent)


@inlined
def march_elements(packed, part, z, amplitude, shared, wanted, tangent):
    """Advance z over a part of a period or of a sample interval, in place; return the outcome.

    Parameters
    ----------
    part : Segment
        With a table no contact is past its stop, the set is its key, and what follows from the
        modes is there, with ``work.x``; with `NO_TABLE` the sets follow from z.
    wanted : int
        Flags of what to gather, see `tally`; of a record only `PEAKS` and `IMPACTS`, together, and
        `ENERGY`.
    tangent : ndarray, shape (2R, m), or None
        Multiplied by the tangent map of a period. None, in compiling, is a record: steps are taken
        one by one.
    """
    model, tables, work, counts = shared.model, shared.tables, shared.work, shared.counts
    elements, modes = model.elements, shared.modes
    key, tau, end = part.key, part.tau, part.end
    past, steps, begins = np.uint64(0), 0, part.index == NO_TABLE
    while tau < end:
        if begins:
            past, key = begin(tau, z, amplitude, shared)
        begins = model.layer > 0.0 and past & ~key != np.uint64(0)
        steps += 1
        if steps > shared.max_steps:
            return STEP_LIMIT
        if begins:
            left = shared.max_steps - steps
            tau, outcome, used = visit_layers(
                packed, Interval(tau, end, left), z, amplitude, wanted
            )
            steps += used
            if outcome != COMPLETE:
                return outcome
            continue
        coasts = wanted == NO_TALLY and elements.stiffness.shape[0] == 0
        coasts = coasts and past == np.uint64(0)
        rest = Segment(key, NO_TABLE, 0.0, tau, end)
        segment, span, steps = _step(packed, rest, coasts, steps, tangent, shared)
        tau, whole = segment.tau, span
        place, span = first_change(segment, span, modes, tables, elements, work)
        if place == UNDECIDED:
            return SOLVER_FAILED
        if span >= end - tau:
            place = -1  # what changes at the end does so at the start of what follows
        if not is_ordinary(work.z_end):
            return NON_FINITE
        if tangent is None:
            measure_segment(segment, past, span, whole, amplitude, wanted, shared)
        else:
            observe_segment(segment, past, span, amplitude, wanted, tangent, shared)
        if place >= 0:
            counts[PASSAGES] += 1
            before = past
            change(place, segment, span, work.z_end, modes, elements, shared)
            if elements.guard[place, ENDS] > 0.0:
                modes.path[elements.owner[place]] = time_of(segment.tau + span, model)
                copy_state(work.z_end, z)
                return COLLAPSED
            past, key = sets_of(modes, elements)
            write_loads(modes, elements, work.forcing)
            past, key = settle(segment.tau + span, past, key, work.z_end, amplitude, shared)
            passing = past ^ before
            if tangent is not None:
                change_tangent(passing, before, segment.key, model, tangent)
            if wanted & IMPACTS and model.layer == 0.0:
                record_passing(passing, before, model, shared.tally, work.z_end)
        copy_state(work.z_end, z)
        tau = end if span >= end - tau else tau + span
        start_next(segment, place, span, z, amplitude, model, tables, work)
    return COMPLETE


@entry_point(
    (INT, INT),
    *(BYTES, VECTOR, FLOAT, INT, MATRIX, INT, MATRIX, VECTOR),
    inner=True,
    specialises=True,
    on_demand=True,
)
def march_periods(shared, z, amplitude, n_periods, points, wanted, tangent, growth):
    """Advance z over `n_periods` forcing periods, in place; see `flow.period.march.march`.

    A loop of its own, so that the periods of elastic contacts pay nothing for it: a call within
    their loop cost them 5 %.
    """
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    tangent = as_long_as(tangent, common.previous)
    for period in range(n_periods):
        begin_period(z, tangent, common)
        outcome = march_period(shared, z, amplitude, common, wanted, tangent)
        if outcome != COMPLETE:
            copy_state(common.previous, z)
            return period, outcome
        end_period(period, z, points, tangent, growth)
    if wanted & DRIFT:
        largest_of_storeys(common.model, common.tally)
    return n_periods, COMPLETE
