r"""How often a threshold is reached a year: a fragility function and the hazard of a site.

A hazard curve gives the annual frequency lambda(x) with which an intensity x is exceeded. Between
its points, and beyond both ends, it is a power law, lambda_i (x / x_i)^-k. With the density f of
capacities of a lognormal fragility, of median theta and dispersion beta, the frequency is

    -int Phi(ln(x / theta) / beta) dlambda = int lambda(x) f(x) dx,

by parts, and each power law adds, with z = ln(x / theta) / beta at its ends (Cornell, Jalayer,
Hamburger and Foutch 2002 of one power law),

    lambda_i (theta / x_i)^-k exp(k^2 beta^2 / 2) [Phi(z_{i+1} + k beta) - Phi(z_i + k beta)].
"""

import re
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from hpcsweep.earthquakes.text_files import decoded, has_commas, read_bytes, with_point
from hpcsweep.model.arguments import array, positive

MAX_BYTES = 10_000_000
CURVE = "a hazard curve, intensities above 0 that grow and annual frequencies above 0 that fall"


def annual_frequency(
    intensity: Any, frequency: Any, median: float, dispersion: float
) -> np.ndarray:
    """Return the annual frequency with which a threshold is reached, by parts of a hazard curve.

    Parameters
    ----------
    intensity, frequency : array_like, shape (n,)
        The hazard curve, in the intensity measure of the fragility: annual frequencies with which
        intensities are exceeded.
    median, dispersion : float
        Of a lognormal fragility, both above 0.

    Returns
    -------
    ndarray, shape (n + 1,)
        Due to intensities below the curve, between each two of its points, and above it; their sum
        is the frequency.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Examples
    --------
    Of a single power law of exponent 2 the dispersion raises it by exp(2 beta^2):

    >>> parts = hpcsweep.annual_frequency([0.1, 1.0], [1e-2, 1e-4], median=1.0, dispersion=0.5)
    >>> bool(np.isclose(parts.sum(), 1e-4 * np.exp(0.5)))
    True
    """
    x, rate = checked_curve(intensity, frequency)
    theta, beta = positive("median", median), positive("dispersion", dispersion)
    slopes = -np.diff(np.log(rate)) / np.diff(np.log(x))
    k = np.concatenate((slopes[:1], slopes, slopes[-1:]))
    z = np.concatenate(([-np.inf], np.log(x / theta) / beta, [np.inf]))
    start = np.concatenate(([0], np.arange(len(x))))
    level = np.log(rate[start]) - k * np.log(theta / x[start]) + 0.5 * (k * beta) ** 2
    return np.exp(level) * (ndtr(z[1:] + k * beta) - ndtr(z[:-1] + k * beta))


def checked_curve(intensity: Any, frequency: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return a hazard curve as arrays.

    Raises
    ------
    ValueError
    """
    x, rate = array("intensity", intensity), array("frequency", frequency)
    is_curve = x.ndim == 1 and x.shape == rate.shape and x.size > 1 and np.isfinite(x + rate).all()
    steps = np.diff((x, -rate)) if is_curve else np.zeros(1)
    if not (np.all(steps > 0) and x[0] > 0 < rate[-1]):
        raise ValueError(f"intensity and frequency must be {CURVE}")
    return x, rate


def intensity_at(intensity: np.ndarray, frequency: np.ndarray, rate: float) -> float:
    """Return the intensity of a hazard curve that is exceeded with a frequency; NaN beyond it."""
    logs = np.log(frequency[::-1]), np.log(intensity[::-1])
    return float(np.exp(np.interp(np.log(rate), *logs, left=np.nan, right=np.nan)))


def read_hazard(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a hazard curve: a line of an intensity and an annual frequency for each point.

    Blanks, commas or semicolons separate them; lines above the first numbers are passed over.

    Raises
    ------
    ValueError, OSError
    """
    text = decoded(read_bytes(path, MAX_BYTES))
    between = r"\s*;\s*" if ";" in text else r"[\s,]+"
    table = [re.split(between, line.strip()) for line in text.splitlines() if line.strip()]
    if ";" in text and has_commas(chain(*table)):
        table = [[*map(with_point, row)] for row in table]
    points: list[list[float]] = []
    for row in table:
        try:
            points.append([float(cell) for cell in row])
        except ValueError:
            if points:
                raise ValueError(f"must be {CURVE}, has {' '.join(row)}") from None
    if not points or any(len(point) != 2 for point in points):
        raise ValueError(f"must be {CURVE}, two numbers a line")
    return checked_curve(*np.transpose(points))
