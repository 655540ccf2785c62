"""Test how fast averages over a motion converge: fast on a torus, slowly in chaos.

The mean of a function along a motion over N periods converges as 1/N on a torus and as 1/sqrt(N) in
chaos. Weighted by a bump that vanishes with all its derivatives at both ends,

    w_k ~ exp(-1 / (t (1 - t))),   t = k / (N + 1),   k = 1 ... N,

it converges faster than any power of 1/N on a torus with Diophantine rotation numbers and smooth
functions, and in chaos no faster than before (Das, Saiki, Sander, Yorke, Nonlinearity 30 (2017)
4111; Sander, Meiss, Physica D 411 (2020) 132569). The means over the two halves of a stretch then
agree to many digits, or to a few. They do not agree during an approach, where the second half
differs from the first.

The logarithm of a tangent vector's growth in a period is also such a function: on a torus the
vector turns into a direction that depends on the point alone. Its plain sum over a stretch varies
by the logarithm of the ratio of the vector's lengths at its ends, by 1 and more on a nearly locked
torus, for stretches of any length; weighted, it tends to 0 on a torus, and to the exponent of the
orbit on a locked one.
"""

import math
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.classify import NEUTRAL_GROWTH

TORUS_GROWTH = 0.5
"""Largest weighted growth of a torus over a stretch, either sign; over its halves
`NEUTRAL_GROWTH`."""
TORUS_RATE = 3e-4
"""The same a period: for a torus that is nearly broken the weighted growth falls slowly. Orbits of
period 300 to 1,600 to which such tori are locked are approached by 1e-3 to 1e-2 a period."""


def agreeing_digits(points: np.ndarray) -> float:
    """Return the number of digits to which weighted means over both halves of a stretch agree.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points, k >= 4.

    Returns
    -------
    float
        The least over all coordinates and their squares, in units of their largest distance from
        the mean; inf where they agree to the last bit.
    """
    half = len(points) // 2
    # one row a coordinate: maxima over few long rows are ten times faster
    coordinates = np.ascontiguousarray(points.T)
    centred = coordinates[:, : 2 * half] - coordinates.mean(axis=1, keepdims=True)
    size = np.abs(centred).max(axis=1, keepdims=True)
    scaled = centred / np.where(size > 0, size, 1.0)
    weights = _weights(half)
    apart = max(
        float(np.abs((values[:, :half] - values[:, half:]) @ weights).max())
        for values in (scaled, scaled * scaled)
    )
    return -math.log10(apart) if apart > 0 else math.inf


def weighted_means(points: np.ndarray) -> np.ndarray:
    """Return the weighted means of all coordinates of points, and of their squares, shape (4n,)."""
    weights = _weights(len(points))
    return np.concatenate((weights @ points, weights @ (points * points)))


def growth_vanishes(logarithms: np.ndarray) -> bool:
    """Return whether a tangent vector has not grown over 4 periods or more, as on a torus."""
    size, (*halves, whole) = len(logarithms), np.abs(weighted_growth(logarithms)).tolist()
    swings = max(halves) <= max(NEUTRAL_GROWTH, 3 * TORUS_RATE * size)
    return swings and whole <= max(TORUS_GROWTH, TORUS_RATE * size)


def weighted_growth(logarithms: np.ndarray) -> np.ndarray:
    """Return the weighted mean growth a period, times the periods of the whole stretch.

    Of its first half, its second half, and the whole.
    """
    size, half = len(logarithms), len(logarithms) // 2
    weights = _weights(half)
    means = (weights @ logarithms[:half], weights @ logarithms[-half:], _weights(size) @ logarithms)
    return np.array(means) * size


@lru_cache(maxsize=128)
def _weights(size: int) -> np.ndarray:
    t = np.arange(1, size + 1) / (size + 1)
    weights = np.exp(-1.0 / (t * (1.0 - t)))
    return weights / weights.sum()
