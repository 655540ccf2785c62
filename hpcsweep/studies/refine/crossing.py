"""Boxes of a grid that known curves cross.

A curve is a polyline over the last two axes of the grid, at one index of each axis before. A box
lies between neighbouring points of every axis. The lines of the grid cut a piece of a polyline in
parts, each inside one box, which that of its middle tells. Boxes are closed: a part along a line of
the grid lies in the boxes on both sides, and an index of the axes before in those below and above.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np


class KnownCurve(NamedTuple):
    """A known curve.

    Attributes
    ----------
    at : tuple of int
        Index of each axis before the last two.
    points : ndarray, shape (k, 2)
        Its polyline, values of the last two axes.
    """

    at: tuple[int, ...]
    points: np.ndarray


def crossed_boxes(
    shape: tuple[int, ...], axes: Sequence[np.ndarray], curves: Iterable[KnownCurve]
) -> np.ndarray:
    """Return which boxes of a grid are crossed, one fewer along each axis than points.

    Parameters
    ----------
    shape : tuple of int
        Number of points of every axis.
    axes : sequence of ndarray
        Ascending values of the last two axes.
    curves : iterable of Curve
    """
    crossed = np.zeros([n - 1 for n in shape], bool)
    for curve in curves:
        before: list[list[int]] = [
            [box for box in (index - 1, index) if 0 <= box < n - 1]
            for index, n in zip(curve.at, shape, strict=False)
        ]
        inner = _boxes(axes, _middles(axes, curve.points))
        for outer in product(*before):
            crossed[outer][inner] = True
    return crossed


def _middles(axes: Sequence[np.ndarray], line: np.ndarray) -> np.ndarray:
    """Return the middle of every part of a polyline, shape (m, 2)."""
    middles = [line[:1]]
    for start, end in pairwise(line):
        cuts = [np.array([0.0, 1.0])]
        for axis, first, last in zip(axes, start, end, strict=True):
            between = axis[(axis > min(first, last)) & (axis < max(first, last))]
            if between.size:
                cuts.append((between - first) / (last - first))
        share = np.unique(np.concatenate(cuts))
        middles.append(start + 0.5 * (share[:-1] + share[1:])[:, None] * (end - start))
    return np.concatenate(middles)


def _boxes(axes: Sequence[np.ndarray], points: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the indices of the boxes in which points lie, as many arrays as axes."""
    pairs = list(zip(axes, points.T, strict=True))
    below, above = (
        np.stack([np.searchsorted(axis, x, side) - 1 for axis, x in pairs], axis=1)
        for side in ("left", "right")
    )
    corners = [np.stack(at, axis=1) for at in product(*zip(below.T, above.T, strict=True))]
    boxes = np.unique(np.concatenate(corners), axis=0)
    last = [axis.size - 2 for axis in axes]
    return tuple(boxes[np.all((boxes >= 0) & (boxes <= last), axis=1)].T)


class Counts:
    """Number of crossed boxes in any box of points.

    Parameters
    ----------
    crossed : ndarray of bool
        Of `crossed_boxes`.
    """

    def __init__(self, crossed: np.ndarray):
        self._sums = np.pad(crossed.astype(np.int64), [(1, 0)] * crossed.ndim)
        for axis in range(crossed.ndim):
            np.cumsum(self._sums, axis=axis, out=self._sums)

    def between(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Count the crossed boxes between first and last points, both of shape (m, d)."""
        total = np.zeros(len(begin), np.int64)
        for at in np.ndindex(*(2,) * begin.shape[1]):
            sign = (-1) ** (len(at) - sum(at))
            total += sign * self._sums[tuple(np.where(at, end, begin).T)]
        return total
