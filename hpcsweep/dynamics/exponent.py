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

from hpcsweep.model.arguments import array, count, number

BATCHES = 10
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
    logarithms = array("logarithms", logarithms)
    return logarithms[len(logarithms) // ALIGNING :]


def growth_interval(
    logarithms: np.ndarray, batches: int = BATCHES, confidence: float = CONFIDENCE
) -> Interval:
    """Return the mean growth a period with its confidence interval.

    Parameters
    ----------
    logarithms : ndarray, shape (k,)
        Logarithms of the growth factor in each forcing period, `aligned`.
    batches : int
        B; each must have at least one period.
    confidence : float
        Probability with which the interval holds the true mean, between 0 and 1.

    Returns
    -------
    Interval
        In units of 1/T; NaN if there are too few periods, or a factor is 0.
    """
    logarithms = array("logarithms", logarithms)
    batches = count("batches", batches, 2)
    confidence = number("confidence", confidence, "between 0 and 1", 0.0, 1.0)
    length = len(logarithms) // batches
    # a sum with an infinite term is not finite
    if length == 0 or not math.isfinite(logarithms.sum()):
        return UNKNOWN
    kept = logarithms[len(logarithms) - length * batches :]
    means = (kept.reshape(batches, length).sum(axis=1) / length).tolist()
    mean = math.fsum(means) / batches
    variance = math.fsum((one - mean) ** 2 for one in means) / (batches - 1)
    half = math.sqrt(variance / batches) * _quantile(batches - 1, 0.5 + 0.5 * confidence)
    return Interval(mean, mean - half, mean + half)


@functools.lru_cache(maxsize=64)
def _quantile(freedom: int, probability: float) -> float:
    """Return the quantile of Student's t distribution."""
    from scipy.special import stdtrit  # reading results does not need it

    return float(stdtrit(freedom, probability))
