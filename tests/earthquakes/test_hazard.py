"""Annual frequencies of a fragility and a hazard curve: closed forms, quadrature, and the files."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import lognorm
from together import together

from hpcsweep import annual_frequency
from hpcsweep.earthquakes.hazard import intensity_at, read_hazard

INTENSITY = np.array([0.05, 0.1, 0.2, 0.4, 0.8, 1.5])
FREQUENCY = np.array([0.05, 0.02, 0.006, 0.0012, 0.0002, 2e-5])


def test_a_power_law_has_the_closed_form_of_cornell():
    """lambda(theta) exp(k^2 beta^2 / 2), wherever the points of the curve are."""
    x = np.array([0.01, 0.3, 2.0, 5.0])
    parts = annual_frequency(x, 1e-3 * x**-2.5, median=0.7, dispersion=0.45)
    assert parts.shape == (5,)
    expected = 1e-3 * 0.7**-2.5 * math.exp(0.5 * (2.5 * 0.45) ** 2)
    assert parts.sum() == pytest.approx(expected, rel=1e-13)


@together("median, dispersion", [(0.45, 0.34), (0.06, 0.2), (3.0, 0.5)])
def test_parts_are_integrals_of_the_curve_over_the_density_of_capacities(median, dispersion):
    density = lognorm(dispersion, scale=median)
    slopes = np.diff(np.log(FREQUENCY)) / np.diff(np.log(INTENSITY))
    ends = [median * math.exp(-12 * dispersion), *INTENSITY, median * math.exp(12 * dispersion)]
    for k, part in enumerate(annual_frequency(INTENSITY, FREQUENCY, median, dispersion)):
        i = min(max(k - 1, 0), 4)

        def weighted(x, i=i):
            return FREQUENCY[i] * (x / INTENSITY[i]) ** slopes[i] * density.pdf(x)

        if ends[k] < ends[k + 1]:
            own, _ = quad(weighted, ends[k], ends[k + 1], epsabs=0, epsrel=1e-11, limit=400)
            assert part == pytest.approx(own, rel=1e-8, abs=1e-16)


def test_an_intensity_is_between_points_on_logarithmic_axes():
    assert intensity_at(INTENSITY, FREQUENCY, 0.02) == pytest.approx(0.1, rel=1e-14)
    between = math.sqrt(0.02 * 0.006)
    assert intensity_at(INTENSITY, FREQUENCY, between) == pytest.approx(math.sqrt(0.02), rel=1e-14)
    assert math.isnan(intensity_at(INTENSITY, FREQUENCY, 1e-6))


@together(
    "text",
    [
        "Sa [g],frequency\n0.1,0.02\n0.4,1.2e-3\n",
        "0.1 0.02\n\n0.4\t0.0012",
        "# of a site, 2026\nSa; frequency\n0,1; 0,02\n0,4; 0,0012\n",
    ],
)
def test_curves_are_read_from_files(tmp_path, text):
    (tmp_path / "site.csv").write_text(text)
    found = read_hazard(tmp_path / "site.csv")
    np.testing.assert_array_equal(found, [[0.1, 0.4], [0.02, 0.0012]])


@together(
    "text, said",
    [
        ("", "two numbers a line"),
        ("0.1\n0.2\n", "two numbers a line"),
        ("0.1,0.02\nx,y\n", "a hazard curve, intensities .*, has x y"),
        ("0.1,0.02\n", "intensity and frequency must be a hazard curve"),
        ("0.1,0.02\n0.2,0.03\n", "annual frequencies above 0 that fall"),
        ("0.1,0.02\n0.2,0\n", "annual frequencies above 0 that fall"),
        ("0.2,0.02\n0.1,0.01\n", "intensities above 0 that grow"),
        ("0,0.02\n0.1,nan\n", "must be a hazard curve"),
    ],
)
def test_what_is_no_curve_is_refused(tmp_path, text, said):
    (tmp_path / "site.csv").write_text(text)
    with pytest.raises(ValueError, match=said):
        read_hazard(tmp_path / "site.csv")
