"""March over forcing periods: linear steps, fast passages, and visits to the layer.

One period runs from tau = 0 to T = 2 pi / Omega, so that the phase is exact in every period.
Between contact changes the motion takes linear steps of the present contact set (`tables`).
A step is accepted when no floor can have reached the edge of its layer, which is proved
(`search`); otherwise the first floor that does is found. If its passage through the layer is
fast, and no other floor comes near a layer meanwhile, the passage is done in closed form
(`crossing`); if not, the motion is integrated from the edge until no floor is inside a layer
(`layer`). For infinite sharpness the layer has no width and every passage is the closed form
with zero impulse.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.flow.crossing import moments, passage_is_fast
from hpcsweep.flow.layer import (
    COMPLETE,
    NON_FINITE,
    SOLVER_FAILED,
    STEP_LIMIT,
    accelerations,
    collocate,
    finish,
    inside_layer,
    quadrature_error,
    step_limit,
)
from hpcsweep.flow.metrics import drift_on_segment, modal_norm_on_segment, observe_layer_step
from hpcsweep.flow.search import (
    MAX_DEPTH,
    first_passage,
    may_reach,
    row_polynomial,
    value_and_slope,
)
from hpcsweep.flow.tables import N_COEFFICIENTS, lookup
from hpcsweep.jit import jit

OVERFLOW = 1e100
"""A coordinate beyond this ends the run as NON_FINITE."""
EXTRAPOLATION = 1.005
"""How far beyond its step a polynomial is used, in steps: its error grows less than fivefold."""


class Work(NamedTuple):
    """Room for the kernels; contents mean nothing between calls."""

    x: np.ndarray
    z_end: np.ndarray
    row: np.ndarray
    other_row: np.ndarray
    event_row: np.ndarray
    rows: np.ndarray
    modal_rows: np.ndarray
    modal_values: np.ndarray
    breaks: np.ndarray
    stack: np.ndarray
    a: np.ndarray
    u: np.ndarray
    v: np.ndarray
    g: np.ndarray
    fresh: np.ndarray
    stage_u: np.ndarray
    stage_v: np.ndarray


def empty_work(n: int) -> Work:
    """Allocate the room for n floors."""
    stages = (n, 8)
    return Work(
        x=np.zeros(2 * n + 3),
        z_end=np.zeros(2 * n),
        row=np.zeros(N_COEFFICIENTS),
        other_row=np.zeros(N_COEFFICIENTS),
        event_row=np.zeros(N_COEFFICIENTS),
        rows=np.zeros((n, N_COEFFICIENTS)),
        modal_rows=np.zeros((n, N_COEFFICIENTS)),
        modal_values=np.zeros(n),
        breaks=np.zeros(n + 1),
        stack=np.zeros((MAX_DEPTH + 2, 3)),
        a=np.zeros(n),
        u=np.zeros(stages),
        v=np.zeros(stages),
        g=np.zeros(stages),
        fresh=np.zeros(stages),
        stage_u=np.zeros(8),
        stage_v=np.zeros(8),
    )


@jit
def set_forcing(x, tau, amplitude, model):
    """Write the forcing part (A sin, A cos, 1) of the augmented state at time tau."""
    n = model.stiffness.shape[0]
    x[2 * n] = amplitude * math.sin(model.omega * tau)
    x[2 * n + 1] = amplitude * math.cos(model.omega * tau)
    x[2 * n + 2] = 1.0


@jit
def contact_key(z, a, model):
    """Find the contact set of a state outside all layers.

    A floor exactly at a stop of infinite sharpness touches if it is moving, or else
    accelerating, towards it.
    """
    key = np.uint64(0)
    n = a.shape[0]
    for i in range(n):
        x = z[i] - 1.0
        if x > 0.0 or (x == 0.0 and (z[n + i] > 0.0 or (z[n + i] == 0.0 and a[i] > 0.0))):
            key |= np.uint64(1) << np.uint64(i)
    return key


@jit
def evaluate_state(index, x, s, tables, out):
    """Evaluate the state at time s of a linear step from x into `out`, shape (2n,)."""
    n2 = out.shape[0]
    sigma = 2.0 * s / tables.h[index] - 1.0
    powers = np.empty(N_COEFFICIENTS)
    powers[0] = 1.0
    for p in range(1, N_COEFFICIENTS):
        powers[p] = powers[p - 1] * sigma
    for row in range(n2):
        total = 0.0
        for k in range(x.shape[0]):
            entry = 0.0
            for p in range(N_COEFFICIENTS):
                entry += tables.poly[index, row, k, p] * powers[p]
            total += entry * x[k]
        out[row] = total


@jit
def _gap_bound4(index, x, tables, i):
    bound4 = 0.0
    for k in range(x.shape[0]):
        bound4 += tables.bound4[index, i, k] * abs(x[k])
    return bound4


@jit
def _first_event(key, index, x, z_end, span, model, tables, work):
    """Find the first floor that reaches the edge of its layer within `span` of a step.

    Returns
    -------
    floor : int
        -1 if none does (proved).
    time : float
        Of the step; the polynomial of that floor is left in ``work.event_row``.
    """
    n = model.stiffness.shape[0]
    h = tables.h[index]
    floor = -1
    earliest = span
    for i in range(n):
        if (key >> np.uint64(i)) & np.uint64(1):
            sign = -1.0
            level = 1.0 + model.layer
        else:
            sign = 1.0
            level = 1.0 - model.layer
        g0 = sign * (x[i] - level)
        g1 = sign * (z_end[i] - level)
        bound4 = _gap_bound4(index, x, tables, i)
        if not may_reach(span, g0, sign * x[n + i], g1, sign * z_end[n + i], bound4):
            continue
        row_polynomial(tables.poly[index, i], x, work.row)
        time = first_passage(work.row, h, 0.0, earliest, level, sign, bound4, work.stack)
        if time >= 0.0:
            floor = i
            earliest = time
            for p in range(N_COEFFICIENTS):
                work.event_row[p] = work.row[p]
    return floor, earliest


@jit
def _time_at_stop(coefficients, h, s, sign):
    """Follow the floor from the edge of its layer (time s) to the stop; NaN if it turns."""
    for _ in range(40):
        value, slope = value_and_slope(coefficients, h, s)
        if not sign * slope > 0.0:
            return math.nan
        step = (1.0 - value) / slope
        s += step
        if abs(step) <= 1e-15 * h:
            return s
    return s


@jit
def _passes(floor, key, tau, z, amplitude, model, tally, work):
    """Take floor `floor`, at the stop in state z, through its layer if that is fast.

    Returns
    -------
    bool
        False, with z unchanged, if the passage has to be integrated instead.
    """
    n = model.stiffness.shape[0]
    v = z[n + floor]
    z[floor] = 1.0
    ground = amplitude * math.sin(model.omega * tau)
    for i in range(n):
        force = -ground
        if i != floor and (key >> np.uint64(i)) & np.uint64(1):
            force -= model.beta * (z[i] - 1.0)
        for j in range(n):
            force -= model.stiffness[i, j] * z[j] + model.damping[i, j] * z[n + j]
        work.a[i] = force
    jerk = -model.omega * amplitude * math.cos(model.omega * tau)
    for j in range(n):
        jerk -= model.stiffness[floor, j] * z[n + j] + model.damping[floor, j] * work.a[j]
    if not passage_is_fast(v, work.a[floor], jerk, model.beta, model.rho, model.layer):
        return False
    if model.rho == math.inf:
        return True
    duration = 2.0 * model.layer / abs(v)
    if tau - duration < 0.0 or tau + duration > 2.0 * math.pi / model.omega:
        return False
    for i in range(n):
        nearest = abs(z[i] - 1.0) - (abs(z[n + i]) + abs(work.a[i]) * duration) * duration
        if i != floor and nearest <= model.layer:
            return False
    impulse, first, second_free, second_contact = moments(
        v, work.a[floor], jerk, model.beta, model.rho
    )
    # sum_k (-1)^k/k! M^k e m_k with M e = (e, -D e), M^2 e = (-D e, -(K + beta c) e + D^2 e)
    second = second_free + second_contact
    for i in range(n):
        square = 0.0
        for j in range(n):
            square += model.damping[i, j] * model.damping[j, floor]
        z[i] -= 0.5 * model.damping[i, floor] * second
        z[n + i] += model.damping[i, floor] * first + 0.5 * second * (
            square - model.stiffness[i, floor]
        )
    z[floor] -= first
    z[n + floor] += impulse - 0.5 * model.beta * second_contact
    return True


@jit
def visit_layer(tau, end, z, amplitude, model, tolerance, tally, observing, steps_left, work):
    """Integrate from tau until no floor is inside a layer, or until `end`.

    Returns
    -------
    tau : float
    outcome : int
    steps : int
        Steps taken.
    """
    accelerations(tau, z, amplitude, model, work.a)
    for i in range(work.g.shape[0]):
        for j in range(work.g.shape[1]):
            work.g[i, j] = work.a[i]
    steps = 0
    while True:
        left = end - tau
        h = step_limit(z, work.a, model, left)
        while True:
            steps += 1
            if steps > steps_left:
                return tau, STEP_LIMIT, steps
            if collocate(tau, h, z, amplitude, model, work.u, work.v, work.g, work.fresh):
                finish(h, z, work.g, work.z_end)
                error = quadrature_error(h, work.g)
                speed = 1.0
                for i in range(work.z_end.shape[0]):
                    speed = max(speed, abs(work.z_end[i]))
                if error <= tolerance * speed:
                    break
            h *= 0.5
            if not h > 1e-14 * left:
                return tau, SOLVER_FAILED, steps
            for i in range(work.g.shape[0]):
                for j in range(work.g.shape[1]):
                    work.g[i, j] = work.a[i]
        if observing:
            observe_layer_step(h, z, work.z_end, model, tally, work)
        tau = end if h >= left else tau + h
        for i in range(z.shape[0]):
            z[i] = work.z_end[i]
            if not abs(z[i]) < OVERFLOW:
                return tau, NON_FINITE, steps
        accelerations(tau, z, amplitude, model, work.a)
        for i in range(work.g.shape[0]):
            for j in range(work.g.shape[1]):
                work.g[i, j] = work.a[i]
        if tau >= end or not inside_layer(z, model):
            return tau, COMPLETE, steps


@jit
def march_period(z, amplitude, model, tables, tolerance, max_steps, tally, observing, work):
    """Advance z over one forcing period, in place.

    Parameters
    ----------
    z : ndarray, shape (2n,)
        State at tau = 0; on success the state at tau = T, else the last state reached.
    amplitude : float
        A.
    model, tables, tally, work
        See their classes; `tally` is updated only if `observing` (counts always).
    tolerance : float
        Local error allowed a step inside a layer, relative to max(1, |z|).
    max_steps : int
        Cap of steps in this period.

    Returns
    -------
    int
        An `Outcome`.
    """
    n = model.stiffness.shape[0]
    end = 2.0 * math.pi / model.omega
    x = work.x
    tau = 0.0
    steps = 0
    index = -1
    key = np.uint64(0)
    while tau < end:
        steps += 1
        if steps > max_steps:
            return STEP_LIMIT
        if index < 0:
            if inside_layer(z, model):
                tally.counts[3] += 1
                tau, outcome, used = visit_layer(
                    tau, end, z, amplitude, model, tolerance, tally, observing,
                    max_steps - steps, work,
                )
                tally.counts[2] += used
                steps += used
                if outcome != COMPLETE:
                    return outcome
                continue
            accelerations(tau, z, amplitude, model, work.a)
            key = contact_key(z, work.a, model)
            index = lookup(key, model, tables)
            for i in range(2 * n):
                x[i] = z[i]
            set_forcing(x, tau, amplitude, model)
        tally.counts[0] += 1
        h = tables.h[index]
        span = h
        if tau + h < end:
            step = tables.step[index]
            for row in range(2 * n):
                work.z_end[row] = 0.0
            for k in range(2 * n + 3):
                factor = x[k]
                for row in range(2 * n):
                    work.z_end[row] += step[k, row] * factor
        else:
            span = end - tau
            evaluate_state(index, x, span, tables, work.z_end)
        passed = False
        beyond = False
        floor, time = _first_event(key, index, x, work.z_end, span, model, tables, work)
        if floor >= 0:
            touching = (key >> np.uint64(floor)) & np.uint64(1)
            sign = -1.0 if touching else 1.0
            at_stop = _time_at_stop(work.event_row, h, time, sign)
            beyond = at_stop > EXTRAPOLATION * h and time > 0.0
            if not beyond and not math.isnan(at_stop) and tau + at_stop < end:
                evaluate_state(index, x, at_stop, tables, z)
                passed = _passes(
                    floor, key, tau + at_stop, z, amplitude, model, tally, work
                )
            if passed:
                tally.counts[1] += 1
                span = at_stop
                for i in range(2 * n):
                    work.z_end[i] = z[i]
            else:
                span = time
                evaluate_state(index, x, span, tables, work.z_end)
        for i in range(2 * n):
            if not abs(work.z_end[i]) < OVERFLOW:
                return NON_FINITE
        if observing:
            if key != np.uint64(0):
                tally.contact[0] |= key
            if tally.drift:
                drift_on_segment(index, x, work.z_end, span, tables, tally, work)
            if tally.modal_norm and key == np.uint64(0):
                modal_norm_on_segment(index, x, span, model, tables, tally, work)
        for i in range(2 * n):
            z[i] = work.z_end[i]
        tau = end if span >= end - tau else tau + span
        if floor < 0:
            for i in range(2 * n):
                x[i] = z[i]
            if span == h:
                sine = x[2 * n]
                cosine = x[2 * n + 1]
                x[2 * n] = sine * tables.rotation[index, 0] + cosine * tables.rotation[index, 1]
                x[2 * n + 1] = (
                    cosine * tables.rotation[index, 0] - sine * tables.rotation[index, 1]
                )
        elif beyond:
            set_forcing(x, tau, amplitude, model)
            for i in range(2 * n):
                x[i] = z[i]
        elif passed:
            key ^= np.uint64(1) << np.uint64(floor)
            index = lookup(key, model, tables)
            for i in range(2 * n):
                x[i] = z[i]
            set_forcing(x, tau, amplitude, model)
        else:
            index = -1
            if model.rho != math.inf:
                # at the edge of the layer, perhaps just outside it by rounding: integrate
                tally.counts[3] += 1
                tau, outcome, used = visit_layer(
                    tau, end, z, amplitude, model, tolerance, tally, observing,
                    max_steps - steps, work,
                )
                tally.counts[2] += used
                steps += used
                if outcome != COMPLETE:
                    return outcome
    return COMPLETE
