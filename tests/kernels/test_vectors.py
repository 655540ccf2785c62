"""Lanes of numbers reckon as numbers do."""

import math

import numpy as np
import pytest

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd import vectors
from hpcsweep.kernels.simd.vectors import LANES


def test_lanes_reckon_as_numbers_do():
    @kernel
    def reckon(a, b, out, folded):
        x, y = vectors.load(a, 0), vectors.load(b, 0)
        vectors.store(out, 0, vectors.fma(x, y, 3.0) / (1.0 + y * 2) - x)
        vectors.store(out, LANES, vectors.root(y))
        vectors.store(out, 2 * LANES, vectors.greatest(vectors.modulus(x), 0.5))
        folded[0], folded[1], folded[2] = vectors.total(x), vectors.maximum(x), vectors.negative(x)

    rng = np.random.default_rng(2)
    a, b = rng.standard_normal(LANES), rng.random(LANES)
    out, folded = np.zeros((3, LANES)), np.zeros(3)
    reckon(a, b, out, folded)
    assert out[0] == pytest.approx((a * b + 3) / (1 + 2 * b) - a, rel=1e-14)
    assert np.array_equal(out[1:], [np.sqrt(b), np.maximum(abs(a), 0.5)])
    assert folded[:2] == pytest.approx([a.sum(), a.max()], rel=1e-14)
    assert folded[2] == np.sum((a < 0) * 2 ** np.arange(LANES))
    for place in range(LANES):
        a[:] = 1.0
        a[place] = np.nan
        reckon(a, b, out, folded)
        assert np.isnan(folded[1])


def test_lanes_are_moved_read_and_looked_through():
    @kernel
    def move(a, out, found):
        x = vectors.load(a, 0)
        vectors.store(out, 0, vectors.shifted(7.0, x))
        for k in range(LANES):
            out[LANES + k] = vectors.lane(x, k)
        found[0] = vectors.first_not_negative(x)

    a, out, found = np.arange(1.0, LANES + 1.0), np.zeros(2 * LANES), np.zeros(1)
    move(a, out, found)
    assert np.array_equal(out[:LANES], [7.0, *a[:-1]])
    assert np.array_equal(out[LANES:], a)
    for number in (0.0, 3.0, math.inf, math.nan):
        for place in range(LANES):
            a[:] = -1.0
            a[place:] = number
            move(a, out, found)
            assert found[0] == place
    a[:] = -5e-324
    move(a, out, found)
    assert found[0] == LANES
