"""Cut the cells of a grid until the known points agree in all of them but the costliest.

The grid has d axes of n_1 .. n_d points. Its lines at level l are the points 0, 2^l, 2 2^l, ... and
the last one of each axis; those of a finer level hold those of a coarser one. A cell of level l is
the closed box between neighbouring lines of every axis. The remaining boxes tile the grid, and
those of level 0 have no points but their corners. Corners and centre of a cell are computed. All
other points in it are inferred to equal its known points. Neighbouring cells that agree share a
corner of the smaller one, and so agree with each other.

Where motions alternate from point to point a map is costliest and tells least. A cell that
disagrees may be left as well: its other points are inferred from the nearest that is known, or in a
cell that agrees, and a part `WRONG` of its points is expected to be wrong. What a boundary through
a cell of s steps costs to resolve goes as s^(d - 1), what is wrong otherwise as s^d: most is spared
where the cost of a point, the greatest known of the cell, is largest over s.

A cell that a known curve crosses (`growth`) is always cut, down to the grid.

Each label is two numbers, the least and the greatest code of known points: a cell agrees where its
least is not below its greatest.
"""

from typing import NamedTuple

import numpy as np

WRONG = 0.2
"""Part of the points of a cell that are expected to be wrong if it disagrees and is left."""
CUT = -1
NOTHING = np.iinfo(np.int32).max
"""Least code of points that are not known; their greatest is -1."""


class Counts:
    """Number of crossed boxes in any box of points.

    Parameters
    ----------
    crossed : ndarray of bool
        Of `hpcsweep.studies.refine.growth.crossed_boxes`.
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


class Labels:
    """Labels of the known points of a grid, as codes; equal labels have equal codes.

    Attributes
    ----------
    least, greatest : ndarray of int32, shape (n,)
        0 and `NOTHING` for a point that agrees with none.
    cost : ndarray of int64, shape (n,)
        Forcing periods of known points, 0 of others.
    codes : list of tuple
        Labels by code minus 1.
    """

    def __init__(self, size: int):
        self.least = np.full(size, NOTHING, np.int32)
        self.greatest = np.full(size, -1, np.int32)
        self.cost = np.zeros(size, np.int64)
        self.codes: list[tuple[int, ...]] = []
        self._code_of: dict[tuple[int, ...], int] = {}

    @property
    def known(self) -> np.ndarray:
        """Which points are known, shape (n,)."""
        return self.greatest >= 0

    def store(self, points: np.ndarray, labels: np.ndarray) -> None:
        """Store the labels of k points, shape (k, 2 + m); a first entry of 1 agrees with none.

        The last entry is the cost.

        Parameters
        ----------
        points : ndarray of int, shape (k,)
        labels : ndarray of uint64
        """
        self.cost[points] = labels[:, -1]
        kinds, which = np.unique(labels[:, :-1], axis=0, return_inverse=True)
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


class _Table(NamedTuple):
    """Cells, those that were cut included.

    Attributes
    ----------
    begin, end : ndarray of int, shape (m, d)
        First and last point.
    level : ndarray of int8, shape (m,)
        `CUT` of those that were cut.
    least, greatest : ndarray of int32, shape (m,)
    cost : ndarray of int64, shape (m,)
        Extreme codes of the known points, and the greatest cost; see `Labels`.
    crossed : ndarray of bool, shape (m,)
        Whether a known curve crosses it.
    """

    begin: np.ndarray
    end: np.ndarray
    level: np.ndarray
    least: np.ndarray
    greatest: np.ndarray
    cost: np.ndarray
    crossed: np.ndarray


class Cells:
    """Remaining cells of a grid, and what is known of its points.

    Parameters
    ----------
    shape : tuple of int
        Number of points of every axis, 2 or more.
    levels : int
        Level of the coarsest cells.
    crossed : ndarray of bool, optional
        Boxes between neighbouring points that known curves cross.
    """

    def __init__(self, shape: tuple[int, ...], levels: int, crossed: np.ndarray | None = None):
        self.shape = shape
        self._crossings = Counts(np.zeros(np.array(shape) - 1) if crossed is None else crossed)
        size, self._last = int(np.prod(shape)), np.array(shape) - 1
        self._strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
        self._least, self._greatest = np.full(size, NOTHING, np.int32), np.full(size, -1, np.int32)
        self._cost = np.zeros(size, np.int64)
        # the cell of each box between neighbouring points, by the first of these
        self._cell_of = np.zeros(size, np.int32)
        none = np.zeros(0, np.int32)
        points = np.zeros((0, len(shape)), int)
        level, cost, never = (none.astype(dtype) for dtype in (np.int8, int, bool))
        self._cells = _Table(points, points, level, none, none, cost, never)
        lines = np.meshgrid(*(np.arange(0, n - 1, 2**levels) for n in shape), indexing="ij")
        begin = np.stack(lines, axis=-1).reshape(-1, len(shape))
        self._add(begin, np.broadcast_to(self._last, begin.shape), levels)

    def learn(self, points: np.ndarray, labels: Labels) -> None:
        """Learn the labels and costs of points, flat indices."""
        self._least[points], self._greatest[points] = labels.least[points], labels.greatest[points]
        self._cost[points] = labels.cost[points]
        places = np.stack(np.unravel_index(points, self.shape), axis=1)
        for back in np.ndindex(*(2,) * len(self.shape)):
            box = places - back
            inside = np.all((box >= 0) & (box < self._last), axis=1)
            cell, point = self._cell_of[box[inside] @ self._strides], points[inside]
            np.minimum.at(self._cells.least, cell, self._least[point])
            np.maximum.at(self._cells.greatest, cell, self._greatest[point])
            np.maximum.at(self._cells.cost, cell, self._cost[point])

    def cut(self, allowed: float = 0.0) -> np.ndarray:
        """Cut cells that disagree or are crossed; return corners and centres of the new ones.

        Parameters
        ----------
        allowed : float
            Number of wrong points expected in the cells that are left although they disagree.
        """
        cells, first_new = self._cells, len(self._cells.level)
        differ = (cells.least < cells.greatest) | cells.crossed
        bad = np.flatnonzero((cells.level > 0) & differ)
        # a cell with a point that agrees with none is always cut
        never = (cells.least[bad] == 0) | cells.crossed[bad]
        bad = bad[np.lexsort((-cells.cost[bad] / 2.0 ** cells.level[bad], never))]
        wrong = WRONG * 2.0 ** (cells.level[bad] * len(self.shape))
        bad = bad[(np.cumsum(wrong) > allowed) | np.sort(never)]
        begin, end, level = cells.begin[bad], cells.end[bad], cells.level[bad].astype(int)
        cells.level[bad] = CUT
        for k in np.unique(level).tolist():
            for at in np.ndindex(*(2,) * len(self.shape)):
                child = begin[level == k] + 2 ** (k - 1) * np.array(at)
                whole = end[level == k]
                inside = np.all(child < whole, axis=1)
                self._add(child[inside], whole[inside], k - 1)
        return self.corners_and_centres(first_new)

    def inferred(self) -> tuple[np.ndarray, np.ndarray]:
        """Return level and code of every unknown point, shape (n,); 0 for the others.

        The level is negative in a cell that disagrees.
        """
        cells = self._cells
        agree = cells.least >= cells.greatest
        # a point belongs to the cell that begins there, the last one to the last cell
        place = np.ix_(*(np.minimum(np.arange(n), n - 2) for n in self.shape))
        cell = self._cell_of.reshape(self.shape)[place].ravel()
        is_computed = self._greatest >= 0
        level = np.where(is_computed, 0, np.where(agree, cells.level, -cells.level)[cell])
        code = np.where(is_computed, self._least, np.where(agree, cells.least, 0)[cell])
        self._take_nearest(code, np.flatnonzero(level < 0))
        return level.astype(np.int8), np.where(is_computed, 0, code)

    def _take_nearest(self, code: np.ndarray, points: np.ndarray) -> None:
        """Give points without a code that of the nearest with one, in steps along the axes.

        Of several that are equally near the first axis counts first, the lower one before the
        upper.
        """
        while points.size:
            nearest = np.zeros(points.size, code.dtype)
            places = np.unravel_index(points, self.shape)
            for place, stride, last in zip(places, self._strides, self._last, strict=True):
                for step, inside in ((-stride, place > 0), (stride, place < last)):
                    beside = code[np.where(inside, points + step, points)]
                    nearest = np.where(nearest > 0, nearest, beside)
            code[points] = nearest
            points = points[nearest == 0]

    def _add(self, begin: np.ndarray, end: np.ndarray, level: int) -> None:
        """Add cells of a level that begin at points, and end with a larger one at the latest."""
        end = np.minimum(begin + 2**level, end)
        points = self._points(begin, end, 2**level + 1)
        first = len(self._cells.level)
        number = np.arange(first, first + len(begin), dtype=np.int32)
        new = _Table(
            begin,
            end,
            np.full(len(begin), level, np.int8),
            self._least[points].min(axis=1),
            self._greatest[points].max(axis=1),
            self._cost[points].max(axis=1),
            self._crossings.between(begin, end) > 0,
        )
        self._cell_of[self._points(begin, end - 1, 2**level)] = number[:, None]
        parts = zip(self._cells, new, strict=True)
        self._cells = _Table(*(np.concatenate(both) for both in parts))

    def _points(self, begin: np.ndarray, last: np.ndarray, count: int) -> np.ndarray:
        """Return the points of boxes, flat indices, shape (k, count^d); the last are repeated."""
        points = np.zeros((len(begin), 1), int)
        for axis, stride in enumerate(self._strides):
            along = np.minimum(begin[:, axis, None] + np.arange(count), last[:, axis, None])
            points = points[:, :, None] + stride * along[:, None, :]
            points = points.reshape(len(begin), count ** (axis + 1))
        return points

    def corners_and_centres(self, first: int = 0) -> np.ndarray:
        """Return the corners and centres of the cells from a number on, flat indices, ascending."""
        begin, end = self._cells.begin[first:], self._cells.end[first:]
        corners = [np.where(at, end, begin) for at in np.ndindex(*(2,) * len(self.shape))]
        return np.unique(np.concatenate([*corners, (begin + end) // 2]) @ self._strides)
