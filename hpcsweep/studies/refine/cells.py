"""Cut the cells of a grid until the known points in each of them agree.

The grid has d axes of n_1 .. n_d points. Its lines at level l are the points 0, 2^l, 2 2^l, ... and
the last one of each axis; those of a finer level hold those of a coarser one. A cell of level l is
the closed box between neighbouring lines of every axis. The remaining boxes tile the grid, and only
those of level 0, which have no points but their corners, may disagree. Corners and centre of a cell
are computed. All other points in it are inferred to equal its known points. Neighbouring remaining
cells share a corner of the smaller one, and so agree where they meet.

Each label is two numbers, the least and the greatest code of known points: a cell agrees where its
least is not below its greatest.
"""

import numpy as np

NOTHING = np.iinfo(np.int32).max
"""Least code of points that are not known; their greatest is -1."""


class Labels:
    """Labels of the known points of a grid, as codes; equal labels have equal codes.

    Attributes
    ----------
    least, greatest : ndarray of int32, shape (n,)
        0 and `NOTHING` for a point that agrees with none.
    codes : list of tuple
        Labels by code minus 1.
    """

    def __init__(self, size: int):
        self.least = np.full(size, NOTHING, np.int32)
        self.greatest = np.full(size, -1, np.int32)
        self.codes: list[tuple[int, ...]] = []
        self._code_of: dict[tuple[int, ...], int] = {}

    @property
    def known(self) -> np.ndarray:
        """Which points are known, shape (n,)."""
        return self.greatest >= 0

    def store(self, points: np.ndarray, labels: np.ndarray) -> None:
        """Store the labels of k points, shape (k, 1 + m); a first entry of 1 agrees with none.

        Parameters
        ----------
        points : ndarray of int, shape (k,)
        labels : ndarray of uint64
        """
        kinds, which = np.unique(labels, axis=0, return_inverse=True)
        codes = np.array([self._code(tuple(kind)) for kind in kinds.tolist()], np.int32)
        code = codes[which.ravel()]
        self.least[points] = np.where(code > 0, code, 0)
        self.greatest[points] = np.where(code > 0, code, NOTHING)

    def _code(self, label: tuple[int, ...]) -> int:
        if label[0]:
            return 0
        if label not in self._code_of:
            self.codes.append(label)
            self._code_of[label] = len(self.codes)
        return self._code_of[label]


class Cells:
    """Remaining cells of a grid.

    Parameters
    ----------
    shape : tuple of int
        Number of points of every axis.
    levels : int
        Level of the coarsest cells.
    """

    def __init__(self, shape: tuple[int, ...], levels: int):
        self.shape = shape
        self._lines = [[_lines(n, level) for n in shape] for level in range(levels + 1)]
        self._left = [
            np.full([len(begin) for begin, _ in axes], level == levels)
            for level, axes in enumerate(self._lines)
        ]

    def first(self) -> np.ndarray:
        """Return the corners and centres of the coarsest cells, flat indices."""
        wanted = np.zeros(self.shape, bool)
        self._want(wanted, len(self._left) - 1, self._left[-1])
        return np.flatnonzero(wanted)

    def cut(self, least: np.ndarray, greatest: np.ndarray) -> np.ndarray:
        """Cut the cells that disagree; return corners and centres of the new ones, flat indices.

        Parameters
        ----------
        least, greatest : ndarray of int32, shape (n,)
            See `Labels`.
        """
        wanted = np.zeros(self.shape, bool)
        spans = self._spans(least, greatest)
        for level in range(len(self._left) - 1, 0, -1):
            low, high = spans[level]
            bad = self._left[level] & (low < high)
            if not bad.any():
                continue
            self._left[level] &= ~bad
            children = self._below(level, bad)
            self._left[level - 1] |= children
            self._want(wanted, level - 1, children)
        return np.flatnonzero(wanted)

    def inferred(self, least: np.ndarray, greatest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return level and code of every unknown point, shape (n,); 0 for the others."""
        spans = self._spans(least, greatest)
        level_of = np.zeros(self._left[-1].shape, np.int8)
        code_of = np.zeros(self._left[-1].shape, np.int32)
        for level in range(len(self._left) - 1, -1, -1):
            left = self._left[level]
            level_of[left], code_of[left] = level, spans[level][0][left]
            if level:
                level_of, code_of = self._below(level, level_of), self._below(level, code_of)
        # a point belongs to the cell that begins there, the last one to the last cell
        place = np.ix_(*(np.minimum(np.arange(n), max(n - 2, 0)) for n in self.shape))
        known = greatest >= 0
        return (
            np.where(known, 0, level_of[place].ravel()).astype(np.int8),
            np.where(known, 0, code_of[place].ravel()),
        )

    def _spans(
        self, least: np.ndarray, greatest: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the least and the greatest code in every cell of each level."""
        low, high = least.reshape(self.shape), greatest.reshape(self.shape)
        for axis, n in enumerate(self.shape):
            if n > 1:
                front = (*(slice(None),) * axis, slice(None, -1))
                back = (*(slice(None),) * axis, slice(1, None))
                low, high = np.minimum(low[front], low[back]), np.maximum(high[front], high[back])
        spans = [(low, high)]
        for level in range(1, len(self._left)):
            for axis in range(len(self.shape)):
                at = self._first_below(level, axis)
                low = np.minimum.reduceat(low, at, axis)
                high = np.maximum.reduceat(high, at, axis)
            spans.append((low, high))
        return spans

    def _first_below(self, level: int, axis: int) -> np.ndarray:
        """Return the first cell of the next level in each cell of a level, along an axis."""
        return np.searchsorted(self._lines[level - 1][axis][0], self._lines[level][axis][0])

    def _below(self, level: int, values: np.ndarray) -> np.ndarray:
        """Return for the cells of the next level the values of the cells that contain them."""
        for axis in range(len(self.shape)):
            at = self._first_below(level, axis)
            count = np.diff(at, append=len(self._lines[level - 1][axis][0]))
            values = np.repeat(values, count, axis)
        return values

    def _want(self, wanted: np.ndarray, level: int, cells: np.ndarray) -> None:
        """Mark the corners and centres of cells of a level."""
        lines = self._lines[level]
        for corner in np.ndindex(*(2,) * len(self.shape)):
            at = np.ix_(*(line[end] for line, end in zip(lines, corner, strict=True)))
            wanted[at] |= cells
        wanted[np.ix_(*((begin + end) // 2 for begin, end in lines))] |= cells


def _lines(n: int, level: int) -> tuple[np.ndarray, np.ndarray]:
    """Return first and last point of the cells of a level along an axis of n points."""
    if n == 1:
        return np.zeros(1, int), np.zeros(1, int)
    lines = np.append(np.arange(0, n - 1, 2**level), n - 1)
    return lines[:-1], lines[1:]
