"""The tangent map along the motion: product of the propagators of its segments.

The field is continuous, so a change of contact set alone adds nothing. The three kinds of
segment of `period` give

- linear: exp(M s), from the tables;
- fast passage: the kick k(z, tau) of `crossing` is applied where the linear motion reaches the
  stop, at a time that moves by dt = -dx / v with the distance x past it, v its speed. With the
  fields f_- before and f_+ after it::

      S = I + Dk - (Dk f_- + dk/dtau - M_+ k) dx^T / v,        f_+(z + k) - f_-(z) = M_+ k

  The kick depends on z through the speed v and the acceleration a (and through the jerk, so little
  that it is left out). Its moments are sums over nodes X of c t^k / w, with w(X)^2 of `crossing`
  and t = +-2 X / (|v*| + w), so that their derivatives are those sums with the factors
  -w' / w - k (|v*|' + w') / (|v*| + w), where, upper signs at x > 0,

      d|v*|/dv = v / |v*|,    dw/dv = (v - sigma j X^2 v / (2 |v*|^3)) / w,    dw/da = +-X / w;

- inside a layer: the variational equations of the collocation solution, at the same stages.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.vectors import LANES, aligned_zeros, combine, fma
from hpcsweep.solvers.flow.crossing import add_kick, half_passage, sums
from hpcsweep.solvers.flow.tables import N_COEFFICIENTS, N_POWERS, ZERO, padded


class TangentWorkspace(NamedTuple):
    """Workspace.

    Attributes
    ----------
    propagator : ndarray, shape (2R, padded 2R)
        By columns.
    powers : ndarray, shape (N_COEFFICIENTS,)
    column, product : ndarray, shape (padded 2R,)
    kicks : ndarray, shape (4, 2R)
    """

    propagator: np.ndarray
    powers: np.ndarray
    column: np.ndarray
    product: np.ndarray
    kicks: np.ndarray


def new_tangent_workspace(n: int) -> TangentWorkspace:
    """Allocate the workspace for n rows of displacements."""
    rows = padded(2 * n)
    return TangentWorkspace(
        aligned_zeros(2 * n, rows),
        aligned_zeros(N_COEFFICIENTS),
        aligned_zeros(rows),
        aligned_zeros(rows),
        aligned_zeros(4, 2 * n),
    )


@inlined
def linear_tangent(tables, index, s, tangent, work):
    """Multiply `tangent` by exp(M s) of table `index`, in place.

    Parameters
    ----------
    tables : Tables
    index : int
    s : float
    tangent : ndarray, shape (2R, m)
    work : TangentWorkspace
    """
    size = tangent.shape[0]
    rows = work.propagator.shape[1]
    h = tables.h[index]
    if s == h:
        _multiply(tables.step, index * tables.step.shape[1] * rows, tangent, work)
        return
    sigma = 2.0 * s / h - 1.0
    powers = work.powers
    powers[0] = 1.0
    powers[1] = sigma
    for p in range(2, N_COEFFICIENTS):
        powers[p] = powers[p - 2] * (sigma * sigma)
    start = index * N_COEFFICIENTS * size * rows
    for place in range(0, size * rows, LANES):
        combine(
            work.propagator,
            place,
            ZERO,
            0,
            1.0,
            tables.columns,
            start + place,
            size * rows,
            powers,
            0,
            N_COEFFICIENTS,
        )
    _multiply(work.propagator, 0, tangent, work)


@inlined
def coasted_tangent(tables, index, n_steps, tangent, work):
    """Multiply `tangent` by exp(M n h) of table `index`, in place, by the powers kept."""
    if tangent.shape[1] == 0:
        return
    size, rows = tables.powers.shape[2], tables.powers.shape[3]
    if n_steps & 1:
        _multiply(tables.step, index * tables.step.shape[1] * rows, tangent, work)
    left = n_steps >> 1
    for power in range(N_POWERS):
        times = left & 1 if power < N_POWERS - 1 else left
        for _ in range(times):
            _multiply(tables.powers, (index * N_POWERS + power) * size * rows, tangent, work)
        left >>= 1


@inlined
def _multiply(table, start, tangent, work):
    """Multiply `tangent` by the matrix with the columns table[start:], padded, in place."""
    size, columns = tangent.shape
    rows = work.column.shape[0]
    for column in range(columns):
        for k in range(size):
            work.column[k] = tangent[k, column]
        for first in range(0, rows, LANES):
            combine(
                work.product, first, ZERO, 0, 1.0, table, start + first, rows, work.column, 0, size
            )
        for k in range(size):
            tangent[k, column] = work.product[k]


@inlined
def _rates(powers, shares, times):
    """Differentiate c t^k / w, k = 0 to 4, of logarithmic derivatives -`shares` and -`times`."""
    return (
        -1.0 * powers[0] * shares,
        -1.0 * powers[1] * (shares + times),
        -1.0 * powers[2] * fma(2.0, times, shares),
        -1.0 * powers[3] * fma(3.0, times, shares),
        -1.0 * powers[4] * fma(4.0, times, shares),
    )


@inlined
def _differentiated(side, v, a, j, beta, rho):
    """Give the moments of half a passage node by node; see the module.

    Parameters
    ----------
    side : float
        1 for the half at x > 0, -1 for that at x < 0.
    beta : float
    v, a, j, rho : float
        As for `crossing.moments`.

    Returns
    -------
    moments, by_speed, by_acceleration : tuple of Lanes
        m_0 to m_4 and their derivatives.
    """
    powers, x, w, speed = half_passage(side, v, a, j, beta, rho)
    inverse = 1.0 / w
    later = 1.0 / (w + speed)
    bend = j / speed if v > 0.0 else -j / speed
    faster = fma(x * x, -0.5 * bend * v / (speed * speed), v) * inverse
    pushed = x * inverse * side
    return (
        powers,
        _rates(powers, faster * inverse, (faster + v / speed) * later),
        _rates(powers, pushed * inverse, pushed * later),
    )


@inlined
def passage_tangent(arrival, z, a, jerk, model, work, tangent):
    """Multiply `tangent` by the matrix S of a fast passage, in place.

    Parameters
    ----------
    arrival : Arrival
        Its `key` is the contact set after the passage.
    z : ndarray, shape (2R,)
        State at the stop before the kick.
    a : ndarray, shape (R,)
        Accelerations there without the force of the contact.
    jerk : float
        Their derivative in its row.
    work : TangentWorkspace
    tangent : ndarray, shape (2R, m)
    """
    contact, key_after = arrival.contact, arrival.key
    contacts = model.contacts
    beta, rho = contacts.beta[contact], model.rho
    if rho == math.inf or beta == 0.0:
        return
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    row, sign = contacts.row[contact], contacts.sign[contact]
    v, pushed_by, bend = sign * z[n + row], sign * a[row], sign * jerk
    free = _differentiated(-1.0, v, pushed_by, bend, beta, rho)
    inside = _differentiated(1.0, v, pushed_by, bend, beta, rho)
    kicks = work.kicks
    kicks[:] = 0.0
    for which in range(3):
        add_kick(sums(free[which], inside[which]), contact, key_after, model, kicks[which])
    kick, by_speed, by_acceleration, drift = kicks[0], kicks[1], kicks[2], kicks[3]
    # along f_- the speed changes by a and the acceleration by the jerk; less M_+ k
    for i in range(n):
        drift[i] = -kick[n + i]
        drift[n + i] = 0.0
    for k in range(contacts.row.shape[0]):
        if (key_after >> np.uint64(k)) & np.uint64(1):
            force = contacts.beta[k] * contacts.sign[k] * kick[contacts.row[k]]
            for p in range(contacts.first[k], contacts.first[k + 1]):
                drift[n + contacts.push_row[p]] += contacts.push[p] * force
    for i in range(n):
        force = drift[n + i]
        for j in range(n):
            force += stiffness[i, j] * kick[j] + damping[i, j] * kick[n + j]
        drift[n + i] = force
    for i in range(2 * n):
        drift[i] += by_speed[i] * pushed_by + by_acceleration[i] * bend
    for column in range(tangent.shape[1]):
        later = sign * tangent[row, column] / v
        faster = sign * tangent[n + row, column]
        pushed = 0.0
        for j in range(n):
            pushed -= stiffness[row, j] * tangent[j, column]
            pushed -= damping[row, j] * tangent[n + j, column]
        pushed *= sign
        if contacts.is_oblique:
            for k in range(contacts.row.shape[0]):
                if k != contact and (key_after >> np.uint64(k)) & np.uint64(1):
                    stretched = contacts.sign[k] * tangent[contacts.row[k], column]
                    pushed -= contacts.oblique[contact, k] * contacts.beta[k] * stretched
        for i in range(2 * n):
            tangent[i, column] += (
                by_speed[i] * faster + by_acceleration[i] * pushed - drift[i] * later
            )
