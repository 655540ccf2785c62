r"""Peaks of absolute accelerations over a step inside a layer, from its stages.

The acceleration changes within a layer as fast as the contact's force does: it is no interpolant of
accelerations but the equation of motion itself, at a state that is interpolated. Displacements and
velocities at the ends and the stages, with their slopes, have one polynomial each of degree
2 `N_POINTS` - 1, right to kappa^-20 with kappa of `visit`. With the Lagrange polynomials L_k of
the points,

    u(t) = sum_k (1 - 2 (t - t_k) L_k'(t_k)) L_k(t)^2 u_k + (t - t_k) L_k(t)^2 h v_k.

A peak is looked for beside the largest of the values at the points, where it may exceed the peak so
far by what they differ from their neighbours, by parabolas through three values.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import fma, load, maximum
from hpcsweep.model.kernel_model import ACCELERATION
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES
from hpcsweep.solvers.flow.state.accelerations import accelerations

N_POINTS = N_STAGES + 2
"""The ends and the stages."""
POINTS = np.concatenate(([0.0], NODES, [1.0]))
_APART = POINTS[:, None] - POINTS + np.eye(N_POINTS)
SCALES = 1.0 / _APART.prod(axis=1)
SLOPES = (1.0 / _APART).sum(axis=1) - 1.0
"""L_k'(t_k)"""
BETWEEN = 0.1
"""How far a component may come beyond its values at ends and nodes, over their range; of a parabola
between nodes it is 0.03, with its top in the step."""
PARABOLAS = 12
SAME = 1e-14
"""Relative change of a peak after which no other parabola follows."""
CUTS = 4
"""How often the interval beside an end is cut in search of a value above that at the end."""


@inlined
def range_of(inner, first, last):
    """Return the least and the greatest of Lanes and two numbers."""
    top = max(maximum(inner), max(first, last))
    return min(-maximum(0.0 - inner), min(first, last)), top


@inlined
def accelerations_in_layer(step, z0, z1, only_look, model, tally, work):
    """Raise the peaks of absolute accelerations over one step from state z0 to state z1.

    With `only_look` nothing is raised; return then whether a peak may be.

    Parameters
    ----------
    step : tuple of float
        Its start, its length, A, and the forcing at both ends.
    z0, z1, model, tally, work
        Of `observation.observe_layer_step`.
    """
    _, _, _, ground0, ground1 = step
    values = work.layer.values
    for p in range(model.watched.shape[0]):
        i, _, _, flag = model.watched[p]
        if flag != ACCELERATION:
            continue
        own = model.ground[i]
        values[0], values[N_POINTS - 1] = work.a[i] + own * ground0, work.a_end[i] + own * ground1
        inner = fma(load(work.layer.ground, 0), own, load(work.layer.g, i * N_STAGES))
        bottom, top = range_of(inner, values[0], values[N_POINTS - 1])
        if max(top, -bottom) + BETWEEN * (top - bottom) <= tally.peaks[p]:
            continue
        if only_look:
            return True
        for k in range(N_STAGES):
            values[k + 1] = work.layer.g[i, k] + own * work.layer.ground[k]
        for k in range(N_POINTS):
            tally.peaks[p] = max(tally.peaks[p], abs(values[k]))
        for k in range(N_POINTS):
            sign = 1.0 if values[k] > 0.0 else -1.0
            here = sign * values[k]
            left = sign * values[max(k - 1, 0)]
            right = sign * values[min(k + 1, N_POINTS - 1)]
            rise = max(here - left, here - right)
            if here >= left and here >= right and here + rise > tally.peaks[p]:
                top = _highest_beside(k, i, sign, step, z0, z1, model, work)
                tally.peaks[p] = max(tally.peaks[p], top)
    return False


@kernel
def _highest_beside(k, i, sign, step, z0, z1, model, work):
    """Find the largest sign times the acceleration of floor i beside point k, a local maximum."""
    values = work.layer.values
    a, b = POINTS[max(k - 1, 0)], POINTS[min(k + 1, N_POINTS - 1)]
    fa, fb = sign * values[max(k - 1, 0)], sign * values[min(k + 1, N_POINTS - 1)]
    m, fm = POINTS[k], sign * values[k]
    for _ in range(CUTS * (k == 0 or k == N_POINTS - 1)):
        middle = 0.5 * (a + b)
        value = sign * _acceleration_at(middle, i, step, z0, z1, model, work)
        if value > fm:
            m, fm = middle, value
            break
        if k == 0:
            b, fb = middle, value
        else:
            a, fa = middle, value
    if not a < m < b:
        return fm
    for _ in range(PARABOLAS):
        p, q = (m - a) * (fm - fb), (m - b) * (fm - fa)
        t = m - 0.5 * ((m - a) * p - (m - b) * q) / (p - q) if p != q else m
        if not (a < t < b and t != m):
            t = 0.5 * (m + a) if m - a > b - m else 0.5 * (m + b)
        value = sign * _acceleration_at(t, i, step, z0, z1, model, work)
        done = abs(value - fm) <= SAME * abs(fm)
        if value > fm:
            if t > m:
                a, fa = m, fm
            else:
                b, fb = m, fm
            m, fm = t, value
        elif t > m:
            b, fb = t, value
        else:
            a, fa = t, value
        if done:
            break
    return fm


@kernel
def _acceleration_at(t, i, step, z0, z1, model, work):
    """Evaluate the absolute acceleration of floor i at a part t of the step."""
    tau, h, amplitude, _, _ = step
    stage, n = work.layer, z0.shape[0] // 2
    z = stage.state
    for row in range(2 * n):
        z[row] = 0.0
    for k in range(N_POINTS):
        basis = SCALES[k]
        for other in range(N_POINTS):
            if other != k:
                basis *= t - POINTS[other]
        slope = (t - POINTS[k]) * basis * basis
        value = basis * basis - 2.0 * SLOPES[k] * slope
        for row in range(n):
            if k == 0:
                u, v, g = z0[row], z0[n + row], work.a[row]
            elif k == N_POINTS - 1:
                u, v, g = z1[row], z1[n + row], work.a_end[row]
            else:
                u, v, g = stage.u[row, k - 1], stage.v[row, k - 1], stage.g[row, k - 1]
            z[row] += value * u + slope * h * v
            z[n + row] += value * v + slope * h * g
    ground = _ground_at(tau + t * h, amplitude, model)
    accelerations(ground, z, model, stage.rates)
    return stage.rates[i] + model.ground[i] * ground


@inlined
def _ground_at(tau, amplitude, model):
    """Evaluate G."""
    ground = 0.0
    for h in range(model.harmonics.shape[0]):
        angle = model.harmonics[h, 0] * model.omega * tau + model.harmonics[h, 2]
        ground += amplitude * model.harmonics[h, 1] * math.sin(angle)
    for k in range(model.ramp.shape[0]):
        ground += amplitude * (model.ramp[k, 0] + model.ramp[k, 1] * tau)
    return ground
