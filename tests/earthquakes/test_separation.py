"""Separation by the rules of codes, against the correlation from a Lyapunov equation."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from together import together

from hpcsweep import separation


def correlated(period, other, z, y):
    """Return the correlation of two displacements under white noise, from their covariance."""
    w, v = 2 * np.pi / period, 2 * np.pi / other
    a = np.diag([1.0, 0.0, 1.0], 1)
    a[1, :2], a[3, 2:] = (-w * w, -2 * z * w), (-v * v, -2 * y * v)
    noise = np.outer([0, 1, 0, 1], [0, 1, 0, 1])
    p = solve_continuous_lyapunov(a, -noise)
    return p[0, 2] / np.sqrt(p[0, 0] * p[2, 2])


@together(
    "period, other, z, y",
    [(1.0, 1.0, 0.05, 0.05), (0.5, 0.9, 0.05, 0.02), (2.0, 0.3, 0.3, 0.01), (1.0, 1.1, 0.02, 0.2)],
)
def test_the_double_difference_has_the_correlation_of_white_noise(period, other, z, y):
    found = separation([0.3, 1.0], [0.4, 0.0], period, other, z, y)
    r = correlated(period, other, z, y)
    exact = np.sqrt(0.25 - 2 * r * 0.12)
    np.testing.assert_allclose(found.ddc, [exact, 1.0], rtol=1e-10, atol=1e-8)
    np.testing.assert_allclose(found.srss, [0.5, 1.0], rtol=1e-15)
    np.testing.assert_allclose(found.absolute, [0.7, 1.0], rtol=1e-15)
    mirrored = separation([0.4, 0.0], [0.3, 1.0], other, period, y, z)
    np.testing.assert_allclose(mirrored.ddc, found.ddc, rtol=1e-12)


@together(
    "changed, said",
    [
        ({"peak": [-1.0, 1.0]}, "peak must be finite and at least 0, is"),
        ({"other_peak": np.nan}, "other_peak must be finite and at least 0, is nan"),
        ({"period": 0.0}, r"period must be above 0 and finite, is 0\.0"),
        ({"other_ratio": 1.0}, r"other_ratio must be above 0 and below 1, is 1\.0"),
        ({"damping_ratio": "5 %"}, "damping_ratio must be an array of numbers, is '5 %'"),
    ],
)
def test_what_is_outside_its_range_is_refused(changed, said):
    given = {"peak": 0.1, "other_peak": 0.1, "period": 1.0, "other_period": 1.0} | changed
    with pytest.raises(ValueError, match=said):
        separation(**given)
