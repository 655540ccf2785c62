"""Exact propagators of the linear motion between contact changes, one table a contact set.

While no contact is inside its layer the sigmoid is 0 or 1 to rounding, and with the set c of
contacts that touch (c_k in {0, 1}) the motion is linear with constant coefficients (symbols as in
`hpcsweep.model.kernel_model`)::

    u'' + D u' + (K + sum_k c_k beta_k e_k d_k^T) u = sum_k c_k beta_k g_k e_k + f G(tau)

With the augmented state x = (y, y', s_1, c_1, .., s_H, c_H, 1), shape (N,) with N = 2 R + 2 H + 1
and s_h, c_h = A a_h (sin, cos)(h Omega tau + phi_h), it is x' = M x, and M depends on c but not on
A. Rows beyond n are outputs: y = E u. A table holds, for one set,

- ``step``: exp(M h), the propagator over one full step h;
- ``poly``: exp(M s), 0 <= s <= h, as polynomials in sigma = 2 s / h - 1 of degree `DEGREE`;
- ``bound4``: a bound of |y_i''''| on the step, linear in |x|, which proves that no contact is
  reached (see `search`).

Size of the step. theta = h max(|lambda(M)|) is at most `THETA`. The Chebyshev coefficients of
exp(i theta sigma / 2) are Bessel functions, |c_k| = 2 |J_k(theta / 2)| <= 2 (theta/4)^k / k!,
so that the truncated tail is below 2 (0.9)^16 / 16! = 2e-14 for theta = 3.6 and degree 15. The
polynomial is found as the Taylor series about the middle of the step to order `TAYLOR`, whose
terms (theta/2)^k / k! never exceed 1.7 (no cancellation), economised to degree 15 through the
Chebyshev basis. Velocities are scaled by the largest frequency first, so that M is balanced.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, jit, kernel
from hpcsweep.kernels.separate import INT, KEY, separate, type_of
from hpcsweep.kernels.vectors import (
    LANES,
    aligned_zeros,
    combine,
    combine_moduli,
    fma,
    greatest,
    load,
    maximum,
    modulus,
    store,
)
from hpcsweep.model.kernel_model import Model, kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.economisation import economisation
from hpcsweep.solvers.flow.series import build_series

DEGREE = 15
N_COEFFICIENTS = DEGREE + 1
TAYLOR = 30
THETA = 3.6
THETA_FREE = 2.2
"""Free flight: shorter, because the proof that no floor reaches the stop weakens with h^4."""
MAX_TABLES = 64
"""Tables kept; when more contact sets occur the table store is emptied and filled anew."""
BOUND_SAMPLES = np.linspace(-1.0, 1.0, 9 * LANES)
MODAL_NODES, MODAL_WEIGHTS = np.polynomial.legendre.leggauss(2 * LANES)
"""Of the modal norms (`modal_norm`), on a step."""
N_MODAL = MODAL_NODES.shape[0]
ZERO = np.zeros(LANES)


ECONOMISATION = economisation(TAYLOR, DEGREE)
"""(TAYLOR + 1, N_COEFFICIENTS)"""


class Tables(NamedTuple):
    """Propagators of the contact sets met so far; `count[0]` of them are valid."""

    count: np.ndarray
    keys: np.ndarray
    h: np.ndarray
    step: np.ndarray
    """(MAX_TABLES, N, padded 2R): column k of exp(M h), its first 2R rows, contiguous; rows are
    padded with zeros to a multiple of `LANES`."""
    poly: np.ndarray
    """(MAX_TABLES, 2R, N, N_COEFFICIENTS)"""
    columns: np.ndarray
    """(MAX_TABLES, N_COEFFICIENTS, 2R, padded 2R): the same once more, without the forcing, by
    coefficient, column, then row."""
    bound4: np.ndarray
    """(MAX_TABLES, N, padded R): column k bounds the fourth derivatives per |x_k|."""
    rotation: np.ndarray
    """(MAX_TABLES, 2 H): cos and sin of h Omega times the step, for each harmonic."""
    series: np.ndarray
    """(MAX_TABLES, m, N, LANES): Taylor series of the distance of each contact, see `series` ..."""
    impulses: np.ndarray
    """(MAX_TABLES, m, LANES, padded 2R): ... and of what its unit impulse does."""
    modal: np.ndarray
    """(1, N, padded n N_MODAL): the modal coordinates at the nodes `MODAL_NODES` of a step of free
    flight, column k per x_k, rows by mode, then node."""


def padded(n: int) -> int:
    """Round a number of rows up to a multiple of `LANES`."""
    return -(-n // LANES) * LANES


def empty_tables(model: Model) -> Tables:
    """Allocate the tables of a structure at one frequency; pages are touched when used."""
    capacity = min(2**model.contacts.row.size, MAX_TABLES)
    n, n_harmonics = model.stiffness.shape[0], model.harmonics.shape[0]
    n_modes = model.modal_transform.shape[0]
    size = 2 * n + 2 * n_harmonics + 1
    return Tables(
        count=np.zeros(1, dtype=np.int64),
        keys=np.zeros(capacity, dtype=np.uint64),
        h=np.zeros(capacity),
        step=aligned_zeros(capacity, size, padded(2 * n)),
        poly=aligned_zeros(capacity, 2 * n, size, N_COEFFICIENTS),
        columns=aligned_zeros(capacity, N_COEFFICIENTS, 2 * n, padded(2 * n)),
        bound4=aligned_zeros(capacity, size, padded(n)),
        rotation=np.empty((capacity, 2 * n_harmonics)),
        series=aligned_zeros(capacity, model.contacts.row.size, size, LANES),
        impulses=aligned_zeros(capacity, model.contacts.row.size, LANES, padded(2 * n)),
        modal=aligned_zeros(1, size, padded(n_modes * N_MODAL)),
    )


_EXAMPLE = kernel_model(Structure(1), 1.0)
MODEL, TABLES = type_of(_EXAMPLE), type_of(empty_tables(_EXAMPLE))
"""The same for structures of any size."""


@inlined
def table_of(key, model, tables):
    """Give what `lookup` gives, without a call where the table is at hand."""
    for index in range(tables.count[0]):
        if tables.keys[index] == key:
            return index
    return lookup(key, model, tables)


@separate(INT, KEY, MODEL, TABLES, counted=True)
def lookup(key, model, tables):
    """Return the index of the table of contact set `key`, building it once.

    Parameters
    ----------
    key : uint64
        Contact set.
    """
    for index in range(tables.count[0]):
        if tables.keys[index] == key:
            return index
    if tables.count[0] == tables.keys.shape[0]:
        tables.count[0] = 0
    index = tables.count[0]
    _build(key, model, tables, index)
    tables.keys[index] = key
    tables.count[0] = index + 1
    return index


@jit
def _generator(key, model, scale, out):
    """Write M of the coordinates u into `out`, (2n + 2H + 1, the same), balanced.

    Displacements are measured in units of ``model.balance``, velocities in these times `scale`, and
    the forcing in units of `scale`.
    """
    n = model.modal_transform.shape[0]
    contacts, unit = model.contacts, model.balance
    last = out.shape[0] - 1
    out[:] = 0.0
    for i in range(n):
        out[i, n + i] = scale
        for j in range(n):
            ratio = unit[j] / unit[i]
            out[n + i, j] = -model.stiffness[i, j] * ratio / scale
            out[n + i, n + j] = -model.damping[i, j] * ratio
        for h in range(2 * n, last, 2):
            out[n + i, h] = model.forcing[i] / unit[i]
    for k in range(contacts.row.shape[0]):
        if (key >> np.uint64(k)) & np.uint64(1):
            for i in range(n):
                push = contacts.beta[k] * contacts.kick[k, i] / (unit[i] * scale)
                if push != 0.0:
                    for j in range(n):
                        out[n + i, j] -= push * contacts.reach[k, j] * unit[j]
                    out[n + i, last] += push * contacts.gap[k]
    for h in range(model.harmonics.shape[0]):
        at = 2 * n + 2 * h
        out[at, at + 1] = model.harmonics[h, 0] * model.omega
        out[at + 1, at] = -model.harmonics[h, 0] * model.omega
    return out


@jit
def _spectral_bound(key, model):
    """Bound the moduli of the eigenvalues of M.

    For an eigenvector with displacements q, q* M q = 1, lambda^2 + d lambda + k = 0 with d = q* C q
    and k = q* (K + contacts) q. If the roots are complex |lambda|^2 = k, if not |lambda| <= d.
    """
    energy = model.energy
    contact = energy.stiffness.copy()
    n = contact.shape[0]
    for k in range(energy.kappa.shape[0]):
        if (key >> np.uint64(k)) & np.uint64(1):
            for i in range(n):
                for j in range(n):
                    contact[i, j] += energy.kappa[k] * energy.reach[k, i] * energy.reach[k, j]
    hardest = math.sqrt(np.linalg.eigvalsh(contact)[-1])
    fastest = model.omega
    for h in range(model.harmonics.shape[0]):
        fastest = max(fastest, model.harmonics[h, 0] * model.omega)
    return max(hardest, max(energy.drag, fastest))


@jit
def _build(key, model, tables, index):
    """Fill table `index` with the propagators of contact set `key`."""
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    n_forcing = 2 * model.harmonics.shape[0]
    size = 2 * n + n_forcing + 1
    scale = np.sqrt(model.stiffness_bound + (model.hardest if key != np.uint64(0) else 0.0))
    generator = np.empty((size, size))
    _generator(key, model, scale, generator)
    radius = _spectral_bound(key, model)
    h = (THETA if key != np.uint64(0) else THETA_FREE) / radius
    tables.h[index] = h
    for k in range(n_forcing // 2):
        angle = model.harmonics[k, 0] * model.omega * h
        tables.rotation[index, 2 * k] = np.cos(angle)
        tables.rotation[index, 2 * k + 1] = np.sin(angle)

    half = np.eye(size)
    term = np.eye(size)
    for k in range(1, TAYLOR + 1):
        term = np.dot(generator, term) * (0.5 * h / k)
        half += term
    full = np.dot(half, half)

    # x in the units of the model: balance for u, times s for v, s * forcing, 1 with s = scale
    unit = np.ones(size)
    unit[2 * n : size - 1] = scale
    for i in range(n):
        unit[i] = model.balance[i]
        unit[n + i] = model.balance[i] * scale
    # where a column of the base lies among those of all rows
    places = np.arange(size)
    places[n:] += n_rows - n
    places[2 * n :] += n_rows - n
    series, impulses = tables.series[index], tables.impulses[index]
    build_series(generator, unit, places, model, series, impulses)
    for k in range(size):
        _write_rows(full[:, k], unit, k, model, tables.step[index, places[k]])
    poly = tables.poly[index]
    poly[:] = 0.0
    term = half
    rows = np.empty(2 * n_rows)
    for k in range(TAYLOR + 1):
        if k > 0:
            term = np.dot(generator, term) * (0.5 * h / k)
        for column in range(size):
            _write_rows(term[:, column], unit, column, model, rows)
            for row in range(2 * n_rows):
                place = (row * poly.shape[1] + places[column]) * N_COEFFICIENTS
                for p in range(0, N_COEFFICIENTS, LANES):
                    more = load(ECONOMISATION, k * N_COEFFICIENTS + p) * rows[row]
                    store(poly, place + p, load(poly, place + p) + more)
    for p in range(N_COEFFICIENTS):
        for column in range(2 * n_rows):
            for row in range(2 * n_rows):
                tables.columns[index, p, column, row] = poly[row, column, p]
    if key == np.uint64(0):
        _build_modal(model, poly, tables.modal)
    for row in range(n_rows):
        for column in range(poly.shape[1]):
            tables.bound4[index, column, row] = _max_fourth_derivative(poly[row, column], h)


@jit
def _write_rows(entries, unit, column, model, out):
    """Write a balanced column of the base as one of all rows, in the units of the model."""
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    for i in range(n):
        out[i] = entries[i] * unit[i] / unit[column]
        out[n_rows + i] = entries[n + i] * unit[n + i] / unit[column]
    for extra in range(n_rows - n):
        value, slope = 0.0, 0.0
        for j in range(n):
            value += model.rows[extra, j] * out[j]
            slope += model.rows[extra, j] * out[n_rows + j]
        out[n + extra] = value
        out[n_rows + n + extra] = slope


@kernel
def _build_modal(model, poly, modal):
    """Fill the table of modal coordinates from the polynomials of free flight.

    The modes ask for no row beyond n.
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
def product(table, index, x, out):
    """Multiply the columns ``table[index]`` by x into `out`, whose length is padded to `LANES`."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])


@kernel
def product_of_moduli(table, index, x, out):
    """Multiply as `product`, by the moduli |x|."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine_moduli(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])


@kernel
def _max_fourth_derivative(coefficients, h):
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
