r"""Outputs of the linear motion, whose peaks a record is asked for, as tables of a contact set.

An output is q = l . (y, y') + c, with l and c of the contact set: displacements of floors, drifts,
absolute accelerations and distances of closed contacts past their stops, in this order. A floor's
absolute acceleration is what its springs, dampers and contacts do,

    u'' - f G = -M^-1 K u - M^-1 C u' - sum_k beta_k x_k e_k

(f = -1 where a base shakes), so that it does not jump with G'. With x' = M x of `tables` an output
has the slope l . (y', y''), linear in the augmented state x, too. A table holds the rows of values
and slopes, and bounds of |q''''| on a step, from the polynomials of the motion: what the Hermite
bound of `search` needs to tell that a peak cannot be exceeded.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.places import zeros
from hpcsweep.model.kernel_model import Model, record_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.linear.propagators import max_fourth_derivative
from hpcsweep.solvers.flow.state.contacts import contact_bit
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, Tables, empty_tables, padded


class Outputs(NamedTuple):
    """Tables of outputs, P of them, padded to Q, and what is gathered of them."""

    key: np.ndarray
    """(MAX_TABLES,) uint64: contact set of each table ..."""
    is_filled: np.ndarray
    """... and whether it is there."""
    rows: np.ndarray
    """(MAX_TABLES, P, 2R): l ..."""
    constant: np.ndarray
    """(MAX_TABLES, P): ... and c."""
    pair: np.ndarray
    """(MAX_TABLES, N, 2Q): column k of values and slopes per x_k."""
    bound4: np.ndarray
    """(MAX_TABLES, N, Q): column k bounds |q''''| per |x_k|."""
    sides: np.ndarray
    """(Q,): 1 where the peak is one of |q|, 0 where it is one of q."""
    peaks: np.ndarray
    """(Q,)"""
    times: np.ndarray
    """(Q,): of the peaks."""
    start: np.ndarray
    """(2Q,): values and slopes at the start of a step ..."""
    end: np.ndarray
    """... and at its end; workspace."""
    bounds: np.ndarray
    """(Q,): workspace ..."""
    x_end: np.ndarray
    """(N,): ..."""
    accelerations: np.ndarray
    """(R, N): ... of those who build a table ..."""
    coefficients: np.ndarray
    """(N_COEFFICIENTS,): ... or search."""


def new_outputs(model: Model, tables: Tables) -> Outputs:
    """Allocate the outputs of a structure; pages are touched when used."""
    capacity, size = tables.keys.shape[0], tables.step.shape[1]
    n, n_rows = model.modal_transform.shape[0], model.stiffness.shape[0]
    n_contacts = model.contacts.row.size
    count = 2 * n + len(model.drift_rows) + n_contacts
    wide = padded(count)
    sides = np.zeros(wide)
    sides[: count - n_contacts] = 1.0
    return Outputs(
        key=zeros(capacity, dtype=np.uint64),
        is_filled=zeros(capacity, dtype=bool),
        rows=zeros(capacity, count, 2 * n_rows),
        constant=zeros(capacity, count),
        pair=zeros(capacity, size, 2 * wide),
        bound4=zeros(capacity, size, wide),
        sides=sides,
        peaks=zeros(wide),
        times=zeros(wide),
        start=zeros(2 * wide),
        end=zeros(2 * wide),
        bounds=zeros(wide),
        x_end=zeros(size),
        accelerations=zeros(n_rows, size),
        coefficients=zeros(N_COEFFICIENTS),
    )


def _example() -> Outputs:
    model = record_model(Structure(1), 1.0)
    return new_outputs(model, empty_tables(model))


OUTPUTS = Arena(_example())
read_outputs = OUTPUTS.read


@kernel
def fill_outputs(index, model, tables, outputs):
    """Fill table `index` of the outputs for the contact set of that of the motion, once."""
    key = tables.keys[index]
    if outputs.is_filled[index] and outputs.key[index] == key:
        return
    outputs.is_filled[index], outputs.key[index] = True, key
    rows, constant = outputs.rows[index], outputs.constant[index]
    _write_functionals(key, model, rows, constant)
    _write_accelerations(key, model, outputs.accelerations)
    _write_pairs(rows, constant, outputs.accelerations, outputs.pair[index])
    poly, h = tables.poly[index], tables.h[index]
    coefficients = outputs.coefficients
    for p in range(rows.shape[0]):
        for column in range(poly.shape[1]):
            for c in range(N_COEFFICIENTS):
                coefficients[c] = 0.0
            for j in range(rows.shape[1]):
                if rows[p, j] != 0.0:
                    for c in range(N_COEFFICIENTS):
                        coefficients[c] += rows[p, j] * poly[j, column, c]
            outputs.bound4[index, column, p] = max_fourth_derivative(coefficients, h)


@kernel
def _write_functionals(key, model, rows, constant):
    """Write l and c of all outputs."""
    n, n_rows = model.modal_transform.shape[0], model.stiffness.shape[0]
    contacts = model.contacts
    for p in range(rows.shape[0]):
        constant[p] = 0.0
        for j in range(rows.shape[1]):
            rows[p, j] = 0.0
    for i in range(n):
        rows[i, i] = 1.0
    for d in range(model.drift_rows.shape[0]):
        i, below = model.drift_rows[d]
        rows[n + d, i] = 1.0
        if below >= 0:
            rows[n + d, below] = -1.0
    first = n + model.drift_rows.shape[0]
    for i in range(n):
        for j in range(n):
            rows[first + i, j] = -model.stiffness[i, j]
            rows[first + i, n_rows + j] = -model.damping[i, j]
    for k in range(contacts.row.shape[0]):
        if key & contact_bit(k) == np.uint64(0):
            continue
        row, sign, gap = contacts.row[k], contacts.sign[k], contacts.gap[k]
        for i in range(n):
            push = contacts.beta[k] * contacts.kick[k, i]
            rows[first + i, row] -= push * sign
            constant[first + i] += push * gap
        rows[first + n + k, row] = sign
        constant[first + n + k] = -gap


@kernel
def _write_accelerations(key, model, out):
    """Write y'' of all rows as rows of the augmented state."""
    n_rows = model.stiffness.shape[0]
    contacts = model.contacts
    last = out.shape[1] - 1
    for i in range(n_rows):
        for j in range(n_rows):
            out[i, j] = -model.stiffness[i, j]
            out[i, n_rows + j] = -model.damping[i, j]
        for j in range(2 * n_rows, last + 1):
            out[i, j] = 0.0
        out[i, 2 * n_rows] = model.forcing[i]
        for k in range(contacts.row.shape[0]):
            if key & contact_bit(k):
                push = contacts.beta[k] * contacts.kick[k, i]
                out[i, contacts.row[k]] -= push * contacts.sign[k]
                out[i, last] += push * contacts.gap[k]


@kernel
def _write_pairs(rows, constant, accelerations, pair):
    """Write the columns of values and slopes."""
    n_rows = accelerations.shape[0]
    size, wide = pair.shape[0], pair.shape[1] // 2
    for p in range(rows.shape[0]):
        for column in range(size):
            value = rows[p, column] if column < 2 * n_rows else 0.0
            slope = rows[p, column - n_rows] if n_rows <= column < 2 * n_rows else 0.0
            for j in range(n_rows):
                slope += rows[p, n_rows + j] * accelerations[j, column]
            pair[column, p] = value
            pair[column, wide + p] = slope
        pair[size - 1, p] = constant[p]


@kernel
def clear_outputs(outputs):
    """Begin anew."""
    for p in range(outputs.peaks.shape[0]):
        outputs.peaks[p] = outputs.times[p] = 0.0
