r"""Absolute accelerations along the present step, whatever its kind: at its ends, bounds, rows.

Those of floors and of bases; `LANES` at once, values and slopes in turns. Lanes beyond the last one
are 0. By a table they are those of `outputs`; a series has them in its terms; of a step in modes
they are sums over the modes, with polynomials of bases alone, beside closed contacts.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    fma,
    load,
    local_matrix,
    local_vector,
    modulus,
    store,
)
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.state.state import contact_bit, copy_state
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.workspace import N_TERMS
from hpcsweep.solvers.flow.step.forcing import (
    forcing_after,
    forcing_rate,
    n_pairs,
    total_forcing,
    turn_forcing,
)
from hpcsweep.solvers.flow.step.outputs import differentiate, fill_outputs
from hpcsweep.solvers.flow.step.polynomials import (
    expand_row,
    fourth_derivative,
    value_and_slope,
)
from hpcsweep.solvers.flow.step.propagators import product, product_of_moduli
from hpcsweep.solvers.flow.step.spectral import (
    bound_by_terms,
    write_accelerations,
    write_forcing,
)
from hpcsweep.solvers.flow.step.step import MODES, TABLE, expand, in_modes

FIFTH_OF_TERMS = np.array([math.perm(k, 5) for k in range(N_TERMS)], float)
"""As `series.FOURTH_OF_TERMS`, of speeds for accelerations."""


@inlined
def ends_of_accelerations(segment, span, amplitude, model, tables, outputs, step, start, bounds):
    """Write accelerations and slopes at both ends of the first `span` of a step, and bounds."""
    if segment.kind == TABLE:
        _ends_by_tables(segment, span, amplitude, model, tables, outputs, step, start, bounds)
    else:
        outputs.place[0] = -1.0
        if segment.kind == MODES:
            _ends_in_modes(segment, span, amplitude, model, tables, outputs, step, start, bounds)
        elif in_modes(tables):
            for p in range(model.ground.shape[0]):
                _ends_of_polynomial(p, segment, span, model, tables, outputs, step, start, bounds)
        else:
            _ends_in_series(segment, span, model, outputs, step, start, bounds)
    for p in range(model.ground.shape[0], bounds.shape[0]):
        # behind the floors eights go on with what is nobody's
        at = p + p // LANES * LANES
        start[at] = start[at + LANES] = 0.0
        outputs.end[at] = outputs.end[at + LANES] = bounds[p] = 0.0


@inlined
def expand_acceleration(p, segment, model, tables, outputs, step, out):
    """Write the polynomial of an acceleration along the present step."""
    if segment.kind == TABLE:
        fill_outputs(segment.index, model, tables, outputs)
        expand_row(outputs.poly, segment.index, p, step.x, out)
    else:
        _write_acceleration(p, segment, model, tables, out, step)


@inlined
def _ends_by_tables(segment, span, amplitude, model, tables, outputs, step, start, bounds):
    """Write accelerations and slopes at both ends of a step of a table, and their bounds."""
    index, size = segment.index, step.z_end.shape[0]
    fill_outputs(index, model, tables, outputs)
    if outputs.place[0] == index and outputs.place[1] == segment.tau:
        copy_state(outputs.end, start)
    else:
        product(outputs.pair, index, step.x, start)
    x_end, pairs = local_vector(step.x.shape[0]), local_vector(n_pairs(model))
    copy_state(step.x, x_end)
    for row in range(size):
        x_end[row] = step.z_end[row]
    if span == segment.h:
        turn_forcing(x_end, size, tables, index)
    else:
        forcing_after(span, segment.tau + span, amplitude, step.x, size, model, pairs)
        for k in range(pairs.shape[0]):
            x_end[size + k] = pairs[k]
    product(outputs.pair, index, x_end, outputs.end)
    outputs.place[0], outputs.place[1] = index, segment.tau + span
    product_of_moduli(outputs.bound4, index, step.x, bounds)


@kernel
def _ends_in_series(segment, span, model, outputs, step, start, bounds):
    """Write the same of a step that is a series, by its terms."""
    x, terms, size, rate = step.x, step.series.terms, step.z_end.shape[0], 1.0 / segment.h
    flat, half, ratio = terms.shape[1], size // 2, span * rate
    ground, slope = total_forcing(x, size, model), forcing_rate(x, size, model)
    shares = local_vector(bounds.shape[0])
    shares[:] = 0.0
    copy_state(model.ground, shares)
    for p in range(0, bounds.shape[0], LANES):
        share, first = load(shares, p), half + p
        value = bend = bound = load(ZERO, 0)
        for k in range(step.series.count[0] - 1, 0, -1):
            term = load(terms, k * flat + first)
            bend = fma(bend, ratio, value)
            value = fma(value, ratio, term * (1.0 * k))
            bound = fma(modulus(term), FIFTH_OF_TERMS[k], bound)
        store(start, 2 * p, fma(share, ground, load(terms, flat + first) * rate))
        early = load(terms, 2 * flat + first) * (2.0 * rate * rate)
        store(start, 2 * p + LANES, fma(share, slope, early))
        store(outputs.end, 2 * p, fma(share, fma(slope, span, ground), value * rate))
        store(outputs.end, 2 * p + LANES, fma(share, slope, bend * (rate * rate)))
        store(bounds, p, bound * (rate * rate * rate * rate * rate))


@inlined
def _ends_of_polynomial(p, segment, span, model, tables, outputs, step, start, bounds):
    """Write the same of one acceleration by its polynomial."""
    h, at, rows = segment.h, p + p // LANES * LANES, local_matrix(1, N_COEFFICIENTS)
    _write_acceleration(p, segment, model, tables, rows[0], step)
    start[at], start[at + LANES] = value_and_slope(rows, 0, h, 0.0)
    outputs.end[at], outputs.end[at + LANES] = value_and_slope(rows, 0, h, span)
    bounds[p] = fourth_derivative(rows, h)


@kernel
def _ends_in_modes(segment, span, amplitude, model, tables, outputs, step, start, bounds):
    """Write the same of a step in modes; polynomials of bases alone, beside closed contacts."""
    x, spectrum, modal = step.x, tables.spectrum, step.spectral
    h, size, count = segment.h, step.z_end.shape[0], model.ground.shape[0]
    pairs = local_vector(n_pairs(model))
    write_accelerations(0.0, h, count, spectrum, modal, start)
    write_accelerations(span, h, count, spectrum, modal, outputs.end)
    bound_by_terms(5, h, count, spectrum, modal, bounds)
    forcing_after(span, segment.tau + span, amplitude, x, size, model, pairs)
    bend = 0.0
    for k in range(model.harmonics.shape[0]):
        most = abs(x[size + 2 * k]) + abs(x[size + 2 * k + 1])
        bend += (model.harmonics[k, 0] * model.omega) ** 4 * most
    for p in range(count):
        at, share = p + p // LANES * LANES, model.ground[p]
        start[at] += share * total_forcing(x, size, model)
        start[at + LANES] += share * forcing_rate(x, size, model)
        outputs.end[at] += share * total_forcing(pairs, 0, model)
        outputs.end[at + LANES] += share * forcing_rate(pairs, 0, model)
        bounds[p] += abs(share) * bend
        if p >= model.modal_transform.shape[0] and segment.key != np.uint64(0):
            _ends_of_polynomial(p, segment, span, model, tables, outputs, step, start, bounds)


@kernel
def _write_acceleration(p, segment, model, tables, out, step):
    """Write the polynomial of an acceleration along a step without a table."""
    h, size = segment.h, step.z_end.shape[0]
    expand(size // 2 + p, segment, tables, step)
    differentiate(step.rows[size // 2 + p], h, out)
    if segment.kind == MODES:
        _add_forcing(p, segment, model, tables, out, step)
    else:
        slope = 0.5 * h * forcing_rate(step.x, size, model)
        out[0] += model.ground[p] * (total_forcing(step.x, size, model) + slope)
        out[1] += model.ground[p] * slope


@kernel
def _add_forcing(p, segment, model, tables, out, step):
    """Add what the ground has to the polynomial of an acceleration, and take from that of a base.

    The reaction of a base is without what contacts do.
    """
    n, size, contacts = model.modal_transform.shape[0], step.z_end.shape[0], model.contacts
    forcing = local_vector(N_COEFFICIENTS)
    write_forcing(segment.h, step.x, size, model, forcing)
    for power in range(N_COEFFICIENTS):
        out[power] += model.ground[p] * forcing[power]
    for k in range(contacts.row.shape[0] if p >= n else 0):
        if segment.key & contact_bit(k) == np.uint64(0):
            continue
        push = 0.0
        for j in range(n):
            push += model.rows[p - n, j] * contacts.kick[k, j]
        row, sign = contacts.row[k], contacts.sign[k]
        expand(row, segment, tables, step)
        expand(size // 2 + row, segment, tables, step)
        for power in range(N_COEFFICIENTS):
            out[power] += push * contacts.beta[k] * sign * step.rows[row, power]
            out[power] += push * contacts.edges[k, DRAG] * sign * step.rows[size // 2 + row, power]
        out[0] -= push * contacts.beta[k] * contacts.gap[k]
