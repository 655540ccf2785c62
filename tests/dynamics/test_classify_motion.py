"""Decided motions, on maps whose motion is known from theory and on structures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from maps import GOLDEN, circle, delayed_logistic, focus, henon, logistic
from together import together
from tools import DESCRIBED

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import CONFIRMED, classify_motion
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.records import Observation
from hpcsweep.solvers.solver import make_solver
from hpcsweep.studies.settings import SweepSettings

SETTINGS = SweepSettings(period_tolerance=1e-8)


def reported(solver, start=(0.3, 0.4), max_cycles=50_000, **more):
    return classify_motion(solver, np.array(start), 1.0, SETTINGS, max_cycles, **more)


@together("modulus", [0.2, 0.9, 0.99, 0.999, 0.9995])
@together("turns", [0.0, 0.5, GOLDEN, 1 / 3 + 1e-4])
def test_a_slow_approach_is_an_orbit_of_period_1(modulus, turns):
    motion = reported(focus(modulus, turns))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 1)
    assert np.abs(motion.points - [1.0, 2.0]).max() < 1e-9
    assert motion.multiplier == pytest.approx(modulus, abs=1e-9)
    assert motion.interval.mean == pytest.approx(math.log(modulus), abs=1e-9)
    assert motion.interval.low == motion.interval.mean == motion.interval.high


@together(
    "r, period",
    # doublings at 3, 1 + sqrt 6, 3.54409, ...; windows of 3, 5, 6 and 7 (May, Nature 261, 1976)
    [
        *((2.9, 1), (3.0005, 2), (3.3, 2), (3.4494, 2), (3.45, 4), (3.5, 4), (3.55, 8)),
        *((3.566, 16), (3.569, 32), (3.83, 3), (3.8427, 6), (3.7389, 5), (3.6273, 6), (3.7017, 7)),
    ],
)
def test_periods_of_the_logistic_map(r, period):
    motion = reported(logistic(r))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, period)
    product = abs(np.prod(r * (1 - 2 * motion.points[:, 0])))
    assert motion.multiplier == pytest.approx(product, abs=1e-7)


@pytest.mark.parametrize("r", [3.58, 3.6, 3.7, 3.9, 4.0 - 1e-9])
def test_chaos_of_the_logistic_map_has_its_exponent_in_its_interval(r):
    motion = reported(logistic(r))
    assert motion.kind is MotionClass.CHAOTIC
    assert 0 < motion.interval.low < motion.interval.mean < motion.interval.high
    x, total, count = 0.3, 0.0, 200_000
    for k in range(count + 1000):
        x = r * x * (1 - x)
        if k >= 1000:
            total += math.log(abs(r * (1 - 2 * x)))
    half = motion.interval.high - motion.interval.low
    assert motion.interval.low - half < total / count < motion.interval.high + half


def test_chaos_and_orbit_of_the_henon_map():
    motion = reported(henon(1.4), (0.1, 0.1))
    assert motion.kind is MotionClass.CHAOTIC
    assert motion.interval.low < 0.419 + 0.1
    assert motion.interval.high > 0.419 - 0.1  # 0.4192 (Sprott, Chaos and Time-Series Analysis)
    motion = reported(henon(1.25), (0.1, 0.1))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 7)


@pytest.mark.parametrize("a", [2.01, 2.05, 2.1])
def test_a_torus(a):
    motion = reported(delayed_logistic(a), (0.4, 0.4))
    assert motion.kind is MotionClass.QUASI_PERIODIC
    assert abs(motion.interval.mean) < 0.01
    assert motion.period == 0


def test_before_the_torus_and_locked_on_it():
    motion = reported(delayed_logistic(1.99), (0.4, 0.4))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 1)
    motion = reported(delayed_logistic(2.18), (0.4, 0.4))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 7)


@pytest.mark.parametrize(
    ("period", "pull"), [(89, 1e-4), (89, 2e-5), (233, 1e-5), (377, 3e-5), (377, 1e-6)]
)
def test_what_a_circle_is_locked_to(period, pull):
    """Angles k pi / order attract for odd k; those around are approached by 1 - order pull."""
    turns = {89: 34, 233: 144, 377: 144}[period] / period
    motion = reported(circle(turns, period, pull))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, period)
    assert motion.multiplier == pytest.approx((1 - period * pull) ** period, abs=1e-6)
    # three turns to be seen to close, three for Newton's method, two to verify it to rounding, and
    # what finding out takes
    assert motion.cycles < 8 * period + 1100


@pytest.mark.parametrize("pull", [0.0, 0.3, 0.9])
def test_a_circle_without_a_lock_is_a_torus_soon(pull):
    motion = reported(circle(GOLDEN, 1, pull))
    assert motion.kind is MotionClass.QUASI_PERIODIC
    assert motion.cycles <= 1100
    assert motion.interval.low <= 0 <= motion.interval.high


def test_chaos_that_stays_within_the_near_of_an_orbit_is_chaos():
    """Beyond the doublings there are 2^k bands; those of 3.56996 are narrower than `NEAR`."""
    solver = logistic(3.56996)
    points, _ = solver.points((0.3, 0.0), 1.0, 3000)
    assert 1e-6 < np.ptp(points[2000::64, 0]) < 1e-3
    motion = reported(solver)
    assert motion.kind is MotionClass.CHAOTIC
    assert motion.interval.low > 0


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
    """P100 of multiplier 0.94: 6e-4 a period, less than the growth over 800 periods can resolve."""
    solver = make_solver("flow", Structure(damping_ratio=DESCRIBED), 0.445, 1e-9)
    motion = classify_motion(solver, np.array(state), 0.1014964, SweepSettings(), 50_000)
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 100)
    assert motion.multiplier == pytest.approx(0.94, abs=2e-3)


def test_a_point_that_repels_is_left():
    motion = reported(logistic(3.3), (1 - 1 / 3.3, 0.0))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 2)


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-6])
def test_an_orbit_that_hardly_repels_is_left_too(off):
    r = 3.0017  # the multiplier of the orbit of period 1 is 2 - r
    motion = reported(logistic(r), (1 - 1 / r + off, 0.0))
    assert (motion.kind, motion.period) == (MotionClass.PERIODIC, 2)


def test_the_cap_is_kept_and_said():
    solver = focus(0.99999, GOLDEN)
    motion = reported(solver, max_cycles=300)
    assert motion.kind is MotionClass.UNDECIDED
    assert 0 < motion.cycles <= 310
    assert reported(solver, max_cycles=0).cycles == 0


def test_a_window_is_the_first_round():
    solver = logistic(3.9)
    seen = solver.grow((0.3, 0.0), 1.0, 200)
    rest = seen.outcome, seen.growth, seen.logarithms
    window = Observation(seen.points, 1, 0.0, np.full(1, math.nan), *rest)
    motion = reported(solver, window.points[-1], window=window)
    assert (motion.kind, motion.cycles) == (MotionClass.CHAOTIC, CONFIRMED)
    assert motion.seen is window


def test_a_torus_is_told_from_its_window_on():
    """What its window shows is what it is."""
    solver = circle(GOLDEN, 1, 0.3)
    state = solver.points((0.3, 0.4), 1.0, 500)[0][-1]
    seen = solver.grow(state, 1.0, 100)
    rest = seen.outcome, seen.growth, seen.logarithms
    window = Observation(seen.points, 1, 0.0, np.full(1, math.nan), *rest)
    alone = reported(solver, window.points[-1], window=window)
    window = replace(window, direction=seen.direction)
    motion = reported(solver, window.points[-1], window=window)
    assert motion.kind is alone.kind is MotionClass.QUASI_PERIODIC
    assert motion.cycles == alone.cycles == 200
    assert (motion.seen, alone.seen) == (window, None)
    assert len(motion.points) == 300
    np.testing.assert_array_equal(motion.points[:100], window.points)


@pytest.mark.parametrize("amplitude", [0.06, 0.068, 0.0987])
def test_motions_of_a_building(amplitude):
    solver = make_solver("flow", Structure(damping_ratio=0.05), 0.445, 1e-9)
    settings = SweepSettings()
    motion = classify_motion(solver, np.zeros(6), amplitude, settings, 20_000)
    assert motion.kind is MotionClass.PERIODIC
    again, matrix = solver.monodromy(motion.points[-1], amplitude, motion.period)
    assert np.abs(again - motion.points[-1]).max() < 1e-9
    assert motion.multiplier == pytest.approx(np.abs(np.linalg.eigvals(matrix)).max(), abs=1e-5)
    assert motion.multiplier < 1
