"""Strides of free flight (`step.strides`): their tables, their proofs, and what is gathered."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from hpcsweep import Contact
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

N = 24
W = 0.1 * (1.0 + np.arange(N)) ** 2
"""Frequencies of a beam: the fastest mode would take 1,500 steps a period."""
RATIO, OMEGA, AMPLITUDE = 0.03, 0.23, 0.008
TIP, PUSH = 2.0 * (-1.0) ** np.arange(N), -1.0 / (1.0 + np.arange(N))
START = np.concatenate((5e-4 * TIP / W**1.5, 5e-4 * TIP / W))


def beam(gap=10.0, stiffness=200.0, **more):
    stop = Contact(tuple(TIP), gap, stiffness)
    more = {"damping_ratio": RATIO, "influence": tuple(PUSH), **more}
    return Structure.from_matrices((1.0,) * N, np.diag(W**2), [stop], **more)


def without_contact(t):
    """Return the place of the tip and its speed at times t, shape (any, 1), in closed form."""
    share, across = -AMPLITUDE * PUSH, 2.0 * RATIO * W * OMEGA
    size = (W**2 - OMEGA**2) ** 2 + across**2
    sine, cosine = share * (W**2 - OMEGA**2) / size, -share * across / size
    q, v = START[:N] - cosine, START[N:] - OMEGA * sine
    damped = W * math.sqrt(1.0 - RATIO**2)
    s, c, fall = np.sin(damped * t), np.cos(damped * t), np.exp(-RATIO * W * t)
    b = (v + RATIO * W * q) / damped
    own = fall * (q * c + b * s)
    speed = fall * (damped * (b * c - q * s) - RATIO * W * (q * c + b * s))
    own = own + sine * np.sin(OMEGA * t) + cosine * np.cos(OMEGA * t)
    speed = speed + OMEGA * (sine * np.cos(OMEGA * t) - cosine * np.sin(OMEGA * t))
    return own @ TIP, speed @ TIP


def highest():
    """Return how far the tip goes in a period."""
    t = np.linspace(0.0, 2.0 * math.pi / OMEGA, 40_001)[:, None]
    k = int(np.argmax(without_contact(t)[0]))
    a, b = t[k - 1], t[k + 1]
    for _ in range(60):
        middle = 0.5 * (a + b)
        a, b = (middle, b) if without_contact(middle)[1] > 0.0 else (a, middle)
    return float(without_contact(a)[0])


PEAK = highest()


@pytest.mark.parametrize("beyond", [1e-4, 1e-8, 1e-11, -1e-11, -1e-8, -1e-4])
def test_a_touch_of_the_stop_within_a_stride_is_seen(beyond):
    flow = FlowMap(beam(PEAK * (1.0 - beyond)), OMEGA)
    flow.advance(START, AMPLITUDE, 1)
    tables = flow._shared.tables
    assert tables.strides.count[0] > 0
    assert (1 in tables.keys[: tables.count[0]]) == (beyond > 0.0)


def test_tables_are_those_of_the_exponential_and_bounds_hold():
    flow = FlowMap(beam(harmonics=((1, 1.0, 0.0), (3, 0.5, 0.2))), OMEGA)
    flow.advance(START, AMPLITUDE, 1)
    shared = flow._shared
    own, spectrum, h = shared.tables.strides, shared.tables.spectrum, shared.tables.h[0]
    rates = [one[0] * shared.model.omega for one in shared.model.harmonics]
    for j in (0, 5, N - 1):
        field = np.zeros((6, 6))
        field[0, 1], field[1, :2] = 1.0, (-spectrum.squares[j], spectrum.rates[j])
        field[1, 2] = field[1, 4] = spectrum.forcing[j]
        for k, rate in enumerate(rates):
            field[2 + 2 * k, 3 + 2 * k], field[3 + 2 * k, 2 + 2 * k] = rate, -rate
        for level in (0, 3, own.steps.shape[0] - 1):
            step = expm(field * h * 2.0**level) - np.eye(6)
            scale = np.abs(step[:2]).max(1, keepdims=True)
            assert np.abs(own.steps[level, :, :, j] - step[:2]).max() < 3e-14 * scale.max()
        # q'''' along the longest stride, against the bound from its start
        at = np.array([0.3, -0.2, 0.7, -0.4, 0.2, 0.5])
        size = sum(r**4 * np.abs(at[2 + 2 * k : 4 + 2 * k]).sum() for k, r in enumerate(rates))
        long = h * 2.0 ** (own.steps.shape[0] - 1)
        driven = abs(spectrum.forcing[j]) / math.sqrt(spectrum.squares[j])
        bound = math.hypot(*(own.bends[:, :, j] @ at)) + driven * size * long
        fourth = np.linalg.matrix_power(field, 4)[0]
        seen = [abs(fourth @ expm(field * long * s) @ at) for s in np.linspace(0.0, 1.0, 200)]
        assert max(seen) <= bound * (1.0 + 1e-9)
    assert max(seen) > 0.5 * bound


@pytest.mark.parametrize("sharpness", [math.inf, 2000.0])
def test_what_is_gathered_does_not_change_the_motion(sharpness):
    flow = FlowMap(beam(0.7 * PEAK, sharpness=sharpness), OMEGA)
    points = flow.observe(START, AMPLITUDE, 2, modal_norm=True).points
    np.testing.assert_array_equal(flow.advance(START, AMPLITUDE, 2).state, points[-1])


def test_the_tangent_map_is_that_of_differences():
    flow = FlowMap(beam(0.7 * PEAK), OMEGA)
    _, matrix = flow.monodromy(START, AMPLITUDE, 1)
    along = np.cos(np.arange(2.0 * N)) * START
    ends = [flow.advance(START + s * along, AMPLITUDE, 1).state for s in (1e-6, -1e-6)]
    np.testing.assert_allclose(matrix @ along, (ends[0] - ends[1]) / 2e-6, rtol=1e-5, atol=1e-7)
