"""Decide whether two motions lie on one attractor, and measure distances of attractors.

Orbits are the same if they have the same period and, for one shift of their points, no point
differs by more than the tolerance.

Motions other than orbits, chaos and tori, are distinguished by two statistics of their stroboscopic
points. First, where the points are: attractors are disjoint closed sets, and a motion comes
arbitrarily near to each point of its attractor, so that all but a few (`STRAYS`) of its points must
be about as near to the other's as that one's own second half is to its first. Second, how often:
the mean of its points must be no farther from the other's than twice the largest distance of means
over windows of the other, of the same length.

A nearly locked torus is visited in clusters of points that drift along it, which another motion on
it need not meet in thousands of periods. But its weighted means (`birkhoff`) are known to many
digits, and identify it: two tori are the same if the means of all coordinates and of their squares
agree within `SAFE_MEANS` times their difference between the halves of either record.
"""

import numpy as np
from scipy.spatial import cKDTree

from hpcsweep.dynamics.birkhoff import weighted_means

STRAYS = 0.05
"""Largest share of points beyond the reach: the reach leaves out 1 % of the motion's own."""
REACH, SAFETY = 0.99, 2.0
"""Quantile of the distances between the halves, and its multiple that is the reach."""
SAFE_MEANS, MIN_MEANS = 10.0, 1e-9
"""Multiple of the difference of the means of halves, and least difference, in units of the state.
Means of 14 records of one torus agree to 5e-15."""
PARTS = 4
"""Windows of a length begin this many times in that length."""


def same_orbit(one: np.ndarray, other: np.ndarray, tolerance: float) -> bool:
    """Return whether orbits are the same, by the smallest distance over cyclic shifts.

    Parameters
    ----------
    one, other : ndarray, shapes (p, 2n) and (q, 2n)
        Points in order, in units of the state.
    tolerance : float
    """
    if one.shape != other.shape:
        return False
    return any(
        np.abs(one - np.roll(other, shift, axis=0)).max() <= tolerance for shift in range(len(one))
    )


class Signature:
    """Statistics that identify a motion that is not an orbit.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive points in units of the state; at least two.
    """

    def __init__(self, points: np.ndarray):
        half = len(points) // 2
        first = cKDTree(points[:half])
        own, _ = first.query(points[half:])
        self._reach = SAFETY * float(np.quantile(own, REACH))
        self._tree = cKDTree(points)
        self._mean = points.mean(axis=0)
        self._sums = np.concatenate((np.zeros((1, points.shape[1])), points.cumsum(axis=0)))
        self._farthest: dict[int, np.ndarray] = {}

        self._weighted = weighted_means(points)
        halves = weighted_means(points[:half]) - weighted_means(points[-half:])
        self._apart = float(np.abs(halves).max())

    def same_torus(self, other: "Signature") -> bool:
        """Return whether two motions, with records of the same length, are on one torus."""
        most = max(SAFE_MEANS * max(self._apart, other._apart), MIN_MEANS)
        return bool(np.abs(self._weighted - other._weighted).max() <= most)

    def holds(self, points: np.ndarray) -> bool:
        """Return whether a motion's points, in units of the state, belong to the same attractor."""
        far, _ = self._tree.query(points)
        if np.mean(far > self._reach) > STRAYS:
            return False
        away = np.abs(points.mean(axis=0) - self._mean)
        return bool(np.all(away <= SAFETY * self._spread(len(points)) + self._reach))

    def _spread(self, size: int) -> np.ndarray:
        """Return the largest distance from the mean over windows of a length, shape (2n,)."""
        size = min(size, len(self._sums) // 2)
        if size not in self._farthest:
            first = np.arange(0, len(self._sums) - size, max(size // PARTS, 1))
            means = (self._sums[first + size] - self._sums[first]) / size
            self._farthest[size] = np.abs(means - self._mean).max(axis=0)
        return self._farthest[size]


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of two attractors by their points, in units of the state.

    The mean distance from a point of one to the nearest of the other, in the direction in which it
    is smaller: an orbit and the one of twice the period into which it doubles are near, and so are
    a small chaotic attractor and the larger one to which it grows in a crisis.

    Parameters
    ----------
    one, other : ndarray, shape (k, 2n), (m, 2n)
    """
    apart = np.abs(one[:, None] - other).max(axis=2)
    return float(min(apart.min(axis=0).mean(), apart.min(axis=1).mean()))


def matched(
    before: list[np.ndarray], now: list[np.ndarray], farthest: float
) -> list[tuple[int, int]]:
    """Match attractors of one amplitude to those of the next: nearest first, each at most once.

    Parameters
    ----------
    before, now : list of ndarray, shapes (k, 2n)
        Points in units of the state.
    farthest : float
        Distance beyond which they do not match.

    Returns
    -------
    list of (int, int)
        Indices in `before` and in `now`.
    """
    near = sorted(
        (distance(one, other), i, j) for i, one in enumerate(before) for j, other in enumerate(now)
    )
    pairs: list[tuple[int, int]] = []
    for apart, i, j in near:
        free = all(i != taken and j != found for taken, found in pairs)
        if apart <= farthest and free:
            pairs.append((i, j))
    return pairs
