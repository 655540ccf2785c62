"""Decided motions, on maps whose motion is known from theory and on structures."""

import math

import numpy as np
import pytest

from hpcsweep.dynamics.birkhoff import agreeing_digits
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.decide import CONFIRMED, decide
from hpcsweep.dynamics.exponent import aligned, growth_interval
from hpcsweep.dynamics.orbit import (
    closed_period,
    orbit_period,
    returning_period,
    smallest_period,
)
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Growth, Observation, window_growth
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

SETTINGS = SweepSettings(period_tolerance=1e-8)
GOLDEN = (math.sqrt(5) - 1) / 2


class MapSolver:
    """A map of the plane behind the interface of the solvers; Omega = 2 pi makes T = 1."""

    omega = 2 * math.pi
    structure = Structure(1)

    def __init__(self, step, tangent):
        self.step, self.tangent = step, tangent

    def points(self, state, amplitude, n_periods, poll=None):
        points = np.empty((n_periods, 2))
        z = np.array(state, float)
        for k in range(n_periods):
            z = points[k] = self.step(z)
        return points, Outcome.COMPLETE

    def settle(self, state, amplitude, n_periods, *rules):
        points, outcome = self.points(state, amplitude, n_periods)
        return Approach(points[-1], n_periods, 0, 0, math.nan, outcome)

    def grow(self, state, amplitude, n_periods, poll=None):
        points, outcome = self.points(state, amplitude, n_periods)
        vector = np.full(2, math.sqrt(0.5))
        logarithms = np.empty(n_periods)
        for k, z in enumerate([np.asarray(state, float), *points[:-1]]):
            vector = self.tangent(z) @ vector
            length = np.linalg.norm(vector)
            logarithms[k] = math.log(length) if length > 0 else -math.inf
            vector = vector / (length or 1.0)
        return Growth(points, outcome, window_growth(logarithms), logarithms)

    def monodromy(self, state, amplitude, n_periods):
        z, matrix = np.array(state, float), np.eye(2)
        for _ in range(n_periods):
            matrix = self.tangent(z) @ matrix
            z = self.step(z)
        return z, matrix


def focus(modulus, turns):
    """A fixed point at (1, 2) with multipliers modulus exp(+-2 pi i turns)."""
    c, s = math.cos(2 * math.pi * turns), math.sin(2 * math.pi * turns)
    matrix = modulus * np.array([[c, -s], [s, c]])
    centre = np.array([1.0, 2.0])
    return MapSolver(lambda z: centre + matrix @ (z - centre), lambda z: matrix)


def logistic(r):
    """x -> r x (1 - x), beside it a coordinate that decays."""
    return MapSolver(
        lambda z: np.array([r * z[0] * (1 - z[0]), 0.3 * z[1]]),
        lambda z: np.array([[r * (1 - 2 * z[0]), 0.0], [0.0, 0.3]]),
    )


def henon(a):
    return MapSolver(
        lambda z: np.array([1 - a * z[0] ** 2 + z[1], 0.3 * z[0]]),
        lambda z: np.array([[-2 * a * z[0], 1.0], [0.3, 0.0]]),
    )


def delayed_logistic(a):
    """x' = a x (1 - y), y' = x: a torus is born at a = 2 (Maynard Smith 1968)."""
    return MapSolver(
        lambda z: np.array([a * z[0] * (1 - z[1]), z[0]]),
        lambda z: np.array([[a * (1 - z[1]), -a * z[0]], [1.0, 0.0]]),
    )


def told(solver, start=(0.3, 0.4), max_cycles=50_000, **more):
    return decide(solver, np.array(start), 1.0, SETTINGS, max_cycles, **more)


@pytest.mark.parametrize("modulus", [0.2, 0.9, 0.99, 0.999, 0.9995])
@pytest.mark.parametrize("turns", [0.0, 0.5, GOLDEN, 1 / 3 + 1e-4])
def test_a_slow_approach_is_an_orbit_of_period_1(modulus, turns):
    motion = told(focus(modulus, turns))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 1)
    assert np.abs(motion.points - [1.0, 2.0]).max() < 1e-9
    assert motion.multiplier == pytest.approx(modulus, abs=1e-9)
    assert motion.exponent == pytest.approx(math.log(modulus), abs=1e-9)
    assert motion.exponent_low == motion.exponent == motion.exponent_high


@pytest.mark.parametrize(
    ("r", "period"),
    # doublings at 3, 1 + sqrt 6, 3.54409, ...; windows of 3, 5, 6 and 7 (May, Nature 261, 1976)
    [
        *((2.9, 1), (3.0005, 2), (3.3, 2), (3.4494, 2), (3.45, 4), (3.5, 4), (3.55, 8)),
        *((3.566, 16), (3.569, 32), (3.83, 3), (3.8427, 6), (3.7389, 5), (3.6273, 6), (3.7017, 7)),
    ],
)
def test_periods_of_the_logistic_map(r, period):
    motion = told(logistic(r))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, period)
    product = abs(np.prod(r * (1 - 2 * motion.points[:, 0])))
    assert motion.multiplier == pytest.approx(product, abs=1e-7)


@pytest.mark.parametrize("r", [3.58, 3.6, 3.7, 3.9, 4.0 - 1e-9])
def test_chaos_of_the_logistic_map_has_its_exponent_in_its_interval(r):
    motion = told(logistic(r))
    assert motion.kind is MotionClass.CHAOTIC
    assert 0 < motion.exponent_low < motion.exponent < motion.exponent_high
    x, total, count = 0.3, 0.0, 200_000
    for k in range(count + 1000):
        x = r * x * (1 - x)
        if k >= 1000:
            total += math.log(abs(r * (1 - 2 * x)))
    half = motion.exponent_high - motion.exponent_low
    assert motion.exponent_low - half < total / count < motion.exponent_high + half


def test_chaos_and_orbit_of_the_henon_map():
    motion = told(henon(1.4), (0.1, 0.1))
    assert motion.kind is MotionClass.CHAOTIC
    assert motion.exponent_low < 0.419 + 0.1
    assert motion.exponent_high > 0.419 - 0.1  # 0.4192 (Sprott, Chaos and Time-Series Analysis)
    motion = told(henon(1.25), (0.1, 0.1))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 7)


@pytest.mark.parametrize("a", [2.01, 2.05, 2.1])
def test_a_torus(a):
    motion = told(delayed_logistic(a), (0.4, 0.4))
    assert motion.kind is MotionClass.QUASI_PERIODIC
    assert abs(motion.exponent) < 0.01
    assert motion.period == 0


def test_before_the_torus_and_locked_on_it():
    motion = told(delayed_logistic(1.99), (0.4, 0.4))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 1)
    motion = told(delayed_logistic(2.18), (0.4, 0.4))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 7)


@pytest.mark.parametrize(
    "state",
    [
        (0.251, 0.154, 0.053, -0.95, 0.194, -0.313),
        (0.226, 0.148, 0.061, -0.94, 0.183, -0.295),
        (0.238, 0.142, 0.056, -0.92, 0.188, -0.298),
        (0.219, 0.159, 0.049, -0.949, 0.189, -0.3),
    ],
)
def test_a_torus_locked_to_a_long_orbit_that_is_approached_slowly(state):
    """P100 of multiplier 0.94: 6e-4 a period, less than the growth over 800 periods can tell."""
    ratios = (0.12622293348805766, 0.016077603302694768, 0.007699463209247604)
    solver = make_solver("flow", Structure(damping_ratio=ratios), 0.445, 1e-9)
    motion = decide(solver, np.array(state), 0.1014964, SweepSettings(), 50_000)
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 100)
    assert motion.multiplier == pytest.approx(0.94, abs=2e-3)


def test_what_returns_nearest_is_found_and_nothing_on_a_golden_rotation():
    angle = 2 * np.pi * np.outer(np.arange(900), (GOLDEN, 13 / 34))
    golden, locked = (np.stack((np.cos(a), np.sin(a)), axis=1) for a in angle.T)
    assert returning_period(golden, 450, 1e-3) == 0
    assert returning_period(golden, 450, 0.02) == 377
    assert returning_period(locked * 0.999 ** np.arange(900)[:, None], 450, 0.05) == 34
    assert returning_period(locked, 33, 0.05) == 0


def test_a_point_that_repels_is_left():
    motion = told(logistic(3.3), (1 - 1 / 3.3, 0.0))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 2)


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-6])
def test_an_orbit_that_hardly_repels_is_left_too(off):
    r = 3.0017  # the multiplier of the orbit of period 1 is 2 - r
    motion = told(logistic(r), (1 - 1 / r + off, 0.0))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 2)


def test_the_cap_is_kept_and_said():
    solver = focus(0.99999, GOLDEN)
    motion = told(solver, max_cycles=300)
    assert motion.kind is MotionClass.UNDECIDED
    assert 0 < motion.cycles <= 310
    assert told(solver, max_cycles=0).cycles == 0


def test_a_window_is_the_first_round():
    solver = logistic(3.9)
    seen = solver.grow((0.3, 0.0), 1.0, 200)
    rest = seen.outcome, seen.growth, seen.logarithms
    window = Observation(seen.points, 1, 0.0, np.full(1, math.nan), *rest)
    motion = told(solver, window.points[-1], window=window)
    assert (motion.kind, motion.cycles) == (MotionClass.CHAOTIC, CONFIRMED)
    assert motion.seen is window


@pytest.mark.parametrize("amplitude", [0.06, 0.068, 0.0987])
def test_motions_of_a_building(amplitude):
    solver = make_solver("flow", Structure(damping_ratio=0.05), 0.445, 1e-9)
    settings = SweepSettings()
    motion = decide(solver, np.zeros(6), amplitude, settings, 20_000)
    assert motion.kind is MotionClass.PERIODIC
    again, matrix = solver.monodromy(motion.points[-1], amplitude, motion.period)
    assert np.abs(again - motion.points[-1]).max() < 1e-9
    assert motion.multiplier == pytest.approx(np.abs(np.linalg.eigvals(matrix)).max(), abs=1e-5)
    assert motion.multiplier < 1


# --- the pieces


def test_weighted_means_tell_a_torus_from_chaos_and_from_an_approach():
    def digits(solver, start, count=800):
        return agreeing_digits(solver.points(start, 1.0, 4000 + count)[0][4000:])

    for a in (2.05, 2.1):
        assert digits(delayed_logistic(a), (0.4, 0.4)) > 7
    assert digits(logistic(3.9), (0.3, 0.0)) < 3
    for modulus in (0.999, 0.9999):
        assert digits(focus(modulus, GOLDEN), (0.3, 0.4)) < 2
    angle = 2 * np.pi * GOLDEN * np.arange(100.0)
    assert agreeing_digits(np.stack((np.cos(angle), np.zeros(100)), axis=1)) > 4
    assert agreeing_digits(np.zeros((8, 2))) == math.inf
    with pytest.raises(ValueError, match="points must be at least 4, are 3"):
        agreeing_digits(np.zeros((3, 2)))


def approach(limit, amplitudes, multipliers, count=100):
    """Points that approach `limit`, a list that repeats, along real multipliers."""
    k = np.arange(count)
    points = np.array(limit, float)[k % len(limit)][:, None]
    for a, mu in zip(amplitudes, multipliers, strict=True):
        points = points + (a * float(mu) ** k)[:, None]
    return points


def test_an_approach_is_no_orbit_of_twice_the_period():
    points = approach([0.5], [1e-4], [-0.99])
    assert orbit_period(points, 16, 1e-5) == 2  # what the plain test says
    assert closed_period(points, 16, 1e-5) == 0
    assert closed_period(approach([0.5], [1e-4], [-0.99], 2000), 16, 1e-5) == 1


def test_neighbours_that_still_come_closer_are_no_orbit():
    points = approach([0.5], [1e-3], [0.999])
    assert orbit_period(points, 16, 1e-5) == 1
    assert closed_period(points, 16, 1e-5) == 0


@pytest.mark.parametrize("apart", [1e-4, 3e-5, 1.1e-5])
@pytest.mark.parametrize("mu", [0.5, -0.9, 0.97])
def test_branches_that_are_close_are_an_orbit(apart, mu):
    points = approach([0.5, 0.5 + apart], [1e-6], [mu])
    assert closed_period(points, 16, 1e-5) == 2


def test_smallest_period():
    orbit = np.random.default_rng(1).normal(size=(6, 4))
    assert smallest_period(orbit, 1e-9) == 6
    assert smallest_period(np.tile(orbit[:3], (4, 1)), 1e-9) == 3
    assert smallest_period(np.tile(orbit[:1], (5, 1)), 1e-9) == 1


def test_intervals_hold_the_mean_as_often_as_they_promise():
    random = np.random.default_rng(4)
    held = 0
    for _ in range(1000):
        noise = random.normal(size=401)
        found = growth_interval(0.3 + noise[1:] + 0.5 * noise[:-1])
        held += found.low <= 0.3 <= found.high
    assert 0.92 <= held / 1000 <= 0.98


def test_what_tells_no_growth():
    assert math.isnan(growth_interval(np.zeros(3)).mean)
    assert math.isnan(growth_interval(np.array([-math.inf] * 100)).mean)
    assert growth_interval(np.full(100, 0.25)) == (0.25, 0.25, 0.25)
    assert growth_interval(np.full(100, 0.25)).times(2.0).high == 0.5
    assert aligned(np.arange(100.0)).tolist() == list(range(10, 100))
