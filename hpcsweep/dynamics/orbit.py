"""Orbit period from stroboscopic points.

`orbit_period` is the window test of published studies: points that repeat within a tolerance. It
mistakes an approach for an orbit. With multiplier mu an orbit of period 1 is approached as z_k = z
+ a mu^k, so that points q apart differ by e_k(q) = |a| |mu|^k |1 - mu^q|: with mu = -1 + s those 2
apart are 2 / s times closer than neighbours, and are the same when those are not: an orbit of twice
the period is claimed. `closed_period` claims an orbit of p only where

- the remaining distance, e r / (1 - r) with e = e_k(p) at the end and r the ratio by which it has
  fallen over the last p periods, is within the tolerance, and it has not exceeded it before;
- the distance e(q) for every q < p that divides p tends to a limit that is not 0: with e_0, e_1,
  e_2 at the beginning, the middle and the end of the points, and e_2 < e_1 < e_0, the limit of a
  geometric approach (Aitken) is e_2 - (e_2 - e_1)^2 / (e_2 - 2 e_1 + e_0), and must be half of e_2
  at least. Other q need no test: where e(q) and e(p) tend to 0, so does e of their greatest common
  divisor.
"""

import math
from collections.abc import Iterator

import numpy as np

FLOOR = 1e-12
"""Distance below which points differ by rounding."""
KEPT = 0.5
"""Share of a distance that must remain in the limit."""
CANDIDATES = 32
"""Returns that are tested: near a short orbit a motion returns after all its multiples."""
FALLS = 0.98
"""Largest ratio of falling distances of two turns."""
ALIKE = 0.1
"""Share of 1 - r by which the ratio r of an approach may change in a turn, and share of a
displacement by which it may differ from a multiple of the one a turn before."""


def orbit_period(points: np.ndarray, max_period: int, tolerance: float) -> int:
    """Return the smallest p for which the points repeat after p forcing periods.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points; the last 2 `max_period` of them are compared, where the
        transient is smallest.
    max_period : int
        Longest p to look for; only p <= k / 2 can be seen.
    tolerance : float
        The points repeat if no coordinate of z(j + p) - z(j) exceeds this for any j. It must be
        larger than the remaining transient and the solver's error over p periods, and smaller than
        the distance between the points of the orbit: two branches of a period doubling closer than
        this count as one.

    Returns
    -------
    int
        p, or 0 if there is none (chaotic, quasi-periodic, longer, or still transient).
    """
    returns = _returns(points[-2 * max_period :], max_period, tolerance)
    return next((p for p, apart in returns if apart.max() <= tolerance), 0)


def closed_period(points: np.ndarray, max_period: int, tolerance: float) -> int:
    """Return the smallest p for which the points have closed and stay closed.

    Parameters
    ----------
    points, max_period, tolerance
        As in `orbit_period`.

    Returns
    -------
    int
        p, or 0 if there is none, or the points are still converging.
    """
    coordinates = _coordinates(points[-2 * max_period :])
    period = orbit_period(points, max_period, tolerance)
    if not period:
        return 0
    apart = _apart(coordinates, period)
    last = apart[-period:].max()
    before = apart[-2 * period : -period]
    if before.size and last > FLOOR:
        ratio = last / before.max() if before.max() > 0 else math.inf
        if ratio < 1 and last * ratio > tolerance * (1 - ratio):
            return 0
    vanishes = any(_vanishes(_apart(coordinates, shorter)) for shorter in divisors(period)[:-1])
    return 0 if vanishes else period


def approached_period(points: np.ndarray, max_period: int, near: float) -> int:
    """Return the smallest p for which points p apart are near and come nearer.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points.
    max_period : int
        Longest p to look for; only p <= k / 6 can be seen.
    near : float
        Largest difference of a coordinate over the last third of the points.

    Returns
    -------
    int
        p, or 0 if there is none.
    """
    third = len(points) // 3
    for period, apart in _returns(points, min(max_period, third // 2), near):
        if apart[-third:].max() <= min(near, apart[-2 * third : -third].max()):
            return period
    return 0


def returning_period(points: np.ndarray, max_period: int, near: float) -> int:
    """Return the p after which the last third of the points returns nearest to itself.

    As `approached_period`; `max_period` is at most k / 2.
    """
    third = max(len(points) // 3, 1)
    distances = [
        (float(apart[-third:].max()), period)
        for period, apart in _returns(points, max_period, near)
    ]
    distance, period = min(distances, default=(near, 0))
    return period if distance < near else 0


def returns_near(points: np.ndarray, near: float) -> bool:
    """Return whether any of the points, shape (k, 2n), is near the last one."""
    return bool(np.any(np.abs(points[:-1] - points[-1]).max(axis=1) <= near))


def closing_period(
    points: np.ndarray, min_period: int, max_period: int, near: float, tolerance: float
) -> tuple[int, float]:
    """Return the p after which points return nearest, and nearer over the last three turns.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points.
    min_period, max_period : int
        Shortest and longest p to try, the latter at most k / 3; only the first `CANDIDATES` after
        which the last point returns.
    near, tolerance : float
        Largest difference of a coordinate over the last turn, and that which need not fall.

    Returns
    -------
    period : int
        0 if there is none.
    distance : float
        Largest over the last turn.
    """
    coordinates = _coordinates(points)
    closing = []
    returns = _near_ends(coordinates, min(max_period, len(points) // 3), near)
    for period in [p for p in returns if p >= min_period][:CANDIDATES]:
        apart = _apart(coordinates[:, -3 * period :], period)
        before, last = float(apart[:period].max()), float(apart[period:].max())
        if last < near and (last <= FALLS * before or last <= tolerance):
            closing.append((last, period))
    distance, period = min(closing, default=(near, 0))
    return period, distance


def limit_of_approach(points: np.ndarray, period: int) -> np.ndarray | None:
    """Extrapolate the last turn of a geometric approach along one direction to its orbit.

    With the displacements a = z_(k-p) - z_(k-2p) and b = z_k - z_(k-p) = r a, the orbit is at z_k +
    r / (1 - r) b (Aitken). r must be the same at both ends of the last turn.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive stroboscopic points; the last 3 p of them are used.
    period : int
        p, at most k / 3.

    Returns
    -------
    ndarray, shape (p, 2n), or None
        None if the approach is not geometric (`ALIKE`), or not along one direction.
    """
    first, _ = _ratio_of_turns(points[: len(points) + 1 - period], period)
    last, defect = _ratio_of_turns(points, period)
    same_ratio = abs(last - first) <= ALIKE * (1.0 - last)
    if not (abs(last) <= FALLS and same_ratio and defect <= ALIKE):
        return None
    turn = points[-period:]
    return turn + (turn - points[-2 * period : -period]) * (last / (1.0 - last))


def _ratio_of_turns(points: np.ndarray, period: int) -> tuple[float, float]:
    """Return r of `limit_of_approach` for the last point, and |b - r a| / |b|."""
    before = points[-1 - period] - points[-1 - 2 * period]
    moved = points[-1] - points[-1 - period]
    square, size = float(before @ before), float(np.abs(moved).max())
    if not (square > 0.0 and size > 0.0):
        return math.inf, math.inf
    ratio = float(moved @ before) / square
    return ratio, float(np.abs(moved - ratio * before).max()) / size


def stays_near_orbit(points: np.ndarray, max_period: int, near: float) -> bool:
    """Return whether points p apart are near throughout, for some p up to `max_period`, k / 2."""
    return any(apart.max() <= near for _, apart in _returns(points, max_period, near))


def _coordinates(points: np.ndarray) -> np.ndarray:
    """Return points of shape (k, 2n) as (2n, k): maxima over few rows are ten times faster."""
    return np.ascontiguousarray(points.T)


def _near_ends(coordinates: np.ndarray, longest: int, near: float) -> list[int]:
    """Return the p up to `longest` for which the point p before the last is near it."""
    back = coordinates[:, -2 : -longest - 2 : -1] - coordinates[:, -1:]
    return (1 + np.flatnonzero(np.abs(back).max(axis=0) <= near)).tolist()


def _returns(points: np.ndarray, longest: int, near: float) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the p of `_near_ends`, up to half of all, and the distances of points p apart."""
    coordinates = _coordinates(points)
    for period in _near_ends(coordinates, min(longest, len(points) // 2), near):
        yield period, _apart(coordinates, period)


def _apart(coordinates: np.ndarray, period: int) -> np.ndarray:
    return np.abs(coordinates[:, period:] - coordinates[:, :-period]).max(axis=0)


def _vanishes(apart: np.ndarray) -> bool:
    """Return whether distances fall towards 0, from their largest in three stretches."""
    third = len(apart) // 3
    if third == 0:
        return False
    first, middle, last = (apart[k * third : (k + 1) * third].max() for k in range(3))
    if not last < middle < first:
        return False
    bend = first - 2 * middle + last
    limit = last - (middle - last) ** 2 / bend if bend > 0 else last - (middle - last) * third
    return bool(limit < KEPT * last)


def smallest_period(points: np.ndarray, same: float) -> int:
    """Return the smallest period of a whole orbit: points that differ by up to `same` are equal."""
    return next(
        p
        for p in divisors(len(points))
        if np.abs(points - np.roll(points, -p, axis=0)).max() <= same
    )


def divisors(period: int) -> list[int]:
    """Return the divisors of a period, itself the last."""
    return [p for p in range(1, period + 1) if period % p == 0]
