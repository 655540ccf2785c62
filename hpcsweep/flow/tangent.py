r"""The tangent map along the motion: product of the propagators of its segments.

The field is continuous, so a change of contact set alone adds nothing. The three kinds of
segment of `period` give

- linear: exp(M s), from the tables;
- fast passage: the kick k(z, tau) of `crossing` is applied where the linear motion reaches the
  stop, at a time that moves by dt = -du_f / v_f with the state. With the fields f_- before and
  f_+ after it::

      S = I + Dk - (Dk f_- + dk/dtau - M_+ k) e_f^T / v_f,        f_+(z + k) - f_-(z) = M_+ k

  (the derivative of k with respect to speed, acceleration and jerk by central differences);
- inside a layer: the variational equations of the collocation solution, at the same stages.
"""

import math

import numpy as np

from hpcsweep.equations import contact_stiffness
from hpcsweep.flow.crossing import add_kick, moments
from hpcsweep.flow.layer import (
    MAX_ITERATIONS,
    N_STAGES,
    NODES,
    POSITION_WEIGHTS,
    WEIGHTS,
    iterations_needed,
    stages,
    subtract_linear,
)
from hpcsweep.flow.tables import N_COEFFICIENTS
from hpcsweep.jit import fma, kernel

CONVERGED = 1e-13
"""Last change of the stage accelerations, or the next one, relative."""
DIFFERENCE = 1e-4
"""Relative step of the central differences; their error, its square, multiplies a small kick."""


@kernel
def _multiply(matrix, tangent, room):
    """Multiply `tangent` by a matrix from the left, in place; `room` is another (2n, 2n)."""
    size, columns = tangent.shape
    for row in range(size):
        factor = matrix[row, 0]
        for column in range(columns):
            room[row, column] = factor * tangent[0, column]
        for k in range(1, size):
            factor = matrix[row, k]
            for column in range(columns):
                room[row, column] = fma(factor, tangent[k, column], room[row, column])
    for row in range(size):
        for column in range(columns):
            tangent[row, column] = room[row, column]


@kernel
def linear_tangent(tables, index, s, tangent, propagator, room):
    """Multiply `tangent` by exp(M s) of table `index`, in place.

    `propagator` and `room` are (2n, 2n).
    """
    size = tangent.shape[0]
    h = tables.h[index]
    if s == h:
        for row in range(size):
            for k in range(size):
                propagator[row, k] = tables.step[index, k, row]
    else:
        sigma = 2.0 * s / h - 1.0
        for row in range(size):
            for k in range(size):
                value = tables.poly[index, row, k, N_COEFFICIENTS - 1]
                for p in range(N_COEFFICIENTS - 2, -1, -1):
                    value = fma(value, sigma, tables.poly[index, row, k, p])
                propagator[row, k] = value
    _multiply(propagator, tangent, room)


@kernel
def passage_tangent(floor, key_after, z, a, jerk, model, kicks, tangent):
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
    kicks : ndarray, shape (4, 2n)
        Room.
    tangent : ndarray, shape (2n, m)
    """
    if model.rho == math.inf or model.beta == 0.0:
        return
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    v = z[n + floor]
    dv = DIFFERENCE * abs(v)
    da = DIFFERENCE * v * v / model.layer
    kicks[:] = 0.0
    beta, rho = model.beta, model.rho
    for factor, row, speed, acceleration in (
        (1.0, 0, v, a[floor]),
        (0.5 / dv, 1, v + dv, a[floor]),
        (-0.5 / dv, 1, v - dv, a[floor]),
        (0.5 / da, 2, v, a[floor] + da),
        (-0.5 / da, 2, v, a[floor] - da),
    ):
        m = moments(speed, acceleration, jerk, beta, rho)
        add_kick(factor, m, floor, stiffness, damping, beta, kicks[row])
    kick, by_speed, by_acceleration, room = kicks[0], kicks[1], kicks[2], kicks[3]
    # along f_- the speed changes by a and the acceleration by the jerk
    # M_+ k, with the sign of the formula, takes the place of k
    for i in range(n):
        force = 0.0
        if (key_after >> np.uint64(i)) & np.uint64(1):
            force = beta * kick[i]
        for j in range(n):
            force += stiffness[i, j] * kick[j] + damping[i, j] * kick[n + j]
        room[i] = force
    for i in range(n):
        kick[i] = -kick[n + i]
        kick[n + i] = room[i]
    for column in range(tangent.shape[1]):
        later = tangent[floor, column] / v
        faster = tangent[n + floor, column]
        pushed = 0.0
        for j in range(n):
            pushed -= stiffness[floor, j] * tangent[j, column]
            pushed -= damping[floor, j] * tangent[n + j, column]
        for row in range(2 * n):
            drift = by_speed[row] * a[floor] + by_acceleration[row] * jerk + kick[row]
            tangent[row, column] += (
                by_speed[row] * faster + by_acceleration[row] * pushed - drift * later
            )


@kernel
def layer_tangent(h, model, room, tangent):
    """Multiply `tangent` by the tangent map of one collocation step, in place.

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
    hardest = 4.0
    for i in range(n):
        for j in range(N_STAGES):
            spring[i, j] = model.beta * room.active[i]
            if room.active[i] == 2:
                spring[i, j] = contact_stiffness(u[i, j] - 1.0, model.beta, model.rho)
            hardest = max(hardest, 4.0 + spring[i, j])
    stiffness, damping = model.stiffness, model.damping
    unchecked, least_ratio = iterations_needed(h * h * hardest)
    for column in range(tangent.shape[1]):
        for i in range(n):
            start = -spring[i, 0] * tangent[i, column]
            for k in range(n):
                start -= stiffness[i, k] * tangent[k, column]
                start -= damping[i, k] * tangent[n + k, column]
            for j in range(N_STAGES):
                g[i, j] = start
                free[i, j] = fma(NODES[j] * h, tangent[n + i, column], tangent[i, column])
                speeds[i, j] = tangent[n + i, column]
        for _ in range(unchecked):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, stiffness, damping, g)
        ratio = least_ratio
        previous = math.inf
        for _ in range(MAX_ITERATIONS):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, stiffness, damping, fresh)
            change = 0.0
            largest = 0.0
            for i in range(n):
                for j in range(N_STAGES):
                    change = max(change, abs(fresh[i, j] - g[i, j]))
                    largest = max(largest, abs(fresh[i, j]))
                    g[i, j] = fresh[i, j]
            if previous < math.inf:
                ratio = change / previous
            if change * min(ratio, 1.0) <= CONVERGED * largest:
                break
            previous = change
        for i in range(n):
            du = 0.0
            dv = 0.0
            for k in range(N_STAGES):
                du = fma(POSITION_WEIGHTS[k], g[i, k], du)
                dv = fma(WEIGHTS[k], g[i, k], dv)
            tangent[i, column] += h * (tangent[n + i, column] + h * du)
            tangent[n + i, column] += h * dv


@kernel
def _variations(u, v, spring, stiffness, damping, out):
    """Write the accelerations of a variation with stages u, v; all (n, N_STAGES)."""
    n = u.shape[0]
    for i in range(n):
        row = i * N_STAGES
        for j in range(N_STAGES):
            out[i, j] = -spring[i, j] * u[i, j]
        subtract_linear(i, u, v, stiffness, damping, out, row, out)
