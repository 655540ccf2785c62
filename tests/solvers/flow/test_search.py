"""The first root of a polynomial on a step is found, or proved not to be there."""

import math

import numpy as np
import pytest

from hpcsweep.solvers.flow.guard import search
from hpcsweep.solvers.flow.state import tables
from hpcsweep.solvers.flow.step import polynomials


def test_a_modulus_is_bounded_by_the_larger_of_both_sides():
    rng = np.random.default_rng(6)
    reported = 0
    for _ in range(200):
        g0, slope0, g1, slope1 = rng.standard_normal(4)
        d, bound4, size = 10.0 ** rng.uniform([-2, 0, -1], [0, 3, 1])
        d = float(d)
        tops = [
            search._top(d, sign * g0, sign * slope0, sign * g1, sign * slope1, bound4)
            for sign in (1.0, -1.0)
        ]
        may = search.may_exceed(size, d, g0, slope0, g1, slope1, bound4)
        if abs(max(tops) - size) > 1e-12 * size:
            assert may == (max(tops) >= size)
            reported += may
    assert 20 < reported < 180


def first_root(rows, h, level, bound):
    """Time at which polynomial 0 first reaches the level on the step; -1 if it does not."""
    (u0, v0), (u1, v1) = (polynomials.value_and_slope(rows, 0, h, s) for s in (0.0, h))
    curve, upwards = search.Trace(rows, 0, h), search.Level(1.0, level)
    part = search.Stretch(0.0, u0 - level, v0, h, u1 - level, v1)
    bracket = search.first_passage(curve, part, upwards, bound)
    return bracket.a if bracket.a < 0 else search.rising_root(curve, bracket, upwards)


def test_first_passage_finds_the_first_root_and_proves_there_is_none():
    rng = np.random.default_rng(5)
    h, fine = 0.7, np.linspace(0, 0.7, 20001)
    found = missed = 0
    for _ in range(300):
        rows = np.zeros((1, tables.N_COEFFICIENTS))
        rows[0, :7] = rng.standard_normal(7) / np.arange(1, 8) ** 1.5
        fourth = np.polynomial.polynomial.polyder(rows[0], 4)
        bound = np.abs(fourth).sum() * (2 / h) ** 4
        values = np.polynomial.polynomial.polyval(2 * fine / h - 1, rows[0])
        level = values[0] + 10 ** rng.uniform(-6, 0.3)
        time = first_root(rows, h, level, bound)
        above = np.flatnonzero(values >= level)
        if above.size:
            found += 1
            assert fine[above[0] - 1] <= time <= fine[above[0]]
        else:
            missed += 1
            # a touch between two of the fine samples is all that may be found
            assert time < 0 or level - values.max() < 1e-6
    assert min(found, missed) > 50


def test_a_floor_said_to_leave_its_layer_stays_away():
    rng = np.random.default_rng(6)
    h, fine = 0.7, np.linspace(0, 0.7, 4001)
    said = 0
    for _ in range(3000):
        rows = np.zeros((1, tables.N_COEFFICIENTS))
        rows[0, :7] = rng.standard_normal(7) / np.arange(1, 8) ** 2
        fourth = np.polynomial.polynomial.polyder(rows[0], 4)
        bound = np.abs(fourth).sum() * (2 / h) ** 4
        u = np.polynomial.polynomial.polyval(2 * fine / h - 1, rows[0])
        level = u[0] - 10 ** rng.uniform(-6, 0)
        (u0, v0), (u1, v1) = (polynomials.value_and_slope(rows, 0, h, s) for s in (0.0, h))
        if search.leaves(h, u0 - level, v0, u1 - level, v1, bound):
            said += 1
            assert np.count_nonzero(np.diff((u >= level).astype(int))) == 1
    assert said > 50


def test_a_touch_just_over_the_level_is_found_however_short():
    rows = np.zeros((1, tables.N_COEFFICIENTS))
    for over in 10.0 ** np.arange(-15, -2):
        peak = 0.2371
        rows[0, :3] = over - peak**2, 2 * peak, -1.0  # over - (sigma - peak)^2
        time = first_root(rows, 1.0, 0.0, 1e-3)
        assert time == pytest.approx(0.5 * (1 + peak - math.sqrt(over)), abs=3e-8)
        rows[0, 0] = -1e-12 - peak**2
        assert first_root(rows, 1.0, 0.0, 1e-3) == -1
