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
from hpcsweep.kernels.simd.vectors import fma, load, modulus, negative, total
from hpcsweep.solvers.flow.layer.observation import BETWEEN, beyond, range_of
from hpcsweep.solvers.flow.rules.tableau import N_POINTS, N_STAGES, NODES, POINTS
from hpcsweep.solvers.flow.state.state import accelerations, time_of

_APART = POINTS[:, None] - POINTS + np.eye(N_POINTS)
SCALES = 1.0 / _APART.prod(axis=1)
SLOPES = (1.0 / _APART).sum(axis=1) - 1.0
"""L_k'(t_k)"""
STAGE_SCALES, STAGE_SLOPES = SCALES[1:-1].copy(), SLOPES[1:-1].copy()
PARABOLAS = 12
SAME = 1e-12
"""Relative change of a peak after which no other parabola follows: the next changes it far less."""
CUTS = 4
"""How often the interval beside an end is cut in search of a value above that at the end."""


@inlined
def may_be_higher(step, first, model, tally, work):
    """Return whether an acceleration may exceed its peak on a step, by its stages.

    Parameters
    ----------
    step : tuple of float
        Its start, its length, A, and the forcing at both ends.
    first : int
        Place of the accelerations in `Model.watched`.
    model, tally, work
        Of `observation.observe_layer_step`.
    """
    for i in range(model.ground.shape[0]):
        if _floor_may_be_higher(i, step, tally.peaks[first + i], model, work):
            return True
    return False


@inlined
def _floor_may_be_higher(i, step, peak, model, work):
    """Return whether the acceleration of floor i may exceed a peak."""
    _, _, _, ground0, ground1 = step
    own = model.ground[i]
    start, end = work.a[i] + own * ground0, work.a_end[i] + own * ground1
    inner = fma(load(work.layer.ground, 0), own, load(work.layer.g, i * N_STAGES))
    most = peak * (1.0 / (1.0 + 2.0 * BETWEEN))
    if abs(start) <= most and abs(end) <= most and negative(most - modulus(inner)) == 0:
        return False
    bottom, top = range_of(inner, start, end)
    return not max(beyond(bottom, top), beyond(-top, -bottom)) <= peak


@inlined
def accelerations_in_layer(step, z0, z1, first, model, tally, work):
    """Raise the peaks of absolute accelerations over one step from state z0 to state z1.

    Arguments of `may_be_higher` and of `observation.observe_layer_step`.
    """
    tau, h, _, ground0, ground1 = step
    values, time = work.layer.values, time_of(tau, model)
    for i in range(model.ground.shape[0]):
        p, own = first + i, model.ground[i]
        if not _floor_may_be_higher(i, step, tally.peaks[p], model, work):
            continue
        values[0], values[N_POINTS - 1] = work.a[i] + own * ground0, work.a_end[i] + own * ground1
        for k in range(N_STAGES):
            values[k + 1] = work.layer.g[i, k] + own * work.layer.ground[k]
        for k in range(N_POINTS):
            if abs(values[k]) > tally.peaks[p]:
                tally.peaks[p], tally.times[p] = abs(values[k]), time + POINTS[k] * h
        for k in range(N_POINTS):
            sign = 1.0 if values[k] > 0.0 else -1.0
            here = sign * values[k]
            left = sign * values[max(k - 1, 0)]
            right = sign * values[min(k + 1, N_POINTS - 1)]
            rise = max(here - left, here - right)
            if here >= left and here >= right and here + rise > tally.peaks[p]:
                top, at = _highest_beside(k, i, sign, tally.peaks[p], step, z0, z1, model, work)
                if top > tally.peaks[p]:
                    tally.peaks[p], tally.times[p] = top, time + at * h


@kernel
def _highest_beside(k, i, sign, peak, step, z0, z1, model, work):
    """Find the largest sign times the acceleration of floor i beside point k, a local maximum.

    Return it, and at which part of the step. The search ends where it does not exceed the peak.
    """
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
        return fm, m
    for _ in range(PARABOLAS):
        if fm + max(fm - fa, fm - fb) <= peak:
            break
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
    return fm, m


@kernel
def _acceleration_at(t, i, step, z0, z1, model, work):
    """Evaluate the absolute acceleration of floor i at a part t of the step, beside all points."""
    tau, h, amplitude, _, _ = step
    stage, n = work.layer, z0.shape[0] // 2
    z = stage.state
    apart = t - load(NODES, 0)
    whole = t * (t - 1.0)
    for k in range(N_STAGES):
        whole *= t - NODES[k]
    basis = load(STAGE_SCALES, 0) * whole / apart
    slope = apart * basis * basis
    value = fma(load(STAGE_SLOPES, 0) * -2.0, slope, basis * basis)
    slope = slope * h
    value0, slope0 = _weights_of_end(0, t, h, whole)
    value1, slope1 = _weights_of_end(N_POINTS - 1, t, h, whole)
    for row in range(n):
        at = row * N_STAGES
        speeds = load(stage.v, at)
        inner = total(fma(load(stage.u, at), value, speeds * slope))
        begin = value0 * z0[row] + slope0 * z0[n + row]
        z[row] = inner + (begin + (value1 * z1[row] + slope1 * z1[n + row]))
        inner = total(fma(speeds, value, load(stage.g, at) * slope))
        begin = value0 * z0[n + row] + slope0 * work.a[row]
        z[n + row] = inner + (begin + (value1 * z1[n + row] + slope1 * work.a_end[row]))
    ground = _ground_at(tau + t * h, amplitude, model)
    accelerations(ground, z, model, stage.rates)
    return stage.rates[i] + model.ground[i] * ground


@inlined
def _weights_of_end(k, t, h, whole):
    """Return the weights of value and slope at point k, an end."""
    apart = t - POINTS[k]
    basis = SCALES[k] * whole / apart
    slope = apart * basis * basis
    return basis * basis - 2.0 * SLOPES[k] * slope, slope * h


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
