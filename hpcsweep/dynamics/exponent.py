"""Confidence interval of the largest Lyapunov exponent of a stretch of a motion.

The logarithms l_1, ..., l_k of the factor by which a tangent vector grows in each forcing period
are correlated: an impact that stretches it is followed by others. Means over batches of k / B of
them are nearly independent once a batch is longer than the correlation, and nearly normal; their
mean is that of the growth a period, and Student's t with B - 1 degrees of freedom gives its
interval (method of batch means; Law, Simulation Modeling and Analysis, 5th ed., section 9.5.3).
"""

import functools
import math
from typing import NamedTuple

import numpy as np

BATCHES = 10
"""B of a stretch; each must have at least one period."""
CONFIDENCE = 0.95
"""Confidence of both sides of the interval together."""
ALIGNING = 10
"""The first 1/10 of a stretch is dropped."""


class Interval(NamedTuple):
    """A mean growth with its confidence interval, in whatever unit."""

    mean: float
    low: float
    high: float

    @classmethod
    def exact(cls, mean: float) -> "Interval":
        """Return the interval of an exactly known mean."""
        return cls(mean, mean, mean)

    def times(self, factor: float) -> "Interval":
        """Return the interval in another unit; `factor` > 0."""
        return Interval(self.mean * factor, self.low * factor, self.high * factor)


UNKNOWN = Interval(math.nan, math.nan, math.nan)


def aligned(logarithms: np.ndarray) -> np.ndarray:
    """Drop the first tenth, in which the tangent vector aligns with the direction of growth."""
    return logarithms[len(logarithms) // ALIGNING :]


def growth_interval(logarithms: np.ndarray) -> Interval:
    """Return the mean growth a period with its confidence interval.

    Parameters
    ----------
    logarithms : ndarray, shape (k,)
        Logarithms of the growth factor in each forcing period, `aligned`.

    Returns
    -------
    Interval
        In units of 1/T; NaN if there are too few periods, or a factor is 0.
    """
    length = len(logarithms) // BATCHES
    # a sum with an infinite term is not finite
    if length == 0 or not math.isfinite(logarithms.sum()):
        return UNKNOWN
    kept = logarithms[len(logarithms) - length * BATCHES :]
    means = (kept.reshape(BATCHES, length).sum(axis=1) / length).tolist()
    mean = math.fsum(means) / BATCHES
    variance = math.fsum((one - mean) ** 2 for one in means) / (BATCHES - 1)
    half = math.sqrt(variance / BATCHES) * _quantile(BATCHES - 1, 0.5 + 0.5 * CONFIDENCE)
    return Interval(mean, mean - half, mean + half)


@functools.lru_cache(maxsize=64)
def _quantile(freedom: int, probability: float) -> float:
    """Return the quantile of Student's t distribution."""
    from scipy.special import stdtrit  # reading results does not need it

    return float(stdtrit(freedom, probability))
