"""Orbits are where Newton's method converges to rounding: folds, ghosts, grazings, periods."""

from dataclasses import replace

import numpy as np
import pytest
from maps import MapSolver, circle, henon, logistic

from hpcsweep import Structure, orbit, stroboscopic_points
from hpcsweep.dynamics.verification import _moves, verify_orbit
from hpcsweep.solvers.solver import make_solver

STIFF = Structure(1, 29.0, np.inf, 0.01, gap=1.26)
OMEGA = 0.801
FOLD = 0.22123998868537
"""Of a P2 of Figure 3, at Omega = 0.445; its ghost is beyond it."""
GHOST = [-1.06494747, -0.97253925, -0.75349119, 0.10228275, -0.55425377, -0.16674925]


def tangency(delta):
    """x -> x + delta + x^2: orbits at -+sqrt(-delta), a ghost if delta > 0."""
    return MapSolver(
        lambda z: np.array([z[0] + (delta + z[0] ** 2), 0.3 * z[1]]),
        lambda z: np.array([[1 + 2 * z[0], 0.0], [0.0, 0.3]]),
    )


@pytest.mark.parametrize("delta", [1e-14, 1e-12, 1e-10, 1e-8, 1e-5])
@pytest.mark.parametrize("side", [1.0, 20.0])
def test_a_ghost_is_no_orbit_and_two_that_are_about_to_meet_are(delta, side):
    size = np.sqrt(delta)
    start = np.array([-side * size, 1e-9])
    found = verify_orbit(tangency(delta), start, 1.0, 1)
    assert found.orbit is None
    assert found.residual == pytest.approx(delta, rel=0.8)  # nowhere less than it
    assert found.cycles < 60
    there = verify_orbit(tangency(-delta), start, 1.0, 1).orbit
    # of the condition of the orbit's position: eps / |1 - mu|
    assert abs(there.points[0, 0]) == pytest.approx(size, abs=1e-15 / size)
    assert there.maps.multipliers[0] == pytest.approx(1 - 2 * size, abs=1e-15 / size)


def test_an_orbit_at_its_fold_is_known_to_the_root_of_rounding():
    for solver in (tangency(0.0), tangency(1e-17), tangency(-1e-17)):
        found = verify_orbit(solver, np.array([-1e-3, 0.0]), 1.0, 1)
        assert abs(found.orbit.points[0, 0]) < 1e-7


@pytest.mark.parametrize("away", [-1e-4, 1e-6, 1e-3])
def test_an_orbit_at_a_grazing_is_found_from_either_side(away):
    # x -> x / 2 - 30 (x - a)^(3/2) past a: the orbit is 0, with a tangent map of a root beside it
    edge = 1e-7

    def step(z):
        past = max(z[0] - edge, 0.0)
        return np.array([z[0] / 2 - 30 * past**1.5, 0.0])

    solver = MapSolver(step, lambda z: np.diag([0.5 - 45 * max(z[0] - edge, 0.0) ** 0.5, 0.0]))
    found = verify_orbit(solver, np.array([away, 0.0]), 1.0, 1).orbit
    assert found.points[0] == pytest.approx([0.0, 0.0], abs=1e-15)


def test_an_orbit_has_its_minimal_period_and_its_own_multipliers():
    solver = logistic(3.3)
    first, last = np.sort(np.roots([1, -1 - 1 / 3.3, (1 + 1 / 3.3) / 3.3]).real)
    for period in (2, 4, 6, 300):
        found = verify_orbit(solver, np.array([first + 1e-9, 0.0]), 1.0, period).orbit
        assert found.points == pytest.approx(np.array([[first, 0.0], [last, 0.0]]), abs=1e-14)
        assert found.maps.multipliers[0] == pytest.approx(4 + 2 * 3.3 - 3.3**2, abs=1e-12)
    near = 1e-9 * np.ones(2)
    assert verify_orbit(henon(1.0), near, 1.0, 7).cycles > 0
    assert (
        verify_orbit(circle(34 / 89, 89, 1e-4), np.array([1.0, 1e-4]), 1.0, 89).orbit.period == 89
    )
    # just past a doubling its points are 2e-4 apart, and are those of an orbit of 2
    r = 3 + 1e-8
    apart = np.sqrt((r - 3) * (r + 1)) / r
    found = verify_orbit(logistic(r), np.array([2 / 3 + 0.6 * apart, 0.0]), 1.0, 2).orbit
    assert np.ptp(found.points[:, 0]) == pytest.approx(apart, rel=1e-3)


def test_the_moves_of_an_orbit_solve_the_equations_of_all_its_points():
    rng = np.random.default_rng(1)
    for period in (1, 2, 3, 8, 37, 300):
        maps, misses = 0.45 * rng.normal(size=(period, 4, 4)), rng.normal(size=(period, 4))
        moves = _moves(maps, misses)
        left = np.einsum("pij,pj->pi", maps, moves) - np.roll(moves, -1, axis=0) - misses
        assert np.abs(left).max() < 1e-12 * np.abs(moves).max()


def test_a_solver_that_fails_verifies_nothing():
    class Failing(MapSolver):
        def monodromy(self, state, amplitude, n_periods):
            raise ArithmeticError("no")

    found = verify_orbit(Failing(None, None), np.zeros(2), 1.0, 1)
    assert found.orbit is None
    assert found.residual == np.inf


def test_past_a_fold_of_figure_3_there_is_a_ghost_and_no_orbit():
    for beside in (1e-11, 1.3e-9):
        with pytest.raises(ArithmeticError, match=r"residual .* falls to .* and no further"):
            orbit(Structure(), FOLD + beside, 0.445, GHOST, 2)
    excess = []
    for beside in (1e-11, 1e-9):
        found = orbit(Structure(), FOLD - beside, 0.445, GHOST, 2)
        assert found.residual < 1e-13
        excess.append(abs(found.multipliers[0] - 1))
    assert excess[1] / excess[0] == pytest.approx(10, rel=0.05)  # like the root of the distance


@pytest.mark.parametrize("period", [14, 50])
def test_a_ghost_passed_many_times_is_no_orbit_either(period):
    """What curvature adds along a turn is a multiple of what it adds in a period."""
    solver = make_solver("flow", Structure(), 0.445, 1e-9)
    for beside in (1e-13, 1e-12, 1e-11):
        assert verify_orbit(solver, np.array(GHOST), FOLD + beside, period).orbit is None
    found = verify_orbit(solver, np.array(GHOST), FOLD - 1e-11, period).orbit
    assert found.period == 2


def test_a_stop_request_interrupts_a_verification():
    polled = []

    def poll():
        polled.append(1)
        if len(polled) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        verify_orbit(logistic(3.3), np.array([0.48, 0.0]), 1.0, 2, poll=poll)
    assert len(polled) == 3


@pytest.mark.slow
def test_bdf_verifies_the_orbit_that_flow_does():
    own, amplitude = STIFF.measured_at(OMEGA, 0.454), 0.454
    z = stroboscopic_points(STIFF, amplitude, OMEGA, np.zeros(2), 3000)[-1]
    by_flow = verify_orbit(make_solver("flow", own, OMEGA, 1e-9), z, amplitude, 5).orbit
    by_bdf = verify_orbit(make_solver("bdf", own, OMEGA, 1e-8), z, amplitude, 5)
    assert by_bdf.orbit.period == by_flow.period == 5
    assert by_bdf.orbit.points == pytest.approx(by_flow.points, abs=1e-4)
    assert by_bdf.orbit.multiplier == pytest.approx(by_flow.multiplier, rel=1e-2)


def plain_newton(solver, z, amplitude, period):
    """Newton's method on one state, with the product of the tangent maps."""
    for _ in range(12):
        image, matrix = solver.monodromy(z, amplitude, period)
        z = z - np.linalg.solve(matrix - np.eye(2), image - z)
    return z, np.abs(solver.monodromy(z, amplitude, period)[0] - z).max()


@pytest.mark.slow
def test_orbits_past_a_grazing_are_found_from_where_plain_newton_finds_them():
    random, tried = np.random.default_rng(3), 0
    for amplitude in np.linspace(0.4495, 0.46, 6):
        solver = make_solver("flow", STIFF.measured_at(OMEGA, amplitude), OMEGA, 1e-9)
        for period in (1, 2, 3, 4, 5):
            z = stroboscopic_points(STIFF, amplitude, OMEGA, random.uniform(-2, 2, 2), 300)[-1]
            there, misses = plain_newton(solver, z, amplitude, period)
            if misses > 1e-12:
                continue
            for size in (0.0, 0.01, 0.03):
                start = there + size * random.uniform(-1, 1, 2)
                other, misses = plain_newton(solver, start, amplitude, period)
                if misses <= 1e-12 and np.abs(other - start).max() < 0.1:
                    found = orbit(STIFF, amplitude, OMEGA, start, period)
                    assert found.residual < 1e-13
                    assert period % found.period == 0
                    again, _ = plain_newton(solver, found.points[0], amplitude, period)
                    assert found.points[0] == pytest.approx(again, abs=1e-11)
                    tried += 1
    assert tried > 50


def test_an_orbit_is_shown_in_a_line():
    z = stroboscopic_points(STIFF, 0.454, OMEGA, np.zeros(2), 3000)[-1]
    found = orbit(STIFF, 0.454, OMEGA, z, 10)
    assert (found.period, found.points.shape, len(found.signature)) == (5, (5, 2), 6)
    assert repr(found).startswith("Orbit(P5, stable, largest multiplier ")
    shown = repr(
        replace(found, points=np.tile(found.points, (20, 1)), signature=found.signature * 40)
    )
    assert "Orbit(P100, " in shown
    assert "... 240 in all" in shown
    assert len(shown) < 240
