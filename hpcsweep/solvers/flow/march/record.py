"""Sample intervals of a record, or parts of a forcing period, in a row.

An interval between two samples, on which G is linear, is to the motion what a forcing period is to
one that harmonics drive: it begins at tau = 0 with the pair (G, G') of its first sample, and the
steps of a record's tables are parts of it (`propagators`).
"""

import math

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
from hpcsweep.kernels.simd.vectors import local_vector
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.observed import ACCELERATION, ANY_PEAK, CONTACT, ENERGY, IMPACT
from hpcsweep.solvers.flow.guard.contacts import accelerations as field_accelerations
from hpcsweep.solvers.flow.guard.contacts import by_elements, pushing
from hpcsweep.solvers.flow.guard.elements import sets_of, write_loads
from hpcsweep.solvers.flow.guard.events import contact_key
from hpcsweep.solvers.flow.guard.extremum import row_at_ends
from hpcsweep.solvers.flow.layer.scheme import write_sliders
from hpcsweep.solvers.flow.layer.visit import inside_layer
from hpcsweep.solvers.flow.march.interval import UNKNOWN, march_interval
from hpcsweep.solvers.flow.observe.peaks import DISPLACEMENTS
from hpcsweep.solvers.flow.state.shared import NO_TALLY, read_shared
from hpcsweep.solvers.flow.state.state import (
    accelerations,
    add_sliders,
    approach_speed,
    contact_bit,
    copy_state,
    distance,
    renew_rows,
)
from hpcsweep.solvers.flow.state.tables import OF_CONTACTS
from hpcsweep.solvers.flow.step.constraint import rigid_of
from hpcsweep.solvers.flow.step.forcing import forcing_at, total_forcing
from hpcsweep.solvers.outcome import COMPLETE

PEAKS_AT_SAMPLES, ALL_PEAKS, WITH_ENERGY = 1, 2, 3
"""What is gathered: peaks at the samples, or over continuous time, and impacts, and the integrals
of the energy, which need elements; 0: nothing."""


@entry_point((INT, INT), BYTES, VECTOR, VECTOR, FLOAT, type_of((0, 0, 0.0)), INT, MATRIX)
def march_record(shared, z, samples, amplitude, intervals, wanted, points):
    """Advance z over intervals of a record, in place, or to a collapse.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`, of a `record_model` or of a part of a forcing period.
    z : ndarray, shape (2R,)
    samples : ndarray, shape (m,)
        Of the ground; from the last one on there is none. Or the phases of the harmonics where the
        parts of a forcing period begin, those of each part together.
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
    z = as_long_as(z, common.work.step.z_end)
    if by_elements(common.model):
        return _march(shared, common, z, samples, amplitude, intervals, wanted, points, True)
    return _march(shared, common, z, samples, amplitude, intervals, wanted, points, None)


@inlined
def _march(packed, shared, z, samples, amplitude, intervals, wanted, points, elements):
    """Advance z; arguments of `march_record`, and those of `interval.march_interval`."""
    model, sets, flags = shared.model, UNKNOWN, _gathered(wanted)
    first, last, length = intervals
    for j in range(first, last):
        _begin_interval(j, samples, model)
        if model.rows.shape[0] > 0:
            # at every one, so that nothing depends on where a call begins
            renew_rows(z, None, model)
        outcome, sets = march_interval(
            packed, shared, length, sets, z, amplitude, flags, elements, None, True
        )
        if outcome != COMPLETE:
            return j - first, outcome
        if wanted == PEAKS_AT_SAMPLES:
            _sample_peaks(j, z, amplitude, shared)
        if points.shape[0] > 0:
            copy_state(z, points[j - first])
    return last - first, COMPLETE


@inlined
def _gathered(wanted):
    """Return the flags of what is gathered of intervals that are not coasted."""
    flags = ANY_PEAK | IMPACT if wanted >= ALL_PEAKS else NO_TALLY
    return flags | (ENERGY if wanted == WITH_ENERGY else NO_TALLY)


@inlined
def _begin_interval(j, samples, model):
    """Let the ground go from sample j to the next one, or harmonics from their phases."""
    n_harmonics = model.harmonics.shape[0]
    for h in range(n_harmonics):
        model.harmonics[h, 2] = samples[j * n_harmonics + h]
    if n_harmonics > 0:
        return
    model.ramp[0, 0] = model.ramp[0, 1] = 0.0
    model.ramp[0, 2] = j * model.period
    if j + 1 < samples.shape[0]:
        model.ramp[0, 0] = samples[j]
        model.ramp[0, 1] = (samples[j + 1] - samples[j]) / model.period


@kernel
def _sample_peaks(j, z, amplitude, shared):
    """Raise the peaks by the state at the end of interval j."""
    model, work, modes = shared.model, shared.work, shared.modes
    outputs, tally, m = shared.outputs, shared.tally, np.uint64(model.contacts.row.shape[0])
    forcing_at(model.period, amplitude, model, work.forcing, 0)
    ground, within = total_forcing(work.forcing, 0, model), inside_layer(z, model)
    padded = local_vector(work.step.series.field.shape[1])
    key, a = np.uint64(0), padded[: model.stiffness.shape[0]]
    if within:
        accelerations(ground, z, model, a)
        write_sliders(modes, model.elements, work.step.series.slope, work.step.layer)
        add_sliders(z, model.elements, work.step.layer, a)
    else:
        key = contact_key(model.period, z, amplitude, model, work.forcing, a)
        _, sliding = sets_of(modes, model.elements)
        key = pushing(key & ~rigid_of(key, model.contacts), z, model) | sliding >> m << m
        key |= rigid_of(sliding, model.contacts)
        write_loads(modes, model.elements, work.forcing, work.step.series)
        field_accelerations(key, z, work.forcing, model, work.step.series, padded)
    for p in range(tally.peaks.shape[0]):
        i, below, side, flag = model.watched[p]
        k = p - outputs.first[OF_CONTACTS]
        value = 0.0
        if flag == ACCELERATION:
            value = a[i] + model.ground[i] * ground
        elif flag == CONTACT:
            edges = model.contacts.edges
            value = edges[k, SPRING] * distance(k, z, model.contacts)
            value += edges[k, DASHPOT] * approach_speed(k, z, model.contacts)
            if not within and key & contact_bit(k) == np.uint64(0):
                value = 0.0
        elif flag & DISPLACEMENTS:
            value, _, _, _ = row_at_ends((i, below, side, 0.0), z, z, work.step.bounds)[0]
        elif flag > 0:  # of that no value at a sample is known
            tally.peaks[p] = math.nan
        size = abs(value) if side == 0 else value
        if flag > 0 and size > tally.peaks[p]:
            tally.peaks[p], tally.times[p] = size, (j + 1) * model.period
