"""Orbit period from stroboscopic points."""

import numpy as np

from hpcsweep.model.arguments import count, number, rows


def orbit_period(points: np.ndarray, max_period: int, tolerance: float) -> int:
    """Find the smallest p for which the points repeat after p forcing periods.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points; the last 2 `max_period` of them are compared, where
        least is left of the transient.
    max_period : int
        Longest p that is looked for; only p <= k / 2 can be seen.
    tolerance : float
        The points repeat if no coordinate of z(j + p) - z(j) exceeds this for any j. It must
        be larger than what is left of the transient and than the solver's error over p
        periods, and smaller than the distance between the points of the orbit: two branches of
        a period doubling closer than this count as one.

    Returns
    -------
    int
        p, or 0 if there is none (chaotic, quasi-periodic, longer, or not yet settled).
    """
    points, max_period = rows("points", points), count("max_period", max_period, 1)
    tolerance = number("tolerance", tolerance)
    points = points[-2 * max_period :]
    for p in range(1, min(max_period, len(points) // 2) + 1):
        if np.abs(points[p:] - points[:-p]).max() <= tolerance:
            return p
    return 0
