r"""The present step of a motion: what makes one, and what is asked of it, whatever its kind.

A step leads from the augmented state in ``step.x`` to the state in ``step.z_end``. Of four kinds,

- `TABLE`: by the propagators of its contact set (`propagators`);
- `MODES`: of a large structure, in the modes of the free one (`spectral`, `strides`);
- `SERIES`: the Taylor series of a set that no table is worth (`series`);
- `STAGES`: inside a contact layer, by collocation (`layer.scheme`),

this is the only file that tells them apart, with those that take many steps at once (`events`) and
that know of accelerations (`accelerations`). All of them give

- rows as polynomials in sigma = 2 s / h - 1, ``step.rows`` where ``step.expanded``: `expand`;
- the state at a time s: `state_at`;
- bounds of the fourth derivatives of rows, ``step.bounds``: `bound_all_rows`. Inside a layer they
  tell how far a row is from the cubic Hermite interpolant of its ends: with D the largest distance
  of the accelerations from the straight line through those at the ends, the fourth derivative that
  could take it as far is less than 32 D / h^2;
- the tangent map: `step_tangent`.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, KEY, entry_point
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    fma,
    load,
    local_vector,
    maximum,
    modulus,
    store,
)
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, STAGE_POLYNOMIALS
from hpcsweep.solvers.flow.state.shared import TABLES, read_shared
from hpcsweep.solvers.flow.state.state import Segment, contact_bit, degrade
from hpcsweep.solvers.flow.state.tables import MAX_TABLES, N_COEFFICIENTS, THETA, ZERO
from hpcsweep.solvers.flow.step.polynomials import (
    evaluate_rows,
    expand_row,
    fourth_derivative,
)
from hpcsweep.solvers.flow.step.propagators import (
    build_table,
    table_tangent,
    tangent_of_steps,
    write_length,
)
from hpcsweep.solvers.flow.step.series import expand_series, expand_term_row, sum_series
from hpcsweep.solvers.flow.step.spectral import (
    bound_rows,
    modal_state,
    spectral_tangent,
    write_modal_row,
    write_modes,
)

TABLE, MODES, SERIES, STAGES = range(4)
"""Kinds of steps."""
LARGEST_STORE = MAX_TABLES.bit_length() - 1
"""Most contacts and sliders of which all sets have a table."""
HERMITE_DISTANCE = 40.0
"""32 of the bound inside a layer, with a quarter more for what lies between the stages."""


@inlined
def in_modes(tables):
    """Return whether steps are taken in modes; tables then hold lengths and rotations."""
    return tables.step.shape[1] == 0


@inlined
def find_table(key, tables):
    """Return the index of the table of contact set `key`; -1 if there is none."""
    for index in range(tables.count[0]):
        if tables.keys[index] == key:
            return index
    return -1


@inlined
def table_of(key, tables, packed):
    """Return the result of `lookup`, without a call where the table exists."""
    index = find_table(key, tables)
    return index if index >= 0 else lookup(key, packed)


@entry_point(INT, KEY, BYTES)
def lookup(key, packed):
    """Return the index of the table of contact set `key`, building it on first use.

    Parameters
    ----------
    key : uint64
        Contact set.
    packed : ndarray of bytes
        A packed `Shared`.
    """
    shared = read_shared(packed)
    model, tables = shared.model, shared.tables
    index = find_table(key, tables)
    if index >= 0:
        return index
    if tables.count[0] == tables.keys.shape[0]:
        tables.count[0] = 0
    index = tables.count[0]
    if in_modes(tables):
        write_length(key, model, tables, index)
    else:
        build_table(key, model, tables, index)
    shared.counts[TABLES] += 1
    tables.keys[index] = key
    tables.count[0] = index + 1
    return index


@inlined
def step_of(key, index, tau, end, tables):
    """Return a step of a set, of table `index`, from tau of an interval to `end`."""
    kind = MODES if in_modes(tables) else TABLE
    return Segment(kind, key, index, tables.h[index], tau, end)


@inlined
def is_series(key, tau, end, model, modes, tables):
    """Return whether a step of a record is a series: no table, or one beside sliders to the end.

    A table have all sets where none slips, and all of a structure whose sets fit in the store: that
    does not depend on the motions before. Beside sliders most whole steps end at one that changes,
    and what is left of an interval is none: a series that reaches its end serves both, but a whole
    step in modes, which is cheaper.
    """
    m, n_sliders = model.contacts.row.shape[0], model.elements.stiffness.shape[0]
    if n_sliders == 0 or model.ramp.shape[0] == 0:  # the series are those of a ramp
        return False
    slips = key >> np.uint64(m) != np.uint64(0)
    if slips and (degrade(modes) or m + n_sliders > LARGEST_STORE) and not in_modes(tables):
        return True
    left = end - tau
    begun = tau > 0.0 or not in_modes(tables)
    return begun and left <= THETA / math.sqrt(model.stiffness_bound + model.hardest)


@inlined
def series_step(key, tau, end, model, step):
    """Take a step as a series, as far as one goes, to ``step.z_end``."""
    h = expand_series(key, end - tau, model, step)
    sum_series(1.0, step.series, step.wide, step.z_end)
    return Segment(SERIES, key, -1, h, tau, end)


@inlined
def layer_segment(tau, h):
    """Return a step inside a layer, where any contact may be closed."""
    return Segment(STAGES, ~np.uint64(0), -1, h, tau, tau + h)


@inlined
def begin_layer_step(h, step):
    """Make a step inside a layer the present one; it has stages and states at both ends."""
    for row in range(step.z_end.shape[0]):
        step.expanded[row] = False
    for i in range(step.a.shape[0]):
        line = fma(load(NODES, 0), step.a_end[i] - step.a[i], step.a[i])
        apart = maximum(modulus(load(step.layer.g, i * N_STAGES) - line))
        step.bounds[i] = HERMITE_DISTANCE * apart / (h * h)


@inlined
def expand(row, segment, tables, step):
    """Write the polynomial of a row along the present step into ``step.rows``, if it is not."""
    if not step.expanded[row]:
        step.expanded[row] = True
        if segment.kind == STAGES:
            stage = step.layer
            _expand_stages(row, segment.h, step.x, stage.v, stage.g, step.rows)
        elif segment.kind == SERIES:
            expand_term_row(row, step.series, step.rows)
        elif in_modes(tables):
            half = step.z_end.shape[0] // 2
            write_modal_row(row, half, tables.spectrum, step.spectral, step.rows)
        else:
            expand_row(tables.poly, segment.index, row, step.x, step.rows[row])


@kernel
def _expand_stages(row, h, x, v, g, rows):
    """Write the polynomial of a row by the stages of a step; see `tableau`."""
    n, data = v.shape[0], local_vector(2 * N_STAGES)
    i, speed = row % n, x[n + row % n]
    store(data, 0, (load(v, i * N_STAGES) - speed) * h)
    store(data, LANES, load(g, i * N_STAGES) * (h * h))
    table, count = STAGE_POLYNOMIALS, N_COEFFICIENTS
    first = row // n * table.shape[1] * count
    scale = 1.0 if row < n else 1.0 / h
    for p in range(0, count, LANES):
        at = row * count + p
        combine(rows, at, ZERO, 0, scale, table, first + p, count, data, 0, 2 * N_STAGES)
    if row < n:
        rows[row, 0] += x[row] + 0.5 * h * speed
        rows[row, 1] += 0.5 * h * speed
    else:
        rows[row, 0] += speed


@kernel
def write_row(row, law, segment, tables, step, out):
    """Write spring y + dashpot y' - level along the present step into polynomial 0 of `out`.

    Parameters
    ----------
    row : (int, int)
        Of `Elements.rows`.
    law : (float, float, float)

    Returns
    -------
    float
        Bound of its fourth derivative.
    """
    rows, half = step.rows, step.expanded.shape[0] // 2
    spring, dashpot, level = law
    for p in range(N_COEFFICIENTS):
        out[0, p] = 0.0
    for end in range(2):
        for part in range(2):
            factor = dashpot if part else spring
            i = row[end] + part * half
            if row[end] < 0 or factor == 0.0:
                continue
            expand(i, segment, tables, step)
            factor = -factor if end else factor
            for p in range(N_COEFFICIENTS):
                out[0, p] += factor * rows[i, p]
    out[0, 0] -= level
    return fourth_derivative(out, segment.h)


@inlined
def expand_contacts(segment, some, model, tables, step):
    """Write the polynomials of the rows of some contacts, a set, along the present step."""
    for k in range(model.contacts.row.shape[0]):
        if some & contact_bit(k) != np.uint64(0):
            expand(model.contacts.row[k], segment, tables, step)


@inlined
def state_at(segment, s, tables, step, out):
    """Write the state at time s of the present step; not inside a layer, where it is taken anew."""
    if segment.kind == SERIES:
        sum_series(s / segment.h, step.series, step.wide, out)
    elif segment.kind == MODES:
        modal_state(s, segment.h, tables.spectrum, step.spectral, out)
    elif segment.kind == TABLE:
        for row in range(step.z_end.shape[0]):
            expand(row, segment, tables, step)
        evaluate_rows(step.rows, segment.h, s, out)


@inlined
def bound_all_rows(segment, tables, step):
    """Write ``step.bounds`` of all rows, where those of contacts are enough to take a step."""
    if segment.kind == MODES:
        bound_rows(segment.h, tables.spectrum, step)


@inlined
def bound_of_row(segment, bound4):
    """Return a bound of |y''''| of the polynomial of a row whose bound is `bound4`.

    Inside a layer that tells only of the interpolant of its ends.
    """
    return math.inf if segment.kind == STAGES else bound4


@inlined
def expand_modal(segment, model, tables, step, rows):
    """Write the polynomials of the modal coordinates along a linear step."""
    n, count = model.modal_transform.shape[0], N_COEFFICIENTS
    if segment.kind == MODES:
        write_modes(step.spectral, rows)
        return
    for row in range(n):
        expand(row, segment, tables, step)
    transform, width = model.modal_transform, model.modal_transform.shape[1]
    for j in range(n):
        for p in range(0, count, LANES):
            at = j * count + p
            combine(rows, at, ZERO, 0, 1.0, step.rows, p, count, transform, j * width, n)


@inlined
def step_tangent(segment, s, n_steps, tangent, model, tables, modal):
    """Multiply `tangent` by the map of `n_steps` times s of a linear step, in place.

    More than one are whole steps of its set, of which all but the present one have been taken.

    Parameters
    ----------
    segment : Segment
    s : float
    n_steps : int
    tangent : ndarray, shape (2R, m)
    model : Model
    tables : Tables
    modal : SpectralWorkspace
    """
    if tangent.shape[1] == 0 or n_steps == 0:
        return
    if in_modes(tables):
        spectral_tangent(segment.index, s, n_steps, tangent, model, tables, modal)
    elif s == segment.h:
        tangent_of_steps(segment.index, n_steps, tangent, tables)
    else:
        table_tangent(segment.index, s, tangent, tables)
