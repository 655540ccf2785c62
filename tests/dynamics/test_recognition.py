"""The pieces that motions are recognised by: weighted means, returns, jumps, intervals."""

import math

import numpy as np
import pytest
from maps import GOLDEN, circle, delayed_logistic, focus, logistic
from together import together

from hpcsweep.dynamics.birkhoff import agreeing_digits, weighted_growth
from hpcsweep.dynamics.classify_motion import _Classifier
from hpcsweep.dynamics.orbit import (
    _vanishes,
    closed_period,
    closing_period,
    limit_of_approach,
    orbit_period,
    returning_period,
    smallest_period,
)
from hpcsweep.dynamics.stability import aligned, growth_interval
from hpcsweep.studies.settings import SweepSettings


def test_the_tangent_of_the_circle_is_its_derivative():
    solver, z = circle(GOLDEN, 3, 0.2), np.array([0.7, 0.9])
    for column in np.eye(2):
        difference = solver.step(z + 1e-6 * column) - solver.step(z - 1e-6 * column)
        assert difference / 2e-6 == pytest.approx(solver.tangent(z) @ column, abs=1e-9)


def test_what_returns_nearest_is_found_and_nothing_on_a_golden_rotation():
    angle = 2 * np.pi * np.outer(np.arange(900), (GOLDEN, 13 / 34))
    golden, locked = (np.stack((np.cos(a), np.sin(a)), axis=1) for a in angle.T)
    assert returning_period(golden, 450, 1e-3) == 0
    assert returning_period(golden, 450, 0.02) == 377
    assert returning_period(locked * 0.999 ** np.arange(900)[:, None], 450, 0.05) == 34
    assert returning_period(locked, 33, 0.05) == 0


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


def test_weighted_growth_is_none_on_a_torus_and_the_exponent_of_a_lock():
    def both(solver):
        seen = solver.grow(solver.points((0.3, 0.4), 1.0, 4000)[0][-1], 1.0, 1000)
        return weighted_growth(seen.logarithms[200:]), seen.logarithms[200:].sum()

    swings = []
    for pull in (0.3, 0.6, 0.9):
        growth, plain = both(circle(GOLDEN, 1, pull))
        assert max(map(abs, growth)) < 0.05
        swings.append(abs(plain))
    assert max(swings) > 0.2  # what the plain sum makes of it
    growth, _ = both(circle(34 / 89, 89, 1e-4))
    assert growth == pytest.approx([800 * math.log(1 - 0.0089)] * 3, rel=0.01)
    assert weighted_growth(np.full(9, 0.5)) == pytest.approx([4.5] * 3)


def test_what_closes_is_told_from_what_only_returns():
    turn = 2 * np.pi * np.outer(np.arange(1200), (GOLDEN, 34 / 89))
    golden, locked = (np.stack((np.cos(a), np.sin(a)), axis=1) for a in turn.T)
    assert closing_period(golden, 65, 400, 0.05, 1e-9)[0] == 0
    falling = locked * (1 + 0.01 * 0.9 ** (np.arange(1200) / 89))[:, None]
    period, distance = closing_period(falling, 65, 400, 0.05, 1e-9)
    assert period == 89
    left = 0.01 * 0.9 ** (np.arange(1200 - 178, 1200 - 89) / 89)  # a turn before the last one
    largest = 0.1 * np.abs(locked[-89:] * left[:, None]).max()
    assert distance == pytest.approx(largest, rel=1e-9)
    assert closing_period(falling, 90, 400, 0.05, 1e-9)[0] == 178
    period, distance = closing_period(locked, 65, 400, 0.05, 1e-9)
    assert period == 89
    assert distance < 1e-12


def test_an_approach_is_extrapolated_where_it_is_geometric():
    turn = 2 * np.pi * 34 / 89 * np.arange(600)
    locked = np.stack((np.cos(turn), np.sin(turn)), axis=1)

    def after(ratio, *more):
        """Points of angles that approach those of the orbit by `ratio` a turn."""
        away = 1e-3 * ratio ** (np.arange(600.0) / 89) + sum(more)
        return np.stack((np.cos(turn + away), np.sin(turn + away)), axis=1)

    for ratio in (0.2, 0.9, 0.97):
        limit = limit_of_approach(after(ratio), 89)
        apart = np.abs(after(ratio) - locked)[-89:]
        assert np.abs(limit - locked[-89:])[-1].max() < 2e-3 * apart[-1].max()
        assert np.abs(limit - locked[-89:]).max() < 0.03 * apart.max()
    alternating = approach([0.5, 0.7], [1e-4], [-0.95], 60)
    assert limit_of_approach(alternating, 1) is None
    assert limit_of_approach(approach([0.5], [1e-4], [-0.95], 60), 1)[0] == pytest.approx([0.5])
    assert limit_of_approach(after(0.99), 89) is None  # hardly nearer in a turn
    slower = 2e-3 / (1 + np.arange(600.0) / 89)  # as 1 / k: no orbit is approached
    assert limit_of_approach(after(0.0, slower), 89) is None
    assert limit_of_approach(np.zeros((9, 2)), 1) is None
    aside = approach([0.5], [1e-4], [0.9], 60) * [1.0, 0.0]
    aside[:, 1] = 1e-4 * 0.8 ** np.arange(60.0) * np.cos(np.arange(60.0))
    assert limit_of_approach(aside[:9], 1) is None  # along two directions


def classifier(solver):
    return _Classifier(solver, 1.0, SweepSettings(), None, 1000, 100)


def last_turn(solver, z, period):
    """Return points that come from elsewhere to z, and go round once from there."""
    elsewhere = np.linspace(0.1, 0.3, 4 * period)[:, None] * [1.0, -1.0]
    return np.concatenate((elsewhere, z[None], solver.points(z, 1.0, period)[0]))


@pytest.mark.parametrize(("off", "goes"), [(1e-4, True), (0.05, False)])
def test_a_jump_lands_on_the_orbit_that_the_last_turn_goes_to(off, goes):
    solver = logistic(3.3)
    orbit = np.roots([1, -1 - 1 / 3.3, (1 + 1 / 3.3) / 3.3]).real  # of period 2
    for period in (2, 4):
        points = last_turn(solver, np.array([orbit[0] + off, 1e-4]), period)
        search = classifier(solver)
        end, motion = search._jump(points, period)
        assert np.array_equal(end, points[-1])
        assert (motion is not None) is goes  # otherwise it is bent on the way
        assert search.cycles >= period
        if goes:
            assert motion.period == 2
            assert motion.points[-1] == pytest.approx([orbit[0], 0.0], abs=1e-12)
            multiplier = abs(4 + 2 * 3.3 - 3.3**2)
            assert motion.multiplier == pytest.approx(multiplier, abs=1e-9)


def test_no_motion_jumps_to_an_orbit_that_repels_and_one_on_it_is_driven_away():
    solver, point = logistic(3.3), np.array([1 - 1 / 3.3, 0.0])
    aside, search = np.array([1e-5, 0.0]), classifier(logistic(3.3))
    assert search._jump(last_turn(solver, point + aside, 1), 1)[1] is None
    for away, left in ((0.0, 1e-8), (1.0, 1e-5)):
        z, motion = search._arrive(point + away * aside, 1)
        assert motion is None
        assert z[0] - point[0] == pytest.approx(left, rel=1e-6)


def approach(limit, amplitudes, multipliers, count=100):
    """Points that approach `limit`, a list that repeats, along real multipliers."""
    k = np.arange(count)
    points = np.array(limit, float)[k % len(limit)][:, None]
    for a, mu in zip(amplitudes, multipliers, strict=True):
        points = points + (a * float(mu) ** k)[:, None]
    return points


def test_an_approach_is_no_orbit_of_twice_the_period():
    points = approach([0.5], [1e-4], [-0.99])
    assert orbit_period(points, 16, 1e-5) == 2  # what the window test says
    assert closed_period(points, 16, 1e-5) == 0
    assert closed_period(approach([0.5], [1e-4], [-0.99], 2000), 16, 1e-5) == 1


def test_neighbours_that_still_come_closer_are_no_orbit():
    points = approach([0.5], [1e-3], [0.999])
    assert orbit_period(points, 16, 1e-5) == 1
    assert closed_period(points, 16, 1e-5) == 0


@together("apart", [1e-4, 3e-5, 1.1e-5])
@together("mu", [0.5, -0.9, 0.97])
def test_branches_that_are_close_are_an_orbit(apart, mu):
    points = approach([0.5, 0.5 + apart], [1e-6], [mu])
    assert closed_period(points, 16, 1e-5) == 2


@together(
    "three, vanishes",
    [
        # of L + c q^k the limit is L: here 0.49 and 0.51 of the last distance, and below 0
        ((0.49 + 0.51 * 4, 0.49 + 0.51 * 2, 1.0), True),
        ((0.51 + 0.49 * 4, 0.51 + 0.49 * 2, 1.0), False),
        ((2.8, 1.5, 1.0), False),
        # no slower from stretch to stretch: straight on to 0
        ((3.0, 2.0, 1.0), True),
        # no fall
        ((2.0, 3.0, 1.0), False),
        ((3.0, 1.0, 1.0), False),
        ((1.0, 2.0, 3.0), False),
    ],
)
def test_distances_vanish_whose_limit_is_less_than_half_of_the_last(three, vanishes):
    assert _vanishes(np.array(three)) is vanishes


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
    assert growth_interval(np.array([1.0] * 99 + [-math.inf])) == (-math.inf,) * 3
    assert growth_interval(np.full(100, 0.25)) == (0.25, 0.25, 0.25)
    assert growth_interval(np.full(100, 0.25)).times(2.0).high == 0.5
    assert aligned(np.arange(100.0)).tolist() == list(range(10, 100))
