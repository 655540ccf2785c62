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
from hpcsweep.flow.crossing import moments
from hpcsweep.flow.layer import (
    MAX_ITERATIONS,
    N_STAGES,
    NODES,
    POSITION_ROWS,
    POSITION_WEIGHTS,
    SPEED_ROWS,
    WEIGHTS,
)
from hpcsweep.flow.tables import N_COEFFICIENTS
from hpcsweep.jit import combine, fma, jit

CONVERGED = 1e-13
"""Last change of the stage accelerations, relative; the next would be some tenth of it."""
DIFFERENCE = 1e-4
"""Relative step of the central differences; their error, its square, multiplies a small kick."""


@jit
def _multiply(matrix, tangent, room):
    """Multiply `tangent` by a matrix from the left, in place; `room` is another (2n, 2n)."""
    size = tangent.shape[0]
    for row in range(size):
        factor = matrix[row, 0]
        for column in range(size):
            room[row, column] = factor * tangent[0, column]
        for k in range(1, size):
            factor = matrix[row, k]
            for column in range(size):
                room[row, column] = fma(factor, tangent[k, column], room[row, column])
    for row in range(size):
        for column in range(size):
            tangent[row, column] = room[row, column]


@jit
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


@jit
def passage_tangent(floor, key_after, z, a, jerk, model, tangent):
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
    """
    if model.rho == math.inf or model.beta == 0.0:
        return
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    v = z[n + floor]
    # k = basis m(v, a, j), see `period._passes`
    basis = np.zeros((2 * n, 7))
    for i in range(n):
        square = -stiffness[i, floor]
        for j in range(n):
            square += damping[i, j] * damping[j, floor]
        basis[i, 2] = basis[i, 3] = -0.5 * damping[i, floor]
        basis[i, 4] = basis[i, 5] = -square / 6.0
        basis[n + i, 1] = damping[i, floor]
        basis[n + i, 2] = basis[n + i, 3] = 0.5 * square
        basis[n + i, 5] = -model.beta * damping[i, floor] / 6.0
    basis[floor, 1] -= 1.0
    basis[floor, 5] += model.beta / 6.0
    basis[n + floor, 0] += 1.0
    basis[n + floor, 3] -= 0.5 * model.beta
    basis[n + floor, 5] -= model.beta * damping[floor, floor] / 6.0
    basis[n + floor, 6] = model.beta**2 / 24.0
    m = np.array(moments(v, a[floor], jerk, model.beta, model.rho))
    dv = DIFFERENCE * abs(v)
    da = DIFFERENCE * v * v / model.layer
    m_v = np.array(moments(v + dv, a[floor], jerk, model.beta, model.rho))
    m_v -= np.array(moments(v - dv, a[floor], jerk, model.beta, model.rho))
    m_a = np.array(moments(v, a[floor] + da, jerk, model.beta, model.rho))
    m_a -= np.array(moments(v, a[floor] - da, jerk, model.beta, model.rho))
    m_v /= 2.0 * dv
    m_a /= 2.0 * da
    kick = np.dot(basis, m)
    by_speed = np.dot(basis, m_v)
    by_acceleration = np.dot(basis, m_a)
    matrix = np.eye(2 * n)
    for row in range(2 * n):
        matrix[row, n + floor] += by_speed[row]
        for j in range(n):
            matrix[row, j] -= by_acceleration[row] * stiffness[floor, j]
            matrix[row, n + j] -= by_acceleration[row] * damping[floor, j]
        # along f_- the speed changes by a and the acceleration by the jerk
        drift = by_speed[row] * a[floor] + by_acceleration[row] * jerk
        if row < n:
            drift -= kick[n + row]
        else:
            i = row - n
            if (key_after >> np.uint64(i)) & np.uint64(1):
                drift += model.beta * kick[i]
            for j in range(n):
                drift += stiffness[i, j] * kick[j] + damping[i, j] * kick[n + j]
        matrix[row, floor] -= drift / v
    tangent[:] = np.dot(matrix, tangent.copy())


@jit
def layer_tangent(h, stage_u, model, tangent):
    """Multiply `tangent` by the tangent map of one collocation step, in place.

    Parameters
    ----------
    h : float
    stage_u : ndarray, shape (n, N_STAGES)
        Displacements at the stages of the step.
    """
    n = stage_u.shape[0]
    spring = np.empty((n, N_STAGES))
    for i in range(n):
        for j in range(N_STAGES):
            spring[i, j] = contact_stiffness(stage_u[i, j] - 1.0, model.beta, model.rho)
    g = np.empty((n, N_STAGES))
    u = np.empty((n, N_STAGES))
    v = np.empty((n, N_STAGES))
    free = np.empty((n, N_STAGES))
    speeds = np.empty((n, N_STAGES))
    fresh = np.empty(N_STAGES)
    stiffness, damping = model.stiffness, model.damping
    for column in range(2 * n):
        for i in range(n):
            start = -spring[i, 0] * tangent[i, column]
            for k in range(n):
                start -= model.stiffness[i, k] * tangent[k, column]
                start -= model.damping[i, k] * tangent[n + k, column]
            for j in range(N_STAGES):
                g[i, j] = start
                free[i, j] = fma(NODES[j] * h, tangent[n + i, column], tangent[i, column])
                speeds[i, j] = tangent[n + i, column]
        for _ in range(2 * MAX_ITERATIONS):
            for i in range(n):
                row = i * N_STAGES
                combine(u, row, free, row, h * h, POSITION_ROWS, 0, N_STAGES, g, row, N_STAGES)
                combine(v, row, speeds, row, h, SPEED_ROWS, 0, N_STAGES, g, row, N_STAGES)
            change = 0.0
            largest = 0.0
            for i in range(n):
                for j in range(N_STAGES):
                    fresh[j] = -spring[i, j] * u[i, j]
                low, high = max(i - 1, 0), min(i + 2, n)  # K is tridiagonal
                at = low * N_STAGES
                combine(
                    fresh, 0, fresh, 0, -1.0, u, at, N_STAGES, stiffness, i * n + low, high - low
                )
                combine(fresh, 0, fresh, 0, -1.0, v, 0, N_STAGES, damping, i * n, n)
                for j in range(N_STAGES):
                    change = max(change, abs(fresh[j] - g[i, j]))
                    largest = max(largest, abs(fresh[j]))
                    g[i, j] = fresh[j]
            if change <= CONVERGED * largest:
                break
        for i in range(n):
            du = 0.0
            dv = 0.0
            for k in range(N_STAGES):
                du = fma(POSITION_WEIGHTS[k], g[i, k], du)
                dv = fma(WEIGHTS[k], g[i, k], dv)
            tangent[i, column] += h * (tangent[n + i, column] + h * du)
            tangent[n + i, column] += h * dv
