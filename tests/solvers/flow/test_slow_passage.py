"""Slow passages of a layer in closed form: rule, series, and against the reference."""

import math

import numpy as np
import pytest
from building import generator
from reference import reference_points

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.linear import step
from hpcsweep.solvers.flow.passage import slow_passage
from hpcsweep.solvers.flow.rules import gauss

PERIOD = 1.0
"""Short: the floor passes its stop once and comes back."""


def integral(function, first, last):
    """Integrate over panels of a length of 1 at most."""
    x, w = np.polynomial.legendre.leggauss(40)
    edges = np.linspace(first, last, math.ceil(last - first) + 1)
    half = 0.5 * np.diff(edges)[:, None]
    return float(np.sum(half * w * function(edges[:-1, None] + half * (x + 1.0))))


def test_rule_integrates_polynomials_from_both_ends_to_each_node():
    nodes, reach = gauss.NODES, gauss.REACH
    for k in (0, 1, 5, 15):

        def weighted(y, k=k):
            return y**k / (1.0 + np.exp(y))

        whole = integral(weighted, 0.0, reach)
        assert gauss.WEIGHTS @ nodes**k == pytest.approx(whole, rel=1e-12)
        for i in (0, 7, 15):
            part = integral(weighted, 0.0, nodes[i])
            assert nodes**k @ gauss.DEPARTING[:, i] == pytest.approx(
                part, rel=1e-11, abs=1e-12 * whole
            )
            assert nodes**k @ gauss.ARRIVING[:, i] == pytest.approx(
                whole - part, rel=1e-11, abs=1e-12 * whole
            )


def test_rule_integrates_the_derivative_of_the_force():
    def force(y):
        return y / (1.0 + np.exp(y))

    nodes, reach = gauss.NODES, gauss.REACH
    for k in range(1, 15):
        # by parts
        exact = reach**k * force(reach) - k * integral(
            lambda y, k=k: y ** (k - 1) * force(y), 0.0, reach
        )
        found = (gauss.WEIGHTS * gauss.DERIVATIVE) @ nodes**k
        assert found == pytest.approx(exact, rel=1e-11)


@pytest.mark.parametrize("key", [0, 2, 5])
def test_series_are_those_of_the_exponential(key):
    from scipy.linalg import expm

    structure = Structure(3, 1000.0, 1e4, (0.05, 0.3, 1.4))
    omega = 0.445
    flow = FlowMap(structure, omega)
    store = flow._shared.tables
    index = step.lookup(np.uint64(key), flow._packed)
    s = 1e-3
    powers = s ** np.arange(slow_passage.LANES)
    exact = expm(generator(structure, key, omega) * s)
    for contact in range(3):
        assert store.series[index, contact] @ powers == pytest.approx(exact[contact], abs=1e-15)
        assert powers @ store.impulses[index, contact][:, :6] == pytest.approx(
            exact[:6, 3 + contact], abs=1e-15
        )


def state_before_a_passage(speed, rng):
    """Return a state from which the top floor reaches its stop at about this speed."""
    return np.array(
        [0.5, rng.uniform(0.8, 0.96), 1.0 - 0.06 * speed, *(0.1 * rng.standard_normal(2)), speed]
    )


@pytest.mark.parametrize(("beta", "rho", "late"), [(1000.0, 1e4, 0), (300.0, 3e3, 8)])
@pytest.mark.parametrize(
    ("speed", "most_steps"), [(0.16, 0), (0.13, 0), (0.09, 12), (0.06, 12), (0.03, 10)]
)
def test_slow_passages_are_those_of_the_reference(beta, rho, late, speed, most_steps):
    """`speed` is that for beta = 1000 and rho = 1e4; the turn lies as deep in the layer for all.

    `late`: steps of a way back that is not over when the period ends.
    """
    rng = np.random.default_rng(5)
    structure = Structure(3, beta, rho, 0.05)
    omega = 2.0 * math.pi / PERIOD
    flow = FlowMap(structure, omega)
    for _ in range(4):
        state = state_before_a_passage(speed * math.sqrt(beta / 1e3) * 1e4 / rho, rng)
        before = flow.counts.copy()
        after, tangent = flow.monodromy(state, 0.02, 1)
        steps = (flow.counts - before)[2]
        assert steps <= most_steps + late
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
    [(0.17, 4e-13), (0.2, 2e-13), (0.25, 1e-13), (0.35, 3e-14), (0.5, 1e-14), (1.5, 1e-14)],
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
