"""Passages of a layer: derivatives of their moments, and against the reference."""

import math

import numpy as np
import pytest
from reference import reference_points

from hpcsweep.kernels.compile import kernel
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.layer.passage import crossing, tangent

PERIOD = 1.0
"""Short: the floor passes its stop once and comes back."""


@pytest.mark.slow
@pytest.mark.parametrize("v", [0.7, -0.7])
def test_derivatives_of_a_passage_are_those_of_its_moments(v):
    @kernel
    def differentiate(v, a, j, beta, rho, out):
        stop = crossing.at_stop(v, a, j, beta, rho)
        free = tangent._half(-1.0, stop, crossing.speeds(-1.0, stop))
        contact = tangent._half(1.0, stop, crossing.speeds(1.0, stop))
        found = crossing.sums(free[0], contact[0])
        moments = crossing.since_linear(found, stop)
        for k in range(7):
            out[0, k] = moments[k]
        for row in range(1, 3):
            by_v, by_a = 2.0 - row, row - 1.0
            rates = crossing.sums(
                tangent._rates(-1.0, free, stop, by_v, by_a),
                tangent._rates(1.0, contact, stop, by_v, by_a),
            )
            rates = crossing.rates_since_linear(found, rates, by_v, stop)
            for k in range(7):
                out[row, k] = rates[k]

    a, j, beta, rho = 3.0, 40.0, 1000.0, 3000.0
    out = np.zeros((3, 7))
    differentiate(v, a, j, beta, rho, out)
    exact = np.array(crossing.moments(v, a, j, beta, rho))
    assert out[0] == pytest.approx(exact, rel=1e-12)
    step = 1e-4
    for row, (dv, da) in enumerate(((step, 0.0), (0.0, step)), start=1):
        ends = [crossing.moments(v + k * dv, a + k * da, j, beta, rho) for k in (1, -1)]
        assert out[row] == pytest.approx(np.subtract(*ends) / (2 * step), rel=2e-5)


def state_before_a_passage(speed, rng):
    """Return a state from which the top floor reaches its stop at about this speed."""
    return np.array(
        [0.5, rng.uniform(0.8, 0.96), 1.0 - 0.06 * speed, *(0.1 * rng.standard_normal(2)), speed]
    )


@pytest.mark.parametrize(("beta", "rho"), [(1000.0, 1e4), (300.0, 3e3)])
@pytest.mark.parametrize("speed", [0.16, 0.13, 0.09, 0.06, 0.03])
def test_slow_passages_are_those_of_the_reference(beta, rho, speed):
    """`speed` is that for beta = 1000 and rho = 1e4; the turn lies as deep in the layer for all."""
    rng = np.random.default_rng(5)
    structure = Structure(3, beta, rho, 0.05)
    omega = 2.0 * math.pi / PERIOD
    flow = FlowMap(structure, omega)
    for _ in range(4):
        state = state_before_a_passage(speed * math.sqrt(beta / 1e3) * 1e4 / rho, rng)
        after, tangent = flow.monodromy(state, 0.02, 1)
        kappa = np.abs(tangent).max()
        exact = reference_points(structure, 0.02, omega, state, 1)[-1]
        assert np.abs(after - exact).max() < 1e-12 * kappa
        shrinks = math.exp(-PERIOD * np.trace(structure.damping_matrix))
        assert np.linalg.det(tangent) == pytest.approx(shrinks, rel=1e-8)
        along = rng.standard_normal(6)
        ends = [flow.advance(state + k * 1e-6 * along, 0.02, 1).state for k in (1, -1)]
        assert tangent @ along == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-5 * kappa)


@pytest.mark.parametrize(
    ("speed", "error"),
    [(0.17, 4e-13), (0.2, 2e-13), (0.25, 1e-13), (0.35, 3e-14), (0.5, 2e-14), (1.5, 2e-14)],
)
def test_fast_passages_are_those_of_the_reference(speed, error):
    rng = np.random.default_rng(6)
    structure, omega = Structure(3, 1000.0, 1e4, 0.05), 2.0 * math.pi / PERIOD
    flow = FlowMap(structure, omega)
    for _ in range(6):
        state = state_before_a_passage(speed, rng)
        after, tangent = flow.monodromy(state, 0.02, 1)
        kappa = np.abs(tangent).max()
        exact = reference_points(structure, 0.02, omega, state, 1)[-1]
        assert np.abs(after - exact).max() < error * kappa
        along = rng.standard_normal(6)
        ends = [flow.advance(state + k * 1e-6 * along, 0.02, 1).state for k in (1, -1)]
        assert tangent @ along == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-8 * kappa)
    passages, layer_steps = flow.counts[1:3]
    assert passages == 36
    assert layer_steps == 0


def test_the_rule_reaches_beyond_the_layer_of_a_sharp_contact():
    structure = Structure(2, 13.051890929725143, 5877295.249625286, 0.013653302493347801)
    omega, amplitude = 1.5323498536217297, 0.03762823835611273
    state = np.array(
        [-0.1660290282199215, 0.319497829505839, 0.2600508941402061, 0.9025608122791418]
    )
    found = FlowMap(structure, omega).advance(state, amplitude, 1)
    exact = reference_points(structure, amplitude, omega, state, 1)[-1]
    assert found.state == pytest.approx(exact, abs=1e-9)
