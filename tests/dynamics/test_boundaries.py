"""Basin entropy and uncertainty exponent of basins whose boundaries are known."""

import math

import numpy as np
import pytest

from hpcsweep import basin_boundary


def cantor(size: int) -> np.ndarray:
    """Return basins whose boundary is Cantor's set: by the place of the first digit 1 in base 3."""
    x = (np.arange(size) + 0.5) / size
    place, left = np.zeros(size, int), np.ones(size, bool)
    for k in range(30):
        x *= 3
        middle = left & (np.floor(x) == 1)
        place[middle], left[middle] = k, False
        x -= np.floor(x)
    return 1 + place % 2


def test_the_entropy_of_known_boxes():
    labels = np.ones((10, 15), int)
    labels[:5, :2] = 2  # 10 of 25 starts
    labels[5:, 5:] = np.where(
        np.arange(50).reshape(5, 10) % 2, 3, -1
    )  # undecided ones do not count
    labels[5:, 10] = 1
    found = basin_boundary(labels)
    first = -(0.4 * math.log(0.4) + 0.6 * math.log(0.6))
    # the last box has 5 of 1, and 10 of 3 besides undecided ones
    odd = (np.arange(50).reshape(5, 10) % 2)[:, 6:].sum()
    last = -(5 / (5 + odd) * math.log(5 / (5 + odd)) + odd / (5 + odd) * math.log(odd / (5 + odd)))
    assert found.entropy == pytest.approx((first + last) / 6, rel=1e-12)
    assert found.boundary_entropy == pytest.approx((first + last) / 2, rel=1e-12)


def test_starts_without_order_have_the_entropy_of_their_boxes():
    """Of three attractors ln 3, less 2 / (2 * 25) by the finite box (Miller, 1955)."""
    labels = np.random.default_rng(2).integers(1, 4, (400, 400))
    found = basin_boundary(labels)
    assert found.entropy == pytest.approx(math.log(3) - 0.04, abs=0.003)
    assert found.exponent.mean == pytest.approx(0.0, abs=0.01)


def test_a_smooth_boundary_has_the_exponent_1():
    y, x = np.mgrid[-1:1:500j, -1:1:500j]
    found = basin_boundary(np.where(x**2 + y**2 < 0.5, 1, 2))
    assert found.exponent == pytest.approx((1.0, 1.0, 1.0), abs=1e-9)
    assert found.boundary_entropy < math.log(2)


def test_cantors_set_as_a_boundary():
    """Its dimension is ln 2 / ln 3, so that the exponent is 1 - ln 2 / ln 3 = 0.369."""
    labels = np.repeat(cantor(5000)[None], 300, axis=0)
    found = basin_boundary(labels)
    exact = 1 - math.log(2) / math.log(3)
    assert found.exponent.low < exact < found.exponent.high
    assert found.exponent.mean == pytest.approx(exact, abs=0.06)


@pytest.mark.parametrize("value", [0, 1, -1, -2])
def test_without_a_boundary_there_is_no_exponent(value):
    found = basin_boundary(np.full((40, 40), value))
    assert math.isnan(found.boundary_entropy)
    assert math.isnan(found.exponent.mean)
    assert found.entropy == 0 if value == 1 else math.isnan(found.entropy)


def test_others_than_grids_are_refused():
    with pytest.raises(ValueError, match="labels must have two dimensions, has shape"):
        basin_boundary(np.ones(9))
