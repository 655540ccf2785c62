"""Sample intervals of a record in a row.

An interval between two samples, on which G is linear, is to the motion what a forcing period is to
one that harmonics drive: it begins at tau = 0 with the pair (G, G') of its first sample. The steps
of a record's tables are parts of it (`propagators`), so that an interval in which no contact can
change (proved, `events.is_clear`) is a product or a few. From the first step on where one may, the
rest of the interval is taken as a period is (`period`).
"""

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    INT,
    MATRIX,
    VECTOR,
    entry_point,
    type_of,
)
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.kernel_model import ACCELERATION, CONTACT
from hpcsweep.solvers.flow.elements.contacts import accelerations as elements_accelerations
from hpcsweep.solvers.flow.elements.contacts import by_elements, past_stops, pushing, set_contacts
from hpcsweep.solvers.flow.elements.guards import (
    all_keep_modes,
    sets_of,
    write_loads,
    write_windows,
)
from hpcsweep.solvers.flow.elements.march import all_peaks_of_elements, march_elements
from hpcsweep.solvers.flow.layer.sliders import add_sliders, write_sliders
from hpcsweep.solvers.flow.layer.visit import inside_layer
from hpcsweep.solvers.flow.linear.forcing import forcing_at, total_forcing, turn_forcing
from hpcsweep.solvers.flow.linear.propagators import is_tabled, table_of
from hpcsweep.solvers.flow.linear.spectral import bound_rows, is_spectral, spectral_step
from hpcsweep.solvers.flow.observe.drift import row_at_ends
from hpcsweep.solvers.flow.observe.impacts import impacts_on_segment
from hpcsweep.solvers.flow.observe.outputs import fill_outputs
from hpcsweep.solvers.flow.observe.peaks import peaks_on_segment
from hpcsweep.solvers.flow.period.period import march_segments
from hpcsweep.solvers.flow.search.events import contact_key, is_clear
from hpcsweep.solvers.flow.state.products import add_product, add_product_of_moduli, product
from hpcsweep.solvers.flow.state.shared import (
    ENERGY,
    IMPACTS,
    LINEAR_STEPS,
    NO_TALLY,
    PEAKS,
    read_shared,
)
from hpcsweep.solvers.flow.state.state import (
    NO_TABLE,
    OVERFLOW,
    Segment,
    accelerations,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
    is_ordinary,
    renew_rows,
    start,
)
from hpcsweep.solvers.outcome import COMPLETE, NON_FINITE

PEAKS_AT_SAMPLES, ALL_PEAKS, WITH_ENERGY = 1, 2, 3
"""What is gathered: peaks at the samples, or over continuous time, and impacts, and the integrals
of the energy, which need elements; 0: nothing."""


@entry_point((INT, INT), BYTES, VECTOR, VECTOR, FLOAT, type_of((0, 0, 0.0)), INT, MATRIX)
def march_record(shared, z, samples, amplitude, intervals, wanted, points):
    """Advance z over intervals of a record, in place, or to a collapse.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`, of a `record_model`.
    z : ndarray, shape (2R,)
    samples : ndarray, shape (m,)
        Of the ground; from the last one on there is none.
    amplitude : float
        By which they are multiplied.
    intervals : tuple of int, int and float
        `first` and `last` of the intervals `first`, .., `last` - 1, and the length of each: that of
        a sample, or a part of it.
    wanted : int
    points : ndarray, shape (last - first, 2R) or (0, 2R)
        Receives the states at the ends of the intervals; not written if empty.

    Returns
    -------
    n_done : int
    outcome : int
    """
    common = read_shared(shared)
    z = as_long_as(z, common.previous)
    model, tables, work = common.model, common.tables, common.work
    first, last, length = intervals
    key, index = np.uint64(0), NO_TABLE
    with_elements = by_elements(model)
    work.tails.table[0] = 0
    if with_elements:
        write_loads(common.modes, model.elements, work.forcing)
        write_windows(common.modes, model.elements, work)
    for j in range(first, last):
        _set_ramp(j, samples, model)
        if not (is_ordinary(z) and abs(amplitude) < OVERFLOW):
            return j - first, NON_FINITE
        if model.rows.shape[0] > 0:
            # at every one, so that nothing depends on where a call begins
            renew_rows(z, common.no_tangent, model)
        if wanted == WITH_ENERGY:
            index = NO_TABLE
        elif index == NO_TABLE:
            key, index = _table_at_start(z, amplitude, shared, common)
        tau = 0.0
        if index != NO_TABLE:
            forcing_at(0.0, amplitude, model, work.forcing, 0)
            start(work.x, z, work.forcing)
            if model.elements.stiffness.shape[0] > 0 and work.tails.table[0] == 0:
                _write_tails(index, wanted, common)
            segment = Segment(key, index, tables.h[index], 0.0, length)
            tau = _coast(segment, amplitude, wanted, common)
            for row in range(z.shape[0]):
                z[row] = work.x[row]
        if tau < length:
            flags = _gathered(wanted)
            if with_elements:
                work.tails.table[0] = 0
                if model.contacts.row.shape[0] > 0:
                    index = NO_TABLE
                part = Segment(key, index, 0.0, tau, length)
                outcome = march_elements(shared, part, z, amplitude, common, flags, None)
            else:
                part = Segment(key, index, 0.0, tau, length)
                outcome = march_segments(shared, part, z, amplitude, common, flags, None, True)
            if outcome != COMPLETE:
                return j - first, outcome
            index = NO_TABLE
        if wanted == PEAKS_AT_SAMPLES:
            _sample_peaks(shared, j, z, amplitude, common)
        if points.shape[0] > 0:
            copy_state(z, points[j - first])
    return last - first, COMPLETE


@inlined
def _gathered(wanted):
    """Return the flags of what is gathered of intervals that are not coasted."""
    flags = PEAKS | IMPACTS if wanted >= ALL_PEAKS else NO_TALLY
    return flags | (ENERGY if wanted == WITH_ENERGY else NO_TALLY)


@inlined
def _set_ramp(j, samples, model):
    """Let the ground go from sample j to the next one."""
    model.ramp[0, 0] = model.ramp[0, 1] = 0.0
    model.ramp[0, 2] = j * model.period
    if j + 1 < samples.shape[0]:
        model.ramp[0, 0] = samples[j]
        model.ramp[0, 1] = (samples[j + 1] - samples[j]) / model.period


@inlined
def _table_at_start(z, amplitude, packed, shared):
    """Return the set of an interval's start and its table; `NO_TABLE` where steps are none of it.

    That is inside a layer, and where contacts that are elements are past their stops.
    """
    model, work, key, nothing = shared.model, shared.work, np.uint64(0), np.uint64(0)
    if by_elements(model):
        if model.contacts.row.shape[0] > 0:
            if past_stops(0.0, z, amplitude, model, work) != nothing:
                return key, NO_TABLE
            set_contacts(nothing, nothing, shared.modes, model.contacts)
            write_windows(shared.modes, model.elements, work)
        _, key = sets_of(shared.modes, model.elements)
        if not is_tabled(key, model, shared.tables):
            return key, NO_TABLE
    elif inside_layer(z, model):
        return key, NO_TABLE
    else:
        key = contact_key(0.0, z, amplitude, model, work)
    return key, table_of(key, shared.tables, packed)


@kernel
def _write_tails(index, wanted, shared):
    """Write what the loads of sliders add to products by a table, see `Tails`."""
    tables, outputs, tails, x = shared.tables, shared.outputs, shared.work.tails, shared.work.x
    if is_spectral(tables):
        return
    columns = (x.shape[0] - 1 - shared.model.elements.stiffness.shape[0], x.shape[0])
    tails.table[0] = index + 1
    tails.step[:] = tails.bound4[:] = 0.0
    add_product(tables.step, index, x, columns, tails.step, tails.step)
    add_product_of_moduli(tables.bound4, index, x, columns, tails.bound4, tails.bound4)
    if wanted >= ALL_PEAKS:
        fill_outputs(index, shared.model, tables, outputs)
        tails.pair[:] = tails.pair_bound4[:] = 0.0
        add_product(outputs.pair, index, x, columns, tails.pair, tails.pair)
        bounds = tails.pair_bound4
        add_product_of_moduli(outputs.bound4, index, x, columns, bounds, bounds)


@inlined
def _coast(segment, amplitude, wanted, shared):
    """Take linear steps from ``work.x`` while no contact can change, up to the end at most.

    Returns
    -------
    float
        Where they end; the end of the segment, to the last bit, if that is reached.
    """
    key, index, h, _, end = segment
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    x, wide, places = work.x, work.wide, model.contacts.places
    with_elements = by_elements(model)
    n_sliders = model.elements.stiffness.shape[0]
    moving = (0, x.shape[0] - (n_sliders + 1 if n_sliders > 0 else 0))
    n_steps = int(end / h + 0.5)
    if n_steps * h != end and abs(n_steps * h - end) > 1e-12 * end:
        # a part of an interval
        n_steps = int(end / h)
    for step in range(n_steps):
        if is_spectral(tables):
            spectral_step(index, step * h, (step + 1) * h, model, tables, work)
            bound_rows(h, tables, work)
        else:
            add_product(tables.step, index, x, moving, work.tails.step, wide)
            add_product_of_moduli(tables.bound4, index, x, moving, work.tails.bound4, work.bounds)
        for row in range(work.z_end.shape[0]):
            work.expanded[row] = False
            work.z_end[row] = wide[row]
        if with_elements:
            if not all_keep_modes(h, model.elements, work):
                return step * h
        else:
            for k in range(places.shape[0]):
                if not is_clear(key, k, h, x, wide, model, work.bounds[places[k, 0]]):
                    return step * h
        if wanted == ALL_PEAKS:
            own = Segment(key, index, h, step * h, end)
            if with_elements:
                all_peaks_of_elements(own, h, h, amplitude, shared)
            else:
                peaks_on_segment(own, h, amplitude, PEAKS, shared)
            closed = np.uint64(0) if with_elements else key
            if (closed | tally.beside[0]) != np.uint64(0):
                own = Segment(closed, index, h, step * h, end)
                impacts_on_segment(own, h, model, tables, tally, work)
        for row in range(work.z_end.shape[0]):
            x[row] = wide[row]
        turn_forcing(x, work.z_end.shape[0], tables, index)
        shared.counts[LINEAR_STEPS] += 1
    reached = n_steps * h
    return end if abs(reached - end) <= 1e-12 * end else reached


@kernel
def _sample_peaks(packed, j, z, amplitude, shared):
    """Raise the peaks by the state at the end of interval j."""
    model, tables, work = shared.model, shared.tables, shared.work
    outputs, tally, m = shared.outputs, shared.tally, np.uint64(model.contacts.row.shape[0])
    forcing_at(model.period, amplitude, model, work.forcing, 0)
    within, key = inside_layer(z, model), np.uint64(0)
    ground = total_forcing(work.forcing, 0, model)
    if within:
        accelerations(ground, z, model, work.a)
        write_sliders(shared.modes, model.elements, work.layer)
        add_sliders(z, model.elements, work.layer, work.a)
    else:
        key = contact_key(model.period, z, amplitude, model, work)
        if by_elements(model):
            _, sliding = sets_of(shared.modes, model.elements)
            key = pushing(key, z, model) | sliding >> m << m
    by_field = model.elements.stiffness.shape[0] > 0 or is_spectral(tables)
    if not within and by_field:
        write_loads(shared.modes, model.elements, work.forcing)
        elements_accelerations(key, z, model, work)
        copy_state(work.series.a[: work.a.shape[0]], work.a)
    elif not within:
        index = table_of(key, tables, packed)
        fill_outputs(index, model, tables, outputs)
        start(outputs.x_end, z, work.forcing)
        product(outputs.pair, index, outputs.x_end, outputs.end)
    for p in range(tally.peaks.shape[0]):
        i, below, side, flag = model.watched[p]
        k = p - outputs.first_contact
        if flag == ACCELERATION:
            value = outputs.end[i + i // LANES * LANES]
            if within or by_field:
                value = work.a[i] + model.ground[i] * ground
        elif flag == CONTACT:
            edges = model.contacts.edges
            value = edges[k, SPRING] * distance(k, z, model.contacts)
            value += edges[k, DASHPOT] * approach_speed(k, z, model.contacts)
            if not within and key & contact_bit(k) == np.uint64(0):
                value = 0.0
        else:
            value, _, _, _ = row_at_ends((i, below, side, 0.0), z, z, work.bounds)[0]
        size = abs(value) if side == 0 else value
        if flag > 0 and size > tally.peaks[p]:
            tally.peaks[p], tally.times[p] = size, (j + 1) * model.period
