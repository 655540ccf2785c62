"""Lifetimes of transient chaos and return times, of synthetic data whose answer is known."""

import math

import numpy as np
import pytest
from maps import GOLDEN

from hpcsweep import mean_lifetime, return_times
from hpcsweep.dynamics.lifetime import follow_to_ends


def test_the_interval_of_a_lifetime_in_closed_form():
    """Garwood, Biometrika 28 (1936) 437: of 10 events 4.795 to 18.39; of 1 0.0253 to 5.572."""
    found = mean_lifetime([100] * 10 + [500] * 2, [True] * 10 + [False] * 2)
    assert found.mean == 200
    assert (found.low, found.high) == pytest.approx((2000 / 18.390, 2000 / 4.7954), rel=1e-4)
    one = mean_lifetime([1000], [True])
    assert (one.low, one.high) == pytest.approx((1000 / 5.5716, 1000 / 0.025318), rel=1e-4)
    none = mean_lifetime([300, 700], [False, False])
    assert none == (math.inf, pytest.approx(1000 / math.log(20)), math.inf)


@pytest.mark.parametrize("limit", [100, 500, 5000])
def test_intervals_hold_a_known_lifetime_however_early_motions_are_left(limit):
    """Of 400 experiments of 30 motions each, mean lifetime 300, some 95 % hold it."""
    rng, held, means = np.random.default_rng(3), 0, []
    for _ in range(400):
        lives = rng.geometric(1 / 300, 30)
        found = mean_lifetime(np.minimum(lives, limit), lives <= limit)
        held += found.low <= 300 <= found.high
        means.append(1 / found.mean)
    assert 0.93 <= held / 400 <= 0.99
    assert np.mean(means) == pytest.approx(1 / 300, rel=0.05)


def test_motions_followed_to_their_ends_have_their_lifetime():
    """A motion that ends in each period with the probability 1 / 900, as of one that has begun."""
    rng = np.random.default_rng(8)

    def follow(state, n_periods):
        life = int(rng.geometric(1 / 900))
        return state, min(life, n_periods), "end" if life <= n_periods else None

    ends, ages, outlived = follow_to_ends(follow, np.zeros((200, 2)), 40_000)
    found = mean_lifetime(ages, [end is not None for end in ends])
    assert not outlived
    assert found.low < 900 < found.high
    assert found.high < 1.5 * found.low


def test_return_times_of_chaos_are_those_of_kac():
    """x -> 4 x (1 - x) has the density 1 / (pi sqrt(x (1 - x))): the mean is 1 / its measure."""
    x, points = 0.1234, np.empty((40_000, 1))
    for k in range(len(points)):
        points[k] = x = 4 * x * (1 - x)
    measure = 2 / math.pi * (math.asin(math.sqrt(0.31)) - math.asin(math.sqrt(0.29)))
    found = return_times(points, [0.3], 0.01)
    assert found.mean.low < 1 / measure < found.mean.high
    assert found.mean.high < 1.2 * found.mean.low
    assert found.times.mean() == pytest.approx(found.mean.mean, rel=0.05)


def test_return_times_of_a_torus_are_three():
    """The gaps of Slater: turns of a circle by the golden mean return after q, q' or q + q'."""
    turn = 2 * math.pi * (GOLDEN * np.arange(20_000) % 1)
    points = np.column_stack((np.cos(turn), np.sin(turn)))
    found = return_times(points, [1.0, 0.0], 0.05)
    times = np.unique(found.times).tolist()
    assert len(times) == 3
    assert times[0] + times[1] == times[2]


def test_an_orbit_returns_after_its_period_and_odd_arguments_are_refused():
    points = np.tile(np.array([[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]]), (40, 1))
    assert return_times(points, points[1], 1e-6).mean == (3, 3, 3)
    never = return_times(points, [9.0, 9.0], 1e-3)
    assert never.times.size == 0
    assert math.isnan(never.mean.mean)
    for call, said in (
        (lambda: return_times(points, [0.0], 1e-3), "state must"),
        (lambda: return_times(points[0], [0.0, 1.0], 1e-3), "points must"),
        (lambda: return_times(points, points[0], -1.0), "distance must"),
        (lambda: mean_lifetime([1, 2], [True]), "ended must"),
        (lambda: mean_lifetime([0, 2], [True, False]), "periods must"),
    ):
        with pytest.raises(ValueError, match=said):
            call()
