r"""The present step of a motion: what makes one, and what is asked of it, whatever its kind.

A step leads from the augmented state in ``work.x`` to the state in ``work.z_end``. Of four kinds,

- `TABLE`: by the propagators of its contact set (`propagators`);
- `MODES`: of a large structure, in the modes of the free one (`spectral`, `strides`);
- `SERIES`: the Taylor series of a set that no table is worth (`series`);
- `STAGES`: inside a contact layer, by collocation (`layer.scheme`),

this is the only file that tells them apart, with those that take many steps at once (`events`) and
that know of accelerations (`accelerations`). All of them give

- rows as polynomials in sigma = 2 s / h - 1, ``work.rows`` where ``work.expanded``: `expand`;
- the state at a time s: `state_at`;
- bounds of the fourth derivatives of rows, ``work.bounds``: `bound_all_rows`. Inside a layer they
  tell how far a row is from the cubic Hermite interpolant of its ends: with D the largest distance
  of the accelerations from the straight line through those at the ends, the fourth derivative that
  could take it as far is less than 32 D / h^2;
- the tangent map: `step_tangent`.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, KEY, entry_point
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, maximum, modulus, store
from hpcsweep.solvers.flow.linear.generator import bound_of_set
from hpcsweep.solvers.flow.linear.polynomials import (
    evaluate_rows,
    expand_row,
    fourth_derivative,
)
from hpcsweep.solvers.flow.linear.propagators import build_table, write_length
from hpcsweep.solvers.flow.linear.series import expand_series, expand_term_row, sum_series
from hpcsweep.solvers.flow.linear.spectral import (
    bound_rows,
    modal_state,
    spectral_tangent,
    write_modal_row,
    write_modes,
)
from hpcsweep.solvers.flow.linear.tangent import table_tangent, tangent_of_steps
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, STAGE_POLYNOMIALS
from hpcsweep.solvers.flow.state.shared import TABLES, read_shared
from hpcsweep.solvers.flow.state.state import Segment, contact_bit
from hpcsweep.solvers.flow.state.tables import MAX_TABLES, N_COEFFICIENTS, THETA, ZERO

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
        write_length(bound_of_set(key, model), key, model, tables, index)
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
def is_series(key, tau, end, model, tables):
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
    if slips and m + n_sliders > LARGEST_STORE and not in_modes(tables):
        return True
    left = end - tau
    begun = tau > 0.0 or not in_modes(tables)
    return begun and left <= THETA / math.sqrt(model.stiffness_bound + model.hardest)


@inlined
def series_step(key, tau, end, model, work):
    """Take a step as a series, as far as one goes, to ``work.z_end``."""
    h = expand_series(key, end - tau, model, work)
    sum_series(1.0, work, work.z_end)
    return Segment(SERIES, key, -1, h, tau, end)


@inlined
def layer_segment(tau, h):
    """Return a step inside a layer, where any contact may be closed."""
    return Segment(STAGES, ~np.uint64(0), -1, h, tau, tau + h)


@inlined
def begin_layer_step(h, work):
    """Make a step inside a layer the present one; it has stages and states at both ends."""
    for row in range(work.z_end.shape[0]):
        work.expanded[row] = False
    for i in range(work.a.shape[0]):
        line = fma(load(NODES, 0), work.a_end[i] - work.a[i], work.a[i])
        apart = maximum(modulus(load(work.layer.g, i * N_STAGES) - line))
        work.bounds[i] = HERMITE_DISTANCE * apart / (h * h)


@inlined
def expand(row, segment, tables, work):
    """Write the polynomial of a row along the present step into ``work.rows``, if it is not."""
    if not work.expanded[row]:
        work.expanded[row] = True
        if segment.kind == STAGES:
            stage = work.layer
            _expand_stages(row, segment.h, work.x, stage.v, stage.g, stage.values, work.rows)
        elif segment.kind == SERIES:
            expand_term_row(row, work.series, work.rows)
        elif in_modes(tables):
            write_modal_row(
                row, work.z_end.shape[0] // 2, tables.spectrum, work.spectral, work.rows
            )
        else:
            expand_row(tables.poly, segment.index, row, work.x, work.rows)


@kernel
def _expand_stages(row, h, x, v, g, data, rows):
    """Write the polynomial of a row by the stages of a step; see `tableau`."""
    n = v.shape[0]
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
def write_row(row, law, segment, tables, work):
    """Write spring y + dashpot y' - level along the present step into ``work.drift_rows``.

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
    rows, out, half = work.rows, work.drift_rows, work.expanded.shape[0] // 2
    spring, dashpot, level = law
    for p in range(N_COEFFICIENTS):
        out[0, p] = 0.0
    for end in range(2):
        for part in range(2):
            factor = dashpot if part else spring
            i = row[end] + part * half
            if row[end] < 0 or factor == 0.0:
                continue
            expand(i, segment, tables, work)
            factor = -factor if end else factor
            for p in range(N_COEFFICIENTS):
                out[0, p] += factor * rows[i, p]
    out[0, 0] -= level
    return fourth_derivative(out, segment.h)


@inlined
def expand_contacts(segment, some, model, tables, work):
    """Write the polynomials of the rows of some contacts, a set, along the present step."""
    for k in range(model.contacts.row.shape[0]):
        if some & contact_bit(k) != np.uint64(0):
            expand(model.contacts.row[k], segment, tables, work)


@inlined
def state_at(segment, s, tables, work, out):
    """Write the state at time s of the present step; not inside a layer, where it is taken anew."""
    if segment.kind == SERIES:
        sum_series(s / segment.h, work, out)
    elif segment.kind == MODES:
        modal_state(s, segment.h, tables, work, out)
    elif segment.kind == TABLE:
        for row in range(work.z_end.shape[0]):
            expand(row, segment, tables, work)
        evaluate_rows(work.rows, segment.h, s, out)


@inlined
def bound_all_rows(segment, tables, work):
    """Write ``work.bounds`` of all rows, where those of contacts are enough to take a step."""
    if segment.kind == MODES:
        bound_rows(segment.h, tables, work)


@inlined
def bound_of_row(segment, bound4):
    """Return a bound of |y''''| of the polynomial of a row whose bound is `bound4`.

    Inside a layer that tells only of the interpolant of its ends.
    """
    return math.inf if segment.kind == STAGES else bound4


@inlined
def expand_modal(segment, model, tables, work):
    """Write the polynomials of the modal coordinates along a linear step."""
    n, count, rows = model.modal_transform.shape[0], N_COEFFICIENTS, work.modal_rows
    if segment.kind == MODES:
        write_modes(work.spectral, rows)
        return
    for row in range(n):
        expand(row, segment, tables, work)
    transform, width = model.modal_transform, model.modal_transform.shape[1]
    for j in range(n):
        for p in range(0, count, LANES):
            at = j * count + p
            combine(rows, at, ZERO, 0, 1.0, work.rows, p, count, transform, j * width, n)


@inlined
def step_tangent(segment, s, n_steps, tangent, shared):
    """Multiply `tangent` by the map of `n_steps` times s of a linear step, in place.

    More than one are whole steps of its set, of which all but the present one have been taken.
    """
    tables, work = shared.tables, shared.work
    if tangent.shape[1] == 0 or n_steps == 0:
        return
    if in_modes(tables):
        spectral_tangent(segment.index, s, n_steps, tangent, shared.model, tables, work)
    elif s == segment.h:
        tangent_of_steps(segment.index, n_steps, tangent, tables, work.tangent)
    else:
        table_tangent(segment.index, s, tangent, tables, work.tangent)
