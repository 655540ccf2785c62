"""Fractiles are counted, capacities lie on the line through the stripes around a threshold."""

import math

import numpy as np
import pytest
from together import together

from hpcsweep import capacity, fractiles
from hpcsweep.earthquakes.stripes import response_fractiles


def test_fractiles_are_values_that_were_given():
    values = np.arange(1.0, 26.0)
    np.testing.assert_array_equal(fractiles(values), [4, 13, 21])  # 16, 50, 84 % of 25
    np.testing.assert_array_equal(fractiles(values, [0, 0.041, 1]), [1, 2, 25])
    # 0.07 * 100 is 7.000000000000001: the 7th, not the 8th
    np.testing.assert_array_equal(fractiles(np.arange(1.0, 101.0), [0.07, 0.29]), [7, 29])
    rng = np.random.default_rng(1)
    table = rng.random((44, 7))
    for part in (0.16, 0.5, 0.84):
        want = np.quantile(table, part, axis=0, method="inverted_cdf")
        np.testing.assert_array_equal(fractiles(table, [part])[0], want)
        np.testing.assert_array_equal(fractiles(table.T, [part], axis=1)[0], want)


def test_infinite_values_count_and_unknown_ones_do_not():
    np.testing.assert_array_equal(fractiles([math.inf, 1.0, math.nan, 2.0]), [1, 2, math.inf])
    np.testing.assert_array_equal(fractiles([math.nan, math.nan]), [math.nan] * 3)


@together("n", [4, 5, 20, 25])
def test_fractiles_of_responses_cross_a_threshold_where_those_of_capacities_lie(n):
    """The curve of 50 % reaches it at the first stripe that is not below the median capacity."""
    rng = np.random.default_rng(n)
    scales = np.arange(1.0, 9.0)
    curves = np.cumsum(rng.random((n, scales.size)), axis=1)
    curves[0, 3:] = np.inf
    for threshold in (0.5, 1.5, 2.5):
        reached = capacity(scales, curves, threshold).scale
        lines = response_fractiles(curves)
        for line, own in zip(lines, fractiles(reached, [0.84, 0.5, 0.16]), strict=True):
            np.testing.assert_array_equal(line >= threshold, scales >= own)
    np.testing.assert_array_equal(response_fractiles(np.arange(1.0, 26.0)), [5, 13, 22])


def test_capacities_lie_between_the_stripes_around_the_threshold():
    scales = [0.5, 1.0, 1.5, 2.0]
    curves = [
        [0.1, 0.2, 0.3, 0.4],  # simple
        [0.1, 0.3, 0.2, 0.3],  # comes back
        [0.4, 0.5, 0.6, 0.7],  # reaches it at once
        [0.1, 0.1, 0.1, 0.1],  # never
        [math.nan, 0.1, 0.4, 0.1],  # not known below
        [0.1, 0.4, math.nan, 0.5],  # not known above
    ]
    found = capacity(scales, curves, 0.3)
    exact = [1.5, 1.0, 0.375, math.inf, math.nan, 0.5 + 1 / 3]
    np.testing.assert_allclose(found.scale, exact, rtol=1e-15)
    np.testing.assert_array_equal(found.below, [1.0, 0.5, 0.0, 2.0, 1.0, 0.5])
    np.testing.assert_array_equal(found.above, [1.5, 1.0, 0.5, math.inf, 1.5, 1.0])
    np.testing.assert_array_equal(found.later_crossings, [0, 2, 0, 0, 1, 2])
    assert capacity(scales, curves[0], 0.3).scale == 1.5
    assert capacity(scales, [curves[:2], curves[2:4]], 0.3).scale.shape == (2, 2)


@together(
    "arguments, message",
    [
        (([1, 1], [1, 2], 1), "scales must be above 0 and increase"),
        (([0, 1], [1, 2], 1), "scales must be above 0 and increase"),
        (([], [], 1), "scales must be above 0 and increase"),
        (([1, 2], [1, 2, 3], 1), "must have the 2 scales as their last axis, have shape"),
        (([1, 2], [1, 2], math.inf), "threshold must be finite, is inf"),
    ],
)
def test_what_are_no_stripes_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        capacity(*arguments)


@together(
    "arguments, message",
    [
        (([1.0], [1.5]), r"parts must be from 0 to 1, is 1\.5"),
        (([1.0], 7), r"parts must be from 0 to 1, is 7\.0"),
        (([1.0], "median"), "parts must be an array of numbers, is 'median'"),
        (([[1.0]], [0.5], 2), "axis must be a whole number from -2 to 1, is 2"),
        (([[1.0]], [0.5], -3), "axis must be a whole number from -2 to 1, is -3"),
        (([[1.0]], [0.5], 0.0), r"axis must be a whole number from -2 to 1, is 0\.0"),
        (([[1.0]], [0.5], None), "axis must be a whole number from -2 to 1, is None"),
        ((3.0, [0.5]), r"values must be an array of one axis or more, is 3\.0"),
        (([], [0.5]), r"values must have an entry along the axis, have shape \(0,\)"),
    ],
)
def test_what_has_no_fractiles_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        fractiles(*arguments)
