"""Exact propagators of the linear motion between contact changes, one table a contact set.

While no contact is inside its layer the sigmoid is 0 or 1 to rounding, and with the set c of
contacts that touch (c_k in {0, 1}) the motion is linear with constant coefficients (symbols as in
`hpcsweep.model.kernel_model`)::

    u'' + D u' + (K + sum_k c_k beta_k e_k d_k^T) u = sum_k c_k beta_k g_k e_k + f G(tau)

With the augmented state x = (y, y', s_1, c_1, .., s_H, c_H, 1), shape (N,) with N = 2 R + 2 H + 1
and s_h, c_h = A a_h (sin, cos)(h Omega tau + phi_h), it is x' = M x, and M depends on c but not on
A. Where G is linear along a period one pair (G, G') replaces those. Rows beyond n are
outputs: y = E u. A table holds, for one set,

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

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.places import zeros
from hpcsweep.kernels.simd.vectors import LANES, combine, combine_moduli
from hpcsweep.model.kernel_model import Model, forcing_size
from hpcsweep.solvers.flow.rules.economisation import economisation

DEGREE = 15
N_COEFFICIENTS = DEGREE + 1
TAYLOR = 30
THETA = 3.6
THETA_FREE = 2.2
"""Free flight: shorter, because the proof that no floor reaches the stop weakens with h^4."""
MAX_TABLES = 64
"""Most tables; when more contact sets occur the table store is emptied and refilled."""
N_POWERS = 4
"""Powers of the propagator of a step that are kept: exp(M h 2^k), k = 1, .., `N_POWERS`."""
BOUND_SAMPLES = np.linspace(-1.0, 1.0, 9 * LANES)
MODAL_NODES, MODAL_WEIGHTS = np.polynomial.legendre.leggauss(2 * LANES)
"""Of the modal norms (`modal_norm`), on a step."""
N_MODAL = MODAL_NODES.shape[0]
ZERO = np.zeros(LANES)


ECONOMISATION = economisation(TAYLOR, DEGREE)
"""(TAYLOR + 1, N_COEFFICIENTS)"""


class Tables(NamedTuple):
    """Propagators of the contact sets so far; `count[0]` of them are valid."""

    count: np.ndarray
    keys: np.ndarray
    h: np.ndarray
    step: np.ndarray
    """(MAX_TABLES, N, padded 2R): column k of exp(M h), its first 2R rows, contiguous; rows are
    padded with zeros to a multiple of `LANES`."""
    powers: np.ndarray
    """(MAX_TABLES, N_POWERS, 2R, padded 2R): the same over 2, 4, .. steps, without the forcing."""
    poly: np.ndarray
    """(MAX_TABLES, 2R, N, N_COEFFICIENTS)"""
    columns: np.ndarray
    """(MAX_TABLES, N_COEFFICIENTS, 2R, padded 2R): the same again, without the forcing, by
    coefficient, column, then row."""
    bound4: np.ndarray
    """(MAX_TABLES, N, padded R): column k bounds the fourth derivatives per |x_k|."""
    rotation: np.ndarray
    """(MAX_TABLES, 2 H): cos and sin of h Omega times the step, for each harmonic."""
    series: np.ndarray
    """(MAX_TABLES, m, N, LANES): Taylor series of the distance of each contact, see `series` ..."""
    impulses: np.ndarray
    """(MAX_TABLES, m, LANES, padded 2R): ... and of the effect of its unit impulse."""
    work: np.ndarray
    """(4, 2n + 2H + 1, padded): workspace for building a table: matrices ..."""
    vectors: np.ndarray
    """(3, 2n + 2H + 1): ... vectors ..."""
    energy: np.ndarray
    """(n, n): ... the stiffness of all closed contacts ..."""
    rows: np.ndarray
    """(2R,): ... and a column of all rows."""
    modal: np.ndarray
    """(1, N, padded n N_MODAL): the modal coordinates at the nodes `MODAL_NODES` of a step of free
    flight, column k per x_k, rows by mode, then node."""


def padded(n: int) -> int:
    """Round a number of rows up to a multiple of `LANES`."""
    return -(-n // LANES) * LANES


def empty_tables(model: Model) -> Tables:
    """Allocate the tables of a structure at one frequency; pages are touched on first use."""
    capacity = min(2**model.contacts.row.size, MAX_TABLES)
    n, n_forcing = model.stiffness.shape[0], forcing_size(model)
    n_modes = model.modal_transform.shape[0]
    size = 2 * n + n_forcing + 1
    base = 2 * n_modes + n_forcing + 1
    return Tables(
        count=zeros(1, dtype=int),
        keys=zeros(capacity, dtype=np.uint64),
        h=zeros(capacity),
        step=zeros(capacity, size, padded(2 * n)),
        powers=zeros(capacity, N_POWERS, 2 * n, padded(2 * n)),
        poly=zeros(capacity, 2 * n, size, N_COEFFICIENTS),
        columns=zeros(capacity, N_COEFFICIENTS, 2 * n, padded(2 * n)),
        bound4=zeros(capacity, size, padded(n)),
        rotation=zeros(capacity, 2 * len(model.harmonics)),
        series=zeros(capacity, model.contacts.row.size, size, LANES),
        impulses=zeros(capacity, model.contacts.row.size, LANES, padded(2 * n)),
        work=zeros(4, base, padded(base)),
        vectors=zeros(3, base),
        energy=zeros(n_modes, n_modes),
        rows=zeros(2 * n),
        modal=zeros(1, size, padded(n_modes * N_MODAL)),
    )


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
