"""Contacts that pass their layers at the same time: in closed form where that is right."""

import math

import numpy as np
import pytest
from reference import reference_points
from tools import DESCRIBED

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap

OMEGA = 2.0 * math.pi / 0.06
"""A period that ends before a floor is back at its stop."""


def states(rng, slowest, fastest, apart):
    """Return states from which two floors reach their stops within `apart` of each other."""
    speeds = rng.uniform(slowest, fastest, 2)
    times = 0.03 + rng.uniform(-0.5, 0.5, 2) * apart
    first, second = rng.permutation(3)[:2]
    u, v = rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.5, 0.5, 3)
    for floor, speed, time in zip((first, second), speeds, times, strict=True):
        u[floor], v[floor] = 1.0 - speed * time, speed
    return np.concatenate((u, v))


@pytest.mark.parametrize("damping", [0.05, DESCRIBED])
def test_fast_floors_that_pass_together_need_no_integration(damping):
    rng = np.random.default_rng(3)
    structure = Structure(3, 1000.0, 1e4, damping)
    flow = FlowMap(structure, OMEGA)
    worst = 0.0
    for _ in range(60):
        state = states(rng, 0.6, 1.2, 6e-3)
        after, tangent = flow.monodromy(state, 0.02, 1)
        exact = reference_points(structure, 0.02, OMEGA, state, 1)[-1]
        worst = max(worst, np.abs(after - exact).max() / np.abs(tangent).max())
    assert flow.counts[1] >= 120
    assert flow.counts[2] == 0
    assert worst < 1e-12


@pytest.mark.parametrize("damping", [0.05, DESCRIBED])
def test_floors_that_pass_together_are_those_of_the_reference(damping):
    """Slower ones are integrated where what they do to each other is not negligible."""
    rng = np.random.default_rng(4)
    structure = Structure(3, 1000.0, 1e4, damping)
    flow = FlowMap(structure, OMEGA)
    for _ in range(60):
        state = states(rng, 0.15, 0.6, 2e-2)
        after, tangent = flow.monodromy(state, 0.02, 1)
        exact = reference_points(structure, 0.02, OMEGA, state, 1)[-1]
        # one alone at 0.34, the slowest that `crossing` takes, is wrong by 5e-12
        assert np.abs(after - exact).max() < 6e-12 * np.abs(tangent).max()
    assert flow.counts[1] > 0
    assert flow.counts[2] > 0
