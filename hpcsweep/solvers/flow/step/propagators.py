"""Build the table of a contact set: the propagators of `tables`, from its generator M.

Loops
-----
All loops are our own: calling a library for matrices of ten rows is slow, and
products differ between libraries in the last bit.

The tangent map of a linear step is exp(M s), by its polynomials, and powers of a whole step.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    combine,
    combine_moduli,
    fma,
    greatest,
    load,
    local_matrix,
    local_vector,
    maximum,
    modulus,
    store,
)
from hpcsweep.solvers.flow.state.tables import (
    BOUND_SAMPLES,
    ECONOMISATION,
    MODAL_NODES,
    N_COEFFICIENTS,
    N_MODAL,
    N_POWERS,
    TAYLOR,
    THETA,
    THETA_FREE,
    ZERO,
)
from hpcsweep.solvers.flow.step.forcing import n_pairs
from hpcsweep.solvers.flow.step.generator import bound_of_set, write_generator


@kernel
def place_of(k, n, n_rows):
    """Return where component k of n coordinates lies in an augmented state of all rows."""
    if k < n:
        return k
    return k + n_rows - n if k < 2 * n else k + 2 * (n_rows - n)


@kernel
def _square(matrix, out):
    """Write the product of a square matrix with itself, rows padded."""
    size, padded = out.shape
    for i in range(size):
        for j in range(0, padded, LANES):
            combine(out, i * padded + j, ZERO, 0, 1.0, matrix, j, padded, matrix, i * padded, size)


@kernel
def _next_term(generator, n, factor, term, spare):
    """Multiply `term` by M times a factor; `spare` is workspace.

    The first n rows of M have one entry each: displacements change by velocities.
    """
    size, padded = term.shape
    for i in range(n, size):
        row = i * padded
        for j in range(0, padded, LANES):
            combine(spare, row + j, ZERO, 0, 1.0, term, j, padded, generator, row, size)
    for i in range(n):
        for j in range(padded):
            term[i, j] = generator[i, n + i] * term[n + i, j] * factor
    for i in range(n, size):
        for j in range(padded):
            term[i, j] = spare[i, j] * factor


@kernel
def _half_step(generator, n, h, half, term, spare):
    """Write exp(M h / 2) into `half`."""
    size = half.shape[0]
    for i in range(size):
        for j in range(half.shape[1]):
            half[i, j] = term[i, j] = 1.0 if i == j else 0.0
    for k in range(1, TAYLOR + 1):
        _next_term(generator, n, 0.5 * h / k, term, spare)
        for i in range(size):
            for j in range(half.shape[1]):
                half[i, j] += term[i, j]


@inlined
def write_length(key, model, tables, index):
    """Write the length of a step, by a bound of |lambda(M)|, and the rotations; return it."""
    h = (THETA if key != np.uint64(0) else THETA_FREE) / bound_of_set(key, model)
    if model.ramp.shape[0] > 0 or h > model.period:
        h = model.period / math.ceil(model.period / h)
    tables.h[index] = h
    for k in range(model.harmonics.shape[0]):
        angle = model.harmonics[k, 0] * model.omega * h
        tables.rotation[index, 2 * k] = math.cos(angle)
        tables.rotation[index, 2 * k + 1] = math.sin(angle)
    return h


@kernel
def build_table(key, model, tables, index):
    """Fill table `index` with the propagators of contact set `key`."""
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    loads = model.elements.stiffness.shape[0]
    size = 2 * n + n_pairs(model) + loads + 1
    width = size + -size % LANES
    scale = math.sqrt(model.stiffness_bound + (model.hardest if key != np.uint64(0) else 0.0))
    generator, half = local_matrix(size, width), local_matrix(size, width)
    term, full = local_matrix(size, width), local_matrix(size, width)
    write_generator(key, model, scale, generator)
    h = write_length(key, model, tables, index)

    # x in the units of the model: balance for u, times s for v, s * forcing, 1 with s = scale
    unit = local_vector(size)
    for i in range(n):
        unit[i] = model.balance[i]
        unit[n + i] = model.balance[i] * scale
    for k in range(2 * n, size):
        unit[k] = scale if k < size - 1 - loads else 1.0
    _half_step(generator, n, h, half, term, full)
    _square(half, full)
    for k in range(size):
        _write_rows(full, unit, k, model, tables.step[index, place_of(k, n, n_rows)])
    powers = tables.powers[index]
    _square(tables.step[index, : 2 * n_rows], powers[0])
    for k in range(1, N_POWERS):
        _square(powers[k - 1], powers[k])
    _expand(generator, h, half, full, unit, model, tables.poly[index])
    poly = tables.poly[index]
    for p in range(N_COEFFICIENTS):
        for column in range(2 * n_rows):
            for row in range(2 * n_rows):
                tables.columns[index, p, column, row] = poly[row, column, p]
    if key == np.uint64(0):
        _build_modal(model, poly, tables.modal)
    for row in range(n_rows):
        for column in range(poly.shape[1]):
            tables.bound4[index, column, row] = max_fourth_derivative(poly[row, column], h)


@kernel
def _expand(generator, h, term, spare, unit, model, poly):
    """Write exp(M s) as polynomials, from exp(M h / 2) in `term`; both matrices are overwritten."""
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    size = term.shape[0]
    rows = local_vector(2 * n_rows)
    for row in range(poly.shape[0]):
        for column in range(poly.shape[1]):
            for p in range(N_COEFFICIENTS):
                poly[row, column, p] = 0.0
    for k in range(TAYLOR + 1):
        if k > 0:
            _next_term(generator, n, 0.5 * h / k, term, spare)
        for column in range(size):
            _write_rows(term, unit, column, model, rows)
            for row in range(2 * n_rows):
                place = (row * poly.shape[1] + place_of(column, n, n_rows)) * N_COEFFICIENTS
                for p in range(0, N_COEFFICIENTS, LANES):
                    more = load(ECONOMISATION, k * N_COEFFICIENTS + p) * rows[row]
                    store(poly, place + p, load(poly, place + p) + more)


@kernel
def _write_rows(matrix, unit, column, model, out):
    """Write a column of a balanced matrix as one of all rows, in the units of the model."""
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    for i in range(n):
        out[i] = matrix[i, column] * unit[i] / unit[column]
        out[n_rows + i] = matrix[n + i, column] * unit[n + i] / unit[column]
    _write_extra(model, out[:n_rows])
    _write_extra(model, out[n_rows : 2 * n_rows])


@inlined
def _write_extra(model, out):
    """Write the rows beyond the n coordinates by those."""
    n = model.modal_transform.shape[0]
    for extra in range(out.shape[0] - n):
        value = 0.0
        for j in range(n):
            value += model.rows[extra, j] * out[j]
        out[n + extra] = value


@kernel
def _build_modal(model, poly, modal):
    """Fill the table of modal coordinates from the polynomials of free flight.

    The modes need no row beyond n.
    """
    n = model.modal_transform.shape[0]
    for column in range(modal.shape[1]):
        for node in range(N_MODAL):
            for i in range(n):
                value = 0.0
                for p in range(N_COEFFICIENTS - 1, -1, -1):
                    value = value * MODAL_NODES[node] + poly[i, column, p]
                for j in range(n):
                    modal[0, column, j * N_MODAL + node] += model.modal_transform[j, i] * value


@kernel
def max_fourth_derivative(coefficients, h):
    """Bound |d^4/ds^4| of one polynomial on the step.

    The largest of equidistant samples plus half their distance times a bound (the sum of the
    moduli of its coefficients) of the fifth derivative.
    """
    fifth = 0.0
    for p in range(5, N_COEFFICIENTS):
        fifth += abs(coefficients[p]) * p * (p - 1) * (p - 2) * (p - 3) * (p - 4)
    largest = load(ZERO, 0)
    for first in range(0, BOUND_SAMPLES.shape[0], LANES):
        sigma = load(BOUND_SAMPLES, first)
        value = load(ZERO, 0)
        for p in range(N_COEFFICIENTS - 1, 3, -1):
            value = fma(value, sigma, coefficients[p] * p * (p - 1) * (p - 2) * (p - 3))
        largest = greatest(largest, modulus(value))
    return (maximum(largest) + fifth / (BOUND_SAMPLES.shape[0] - 1)) * (2.0 / h) ** 4


@kernel
def product(table, index, x, out):
    """Multiply the columns ``table[index]`` by x into `out`, whose length is padded to `LANES`."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])


@kernel
def product_of_moduli(table, index, x, out):
    """Multiply like `product`, by the moduli |x|."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine_moduli(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])


@inlined
def table_tangent(index, s, tangent, tables):
    """Multiply `tangent` by exp(M s) of table `index`, in place.

    Parameters
    ----------
    index : int
    s : float
    tangent : ndarray, shape (2R, m)
    tables : Tables
    """
    size, rows = tables.columns.shape[2], tables.columns.shape[3]
    sigma = 2.0 * s / tables.h[index] - 1.0
    powers, propagator = local_vector(N_COEFFICIENTS), local_matrix(size, rows)
    powers[0] = 1.0
    powers[1] = sigma
    for p in range(2, N_COEFFICIENTS):
        powers[p] = powers[p - 2] * (sigma * sigma)
    start, count, columns = index * N_COEFFICIENTS * size * rows, size * rows, tables.columns
    for place in range(0, count, LANES):
        at = start + place
        combine(propagator, place, ZERO, 0, 1.0, columns, at, count, powers, 0, N_COEFFICIENTS)
    _multiply(propagator, 0, rows, tangent)


@inlined
def tangent_of_steps(index, n_steps, tangent, tables):
    """Multiply `tangent` by exp(M n h) of table `index`, in place, by the powers kept."""
    size, rows = tables.powers.shape[2], tables.powers.shape[3]
    if n_steps & 1:
        _multiply(tables.step, index * tables.step.shape[1] * rows, rows, tangent)
    left = n_steps >> 1
    for power in range(N_POWERS):
        times = left & 1 if power < N_POWERS - 1 else left
        for _ in range(times):
            _multiply(tables.powers, (index * N_POWERS + power) * size * rows, rows, tangent)
        left >>= 1


@inlined
def _multiply(table, start, rows, tangent):
    """Multiply `tangent` by the matrix with the columns table[start:], of padded `rows`."""
    size, columns = tangent.shape
    column, product = local_vector(size), local_vector(rows)
    for k in range(columns):
        for i in range(size):
            column[i] = tangent[i, k]
        for first in range(0, rows, LANES):
            at = start + first
            combine(product, first, ZERO, 0, 1.0, table, at, rows, column, 0, size)
        for i in range(size):
            tangent[i, k] = product[i]
