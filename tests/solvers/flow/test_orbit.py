"""Motions that settle, and jumps to orbits that attract."""

import math

import numba
import numpy as np
import pytest
from reference import reference_points

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow.orbit.transient import MAX_WORK

compiled_only = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="many periods: too long as plain Python"
)

OMEGA = 0.445


@compiled_only
def test_settle_finds_the_period_and_agrees_with_the_long_run():
    flow = FlowMap(Structure(), OMEGA)
    for amplitude, period in ((0.06, 1), (0.1, 2)):
        settled = flow.settle(np.zeros(6), amplitude, 200, 16, 1e-10, 1e-6)
        assert (settled.period, settled.n_newton) == (period, 0)
        assert math.isnan(settled.multiplier)
        assert settled.n_periods < 100
        further = flow.advance(settled.state, amplitude, 60 * period).state
        assert np.abs(further - settled.state).max() < 1e-9


@compiled_only
def test_a_jump_ends_on_the_orbit_with_its_multiplier():
    flow = FlowMap(Structure(), OMEGA)
    jumps = 0
    for amplitude, period in ((0.06, 1), (0.1, 2), (0.03, 1)):
        jump = flow.settle(np.zeros(6), amplitude, 300, 16, 1e-10, 1e-6, 1e-3)
        assert jump.period == period
        assert jump.n_newton >= period
        jumps += not math.isnan(jump.multiplier)
        image = flow.advance(jump.state, amplitude, period).state
        assert np.abs(image - jump.state).max() < 1e-11
        further = flow.advance(jump.state, amplitude, 60 * period).state
        assert np.abs(further - jump.state).max() < 1e-9
        _, matrix = flow.monodromy(jump.state, amplitude, period)
        exact = np.abs(np.linalg.eigvals(matrix)).max()
        assert jump.multiplier == pytest.approx(exact, rel=1e-5)
    assert jumps == 3


@compiled_only
def test_a_jump_ends_as_near_the_orbit_as_rounding_lets_it():
    flow = FlowMap(Structure(), OMEGA)
    jumps = 0
    for amplitude in np.linspace(0.02, 0.11, 91):
        jump = flow.settle(np.zeros(6), amplitude, 300, 16, 1e-10, 1e-6, 1e-3)
        if math.isnan(jump.multiplier):
            continue
        jumps += 1
        image, matrix = flow.monodromy(jump.state, amplitude, jump.period)
        off = np.linalg.solve(matrix - np.eye(6), image - jump.state)
        assert np.abs(off).max() < 2e-13
        if amplitude == pytest.approx(0.086):
            exact = reference_points(flow.structure, amplitude, OMEGA, jump.state, jump.period)
            off = np.linalg.solve(matrix - np.eye(6), exact[-1] - jump.state)
            assert np.abs(off).max() < 2e-12
    assert jumps > 80


@compiled_only
def test_no_jump_to_an_orbit_that_repels():
    flow = FlowMap(Structure(), OMEGA)
    rules = (2000, 16, 1e-10, 1e-6, 1e-3)
    z = flow.settle(np.zeros(6), 0.07, *rules).state
    # the orbit of period 1, followed beyond where it doubles
    for amplitude in np.linspace(0.07, 0.0987, 60):
        for _ in range(6):
            image, matrix = flow.monodromy(z, amplitude, 1)
            z = z - np.linalg.solve(matrix - np.eye(6), image - z)
    assert np.abs(image - z).max() < 1e-10
    assert np.abs(np.linalg.eigvals(matrix)).max() > 1.1
    # the motion beside it stays near at first, and is not taken for one that approaches
    found = flow.settle(z + 1e-7, 0.0987, *rules)
    assert found.period == 2
    assert found.multiplier < 1.0
    assert np.abs(found.state - z).max() > 1e-3


@compiled_only
@pytest.mark.slow
def test_periods_that_become_slow_at_once_do_not_delay_polls():
    """With 31 stops hardly any set of them returns, and each needs a table of its own."""
    structure = Structure(31, 1000.0, 1e4, 0.05)
    flow = FlowMap(structure, 0.2772)
    rest, n_periods, work = np.zeros(62), 16, []
    flow.settle(rest, 0.001, 1000, 16, 1e-10, 1e-6)
    assert flow._polling.begin() >= n_periods

    def polled():
        work.append(flow.counts[0] + flow.counts[2] + 62 * flow.counts[4])

    end = flow.settle(rest, 0.25, n_periods, 16, 1e-10, 1e-6, poll=polled)
    polled()
    assert end.n_periods == n_periods
    pieces, work = np.diff(work), []
    for _ in range(n_periods):
        rest = flow.advance(rest, 0.25, 1).state
        polled()
    assert pieces.max() <= MAX_WORK / 62**2 + np.diff(work).max()
    assert pieces.size >= 3
