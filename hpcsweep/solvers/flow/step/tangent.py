"""Tangent map of a linear step by its table: exp(M s), and powers of a whole step."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import LANES, combine
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, N_POWERS, ZERO


@inlined
def table_tangent(index, s, tangent, tables, scratch):
    """Multiply `tangent` by exp(M s) of table `index`, in place.

    Parameters
    ----------
    index : int
    s : float
    tangent : ndarray, shape (2R, m)
    tables : Tables
    scratch : TangentWorkspace
    """
    size, rows = tangent.shape[0], scratch.propagator.shape[1]
    sigma = 2.0 * s / tables.h[index] - 1.0
    powers = scratch.powers
    powers[0] = 1.0
    powers[1] = sigma
    for p in range(2, N_COEFFICIENTS):
        powers[p] = powers[p - 2] * (sigma * sigma)
    start, count, columns = index * N_COEFFICIENTS * size * rows, size * rows, tables.columns
    for place in range(0, count, LANES):
        at, out = start + place, scratch.propagator
        combine(out, place, ZERO, 0, 1.0, columns, at, count, powers, 0, N_COEFFICIENTS)
    _multiply(scratch.propagator, 0, tangent, scratch)


@inlined
def tangent_of_steps(index, n_steps, tangent, tables, scratch):
    """Multiply `tangent` by exp(M n h) of table `index`, in place, by the powers kept."""
    size, rows = tables.powers.shape[2], tables.powers.shape[3]
    if n_steps & 1:
        _multiply(tables.step, index * tables.step.shape[1] * rows, tangent, scratch)
    left = n_steps >> 1
    for power in range(N_POWERS):
        times = left & 1 if power < N_POWERS - 1 else left
        for _ in range(times):
            _multiply(tables.powers, (index * N_POWERS + power) * size * rows, tangent, scratch)
        left >>= 1


@inlined
def _multiply(table, start, tangent, scratch):
    """Multiply `tangent` by the matrix with the columns table[start:], padded, in place."""
    size, columns = tangent.shape
    rows = scratch.column.shape[0]
    for column in range(columns):
        for k in range(size):
            scratch.column[k] = tangent[k, column]
        for first in range(0, rows, LANES):
            combine(
                scratch.product,
                first,
                ZERO,
                0,
                1.0,
                table,
                start + first,
                rows,
                scratch.column,
                0,
                size,
            )
        for k in range(size):
            tangent[k, column] = scratch.product[k]
