"""Audit a refined map: bounds of the number of wrong points among the inferred ones.

Look r draws m_r of the n points inferred at that time, independently of all earlier draws: those
with the smallest hash of seed, look and index. k of them turn out to be wrong. With the error
alpha_r = alpha / (r (r + 1)) the interval of Clopper and Pearson holds the share of wrong ones of
the n points; the errors of all looks add up to alpha, so that all intervals hold together with
probability 1 - alpha, whenever one stops (the union bound; a draw without replacement scatters less
than the binomial number of the interval).

Then the cells around wrong points are cut. Of the n points n' remain, and w of the others are known
to have been wrong. c of the remaining ones have a new label, and may be wrong or right whatever
they were before. So with p_low n and p_high n wrong ones before, there are now

    p_low n - w - c  to  p_high n - w + c

wrong ones among n'. The audit ends when the upper end over n' is below the limit of the job.

Wrong points that are allowed, in cells that are left although they disagree, must leave room for
the interval: with the share f of the limit allowed, a look shows less than the limit if it draws
some 20 f times the points of which none may be wrong. So the first look draws a `DRAWN_PART` of the
map, at least 2 and at most 8 times these points, and f follows. After a look that shows more than
the limit half as much is allowed, and the next draws twice as many.
"""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.shares import share_interval

ALPHA = 0.05
"""Probability that any interval fails."""
MIN_DRAW, MAX_DRAW = 2.0, 8.0
"""Points of the first look, in those that show `wrong` where none of them is."""
DRAWN_PART = 1 / 32
"""Part of all points that the first look draws, between these limits."""
ALLOWED = 1 / 20
"""Share of `wrong` that is allowed, times the first look in the same measure."""
GROWTH = 2
"""How much each look is larger than the one before."""
MAX_LOOKS = 48
"""Looks there can be: each draw is twice the last, and the grid has 2**40 points at most."""


class Look(NamedTuple):
    """One look of an audit.

    Attributes
    ----------
    inferred, drawn, wrong : int
        n, m and k.
    left : int
        n', points that are inferred after the cells around wrong ones were cut.
    low, high : float
        Ends of the interval of the share of wrong ones among these.
    """

    inferred: int
    drawn: int
    wrong: int
    left: int
    low: float
    high: float


def n_drawn(wrong: float, look: int, n_points: int) -> int:
    """Return the number of points of a map that a look (from 1) draws, if there are as many."""
    return math.ceil(_first_draw(wrong, n_points) * _least(wrong)) * GROWTH ** (look - 1)


def n_allowed(wrong: float, look: int, n_points: int) -> float:
    """Return how many wrong points of a map are allowed before a look."""
    return ALLOWED * _first_draw(wrong, n_points) * wrong * n_points / GROWTH ** (look - 1)


def _least(wrong: float) -> float:
    """Return the points that show `wrong` in the first look where none of them is."""
    return math.log(ALPHA / 4) / math.log1p(-wrong)


def _first_draw(wrong: float, n_points: int) -> float:
    """Return the points of the first look, in those of `_least`."""
    return min(max(DRAWN_PART * n_points / _least(wrong), MIN_DRAW), MAX_DRAW)


def draw(points: np.ndarray, count: int, seed: int, look: int) -> np.ndarray:
    """Draw `count` of the points, or all, without replacement; return them ascending."""
    if count >= points.size:
        return points
    start = _mixed(np.array([seed], np.uint64))
    start = _mixed(start + np.uint64(look))
    chosen = np.argpartition(_mixed(points.astype(np.uint64) + start), count)[:count]
    return np.sort(points[chosen])


def interval(
    look: int, inferred: int, drawn: int, wrong: int, n_wrong: int, changed: int, left: int
) -> tuple[float, float]:
    """Return the interval of the share of wrong ones among the points left after a look.

    Parameters
    ----------
    look : int
        r, from 1.
    inferred, drawn, wrong : int
        n, m and k.
    n_wrong, changed, left : int
        w, c and n'.
    """
    if left == 0:
        return 0.0, 0.0
    if drawn == inferred:
        low = high = wrong / drawn
    else:
        low, high = share_interval(wrong, drawn, 1.0 - ALPHA / (look * (look + 1)))
    least, most = low * inferred - n_wrong - changed, high * inferred - n_wrong + changed
    return min(max(least / left, 0.0), 1.0), min(max(most / left, 0.0), 1.0)


def _mixed(values: np.ndarray) -> np.ndarray:
    """Hash numbers of 64 bits: the finaliser of splitmix64, which is a bijection."""
    values = values + np.uint64(0x9E3779B97F4A7C15)
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


SOURCE, CELL, CROSSED = "source", "cell", "crossed"
AUDIT, INFERRED = "audit", "inferred"
"""Variable of the looks, and of the checksums."""


class Crossed(IntEnum):
    """Whether a known curve crosses a box of the grid."""

    FREE = 0
    CROSSED = 1


def inferred_name(variable: str) -> str:
    """Return the name of the variable with the inferred values of another."""
    return f"inferred_{variable}"


def last_look(audit: np.ndarray) -> Look | None:
    """Return the last look of the variable; None if there is none yet."""
    looks = audit[np.isfinite(audit[:, 0])]
    if not len(looks):
        return None
    return Look(*(int(v) for v in looks[-1][:4]), *map(float, looks[-1][4:]))
