r"""The tangent map along the motion: product of the propagators of its segments.

The field is continuous, so a change of contact set alone adds nothing. The three kinds of
segment of `period` give

- linear: exp(M s), from the tables;
- fast passage: the kick k(z, tau) of `crossing` is applied where the linear motion reaches the
  stop, at a time that moves by dt = -du_f / v_f with the state. With the fields f_- before and
  f_+ after it::

      S = I + Dk - (Dk f_- + dk/dtau - M_+ k) e_f^T / v_f,        f_+(z + k) - f_-(z) = M_+ k

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
from hpcsweep.kernels.vectors import (
    LANES,
    aligned_zeros,
    combine,
    fma,
    load,
    maximum,
    store,
)
from hpcsweep.model.contact import STOP, contact_stiffnesses
from hpcsweep.solvers.flow.crossing import add_kick, half_passage, sums
from hpcsweep.solvers.flow.layer import (
    MAX_ITERATIONS,
    N_STAGES,
    NODES,
    integrals,
    iterations_needed,
    less_linear,
    replace,
    stages,
)
from hpcsweep.solvers.flow.tables import N_COEFFICIENTS, ZERO, padded

CONVERGED = 1e-13
"""Last change of the stage accelerations, or the next one, relative."""


class TangentRoom(NamedTuple):
    """Room.

    Attributes
    ----------
    propagator : ndarray, shape (2n, padded 2n)
        By columns.
    powers : ndarray, shape (N_COEFFICIENTS,)
    column, product : ndarray, shape (padded 2n,)
    kicks : ndarray, shape (4, 2n)
    """

    propagator: np.ndarray
    powers: np.ndarray
    column: np.ndarray
    product: np.ndarray
    kicks: np.ndarray


def empty_tangent_room(n: int) -> TangentRoom:
    """Allocate the room for n floors."""
    rows = padded(2 * n)
    return TangentRoom(
        aligned_zeros(2 * n, rows),
        aligned_zeros(N_COEFFICIENTS),
        aligned_zeros(rows),
        aligned_zeros(rows),
        aligned_zeros(4, 2 * n),
    )


@inlined
def linear_tangent(tables, index, s, tangent, room):
    """Multiply `tangent` by exp(M s) of table `index`, in place.

    Parameters
    ----------
    tables : Tables
    index : int
    s : float
    tangent : ndarray, shape (2n, m)
    room : TangentRoom
    """
    size = tangent.shape[0]
    rows = room.propagator.shape[1]
    h = tables.h[index]
    if s == h:
        _multiply(tables.step, index * tables.step.shape[1] * rows, tangent, room)
        return
    sigma = 2.0 * s / h - 1.0
    powers = room.powers
    powers[0] = 1.0
    powers[1] = sigma
    for p in range(2, N_COEFFICIENTS):
        powers[p] = powers[p - 2] * (sigma * sigma)
    start = index * N_COEFFICIENTS * size * rows
    for place in range(0, size * rows, LANES):
        combine(
            room.propagator,
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
    _multiply(room.propagator, 0, tangent, room)


@inlined
def _multiply(table, start, tangent, room):
    """Multiply `tangent` by the matrix with the columns table[start:], padded, in place."""
    size, columns = tangent.shape
    rows = room.column.shape[0]
    for column in range(columns):
        for k in range(size):
            room.column[k] = tangent[k, column]
        for first in range(0, rows, LANES):
            combine(
                room.product, first, ZERO, 0, 1.0, table, start + first, rows, room.column, 0, size
            )
        for k in range(size):
            tangent[k, column] = room.product[k]


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
def passage_tangent(floor, key_after, z, a, jerk, model, room, tangent):
    """Multiply `tangent` by the matrix S of a fast passage, in place.

    Parameters
    ----------
    floor : int
    key_after : uint64
        Contact set after the passage.
    z : ndarray, shape (2n,)
        State at the stop before the kick.
    a : ndarray, shape (n,)
        Accelerations there without the contact force of `floor`.
    jerk : float
        Its derivative for `floor`.
    room : TangentRoom
    tangent : ndarray, shape (2n, m)
    """
    if model.rho == math.inf or model.beta == 0.0:
        return
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    v = z[n + floor]
    beta, rho = model.beta, model.rho
    free = _differentiated(-1.0, v, a[floor], jerk, beta, rho)
    contact = _differentiated(1.0, v, a[floor], jerk, beta, rho)
    kicks = room.kicks
    kicks[:] = 0.0
    for row in range(3):
        add_kick(sums(free[row], contact[row]), floor, model, kicks[row])
    kick, by_speed, by_acceleration, drift = kicks[0], kicks[1], kicks[2], kicks[3]
    # along f_- the speed changes by a and the acceleration by the jerk
    for i in range(n):
        force = 0.0
        if (key_after >> np.uint64(i)) & np.uint64(1):
            force = beta * kick[i]
        for j in range(n):
            force += stiffness[i, j] * kick[j] + damping[i, j] * kick[n + j]
        # less M_+ k
        drift[i] = -kick[n + i]
        drift[n + i] = force
    for row in range(2 * n):
        drift[row] += by_speed[row] * a[floor] + by_acceleration[row] * jerk
    for column in range(tangent.shape[1]):
        later = tangent[floor, column] / v
        faster = tangent[n + floor, column]
        pushed = 0.0
        for j in range(n):
            pushed -= stiffness[floor, j] * tangent[j, column]
            pushed -= damping[floor, j] * tangent[n + j, column]
        for row in range(2 * n):
            tangent[row, column] += (
                by_speed[row] * faster + by_acceleration[row] * pushed - drift[row] * later
            )


@inlined
def layer_tangent(h, model, room, tangent):
    """Multiply `tangent` by the tangent map of one collocation step, in place.

    The first guess are the accelerations of the variation without acceleration, which is what the
    iteration makes of 0. The last iteration is looked at, and its result is better than the change
    it makes.

    Parameters
    ----------
    h : float
    room : LayerRoom
        What `layer.collocate` has left there; overwritten.
    tangent : ndarray, shape (2n, m)
    """
    u, v, g, fresh, spring = room.u, room.v, room.g, room.fresh, room.spring
    free, speeds = room.free, room.speeds
    n = u.shape[0]
    beta, rho = model.beta, model.rho
    hardest = 0.0
    for i in range(n):
        row = i * N_STAGES
        if room.active[i] == 2:
            stiff = contact_stiffnesses(load(u, row) - STOP, beta, rho)
            store(spring, row, stiff)
            hardest = max(hardest, maximum(stiff))
        else:
            store(spring, row, beta * room.active[i])
            hardest = max(hardest, beta * room.active[i])
    unchecked, least_ratio = iterations_needed(h * h * (model.stiffness_bound + hardest))
    for column in range(tangent.shape[1]):
        for i in range(n):
            row = i * N_STAGES
            store(free, row, fma(load(NODES, 0), h * tangent[n + i, column], tangent[i, column]))
            store(speeds, row, tangent[n + i, column])
        _variations(free, speeds, spring, model, g)
        for _ in range(unchecked - 2):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, model, g)
        ratio = least_ratio
        previous = math.inf
        for _ in range(MAX_ITERATIONS):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, model, fresh)
            change, largest = replace(g, fresh)
            if previous < math.inf:
                ratio = change / previous
            if change * min(ratio, 1.0) <= CONVERGED * largest:
                break
            previous = change
        for i in range(n):
            du, dv = integrals(g, i)
            tangent[i, column] += h * (tangent[n + i, column] + h * du)
            tangent[n + i, column] += h * dv


@inlined
def _variations(u, v, spring, model, out):
    """Write the accelerations of a variation with stages u, v; all (n, N_STAGES)."""
    for i in range(u.shape[0]):
        row = i * N_STAGES
        force = -1.0 * load(spring, row) * load(u, row)
        store(out, row, less_linear(force, i, u, v, model))
