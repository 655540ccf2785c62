"""Rounds of a refined map: the points to compute next, from those computed before.

Rounds depend only on the labels of points, and each round only on the points of earlier rounds:
with more known points, from a resumed or reused file, the rounds are the same.
"""

from collections.abc import Iterator

import numpy as np

from hpcsweep.studies.refine.audit import MAX_LOOKS, Look, draw, interval, n_allowed, n_drawn
from hpcsweep.studies.refine.cells import Cells, Labels
from hpcsweep.studies.refinement import Refinement, Source


def n_least(
    shape: tuple[int, ...], refinement: Refinement, crossed: np.ndarray | None = None
) -> int:
    """Return how many points are computed at least.

    Those of the coarsest cells, of the cells that are `crossed` (`Cells`), and the first look.
    """
    n = int(np.prod(shape))
    cells = Cells(shape, refinement.levels, crossed)
    points = cells.corners_and_centres()
    while (more := cells.cut()).size:
        points = np.union1d(points, more)
    return min(points.size + n_drawn(refinement.wrong, 1, n), n)


class RefinementRounds:
    """State of a refined map.

    Parameters
    ----------
    shape : tuple of int
        Points of every axis.
    refinement : Refinement
    labels : Labels
        Filled by the caller: when a round is requested, all points of earlier rounds must be known.
    crossed : ndarray of bool, optional
        See `Cells`.

    Attributes
    ----------
    refinement, labels, crossed
        As given.
    source : ndarray of int8, shape (n,)
        Source of the points computed so far, see `Source`; `UNKNOWN` elsewhere.
    looks : list of Look
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        refinement: Refinement,
        labels: Labels,
        crossed: np.ndarray | None = None,
    ):
        self.refinement, self.labels, self.crossed = refinement, labels, crossed
        self._cells = Cells(shape, refinement.levels, crossed)
        self.source = np.zeros(int(np.prod(shape)), np.int8)
        self.looks: list[Look] = []
        self._walk = iter(self)

    @property
    def n_inferred(self) -> int:
        """Number of points that are not computed."""
        return int((self.source == Source.UNKNOWN).sum())

    def next(self) -> np.ndarray | None:
        """Return the points of the next round that are not known yet; None if the map is complete.

        All points of earlier rounds must be known.
        """
        for points in self._walk:
            new = points[~self.labels.known[points]]
            if new.size:
                return new
        return None

    def __iter__(self) -> Iterator[np.ndarray]:
        """Yield the points of each round, flat indices, ascending."""
        yield from self._compute(self._cells.corners_and_centres(), Source.COMPUTED)
        wrong, n = self.refinement.wrong, self.source.size
        for look in range(1, MAX_LOOKS + 1):
            yield from self._agree(look)
            _, code = self.inferred()
            before = np.flatnonzero(self.source == Source.UNKNOWN)
            drawn = draw(before, n_drawn(wrong, look, n), self.refinement.seed, look)
            if drawn.size:
                yield from self._compute(drawn, Source.AUDIT)
                yield from self._agree(look)
            self.looks.append(self._look(look, before, drawn, code))
            if self.looks[-1].high < wrong:
                return

    def inferred(self) -> tuple[np.ndarray, np.ndarray]:
        """Return level and code (`Labels`) of every inferred point, shape (n,); 0 for others.

        The level is negative where the known points of the cell differ.
        """
        return self._cells.inferred()

    def _agree(self, look: int) -> Iterator[np.ndarray]:
        """Cut cells until the points of each agree, but for those that may be left."""
        allowed = n_allowed(self.refinement.wrong, look, self.source.size)
        while (wanted := self._cells.cut(allowed)).size:
            new = wanted[self.source[wanted] == Source.UNKNOWN]
            if new.size:
                yield from self._compute(new, Source.COMPUTED)

    def _compute(self, points: np.ndarray, source: Source) -> Iterator[np.ndarray]:
        """Yield points, and learn what they are."""
        self.source[points] = source
        yield points
        self._cells.learn(points, self.labels)

    def _look(self, look: int, before: np.ndarray, drawn: np.ndarray, code: np.ndarray) -> Look:
        """Return the result of a look, given the codes of the points inferred before it."""
        still = self.source[before] == Source.UNKNOWN
        left, gone = before[still], before[~still]
        _, now = self.inferred()
        wrong, n_gone = self._n_wrong(drawn, code), self._n_wrong(gone, code)
        changed = int((now[left] != code[left]).sum())
        low, high = interval(look, before.size, drawn.size, wrong, n_gone, changed, left.size)
        return Look(before.size, drawn.size, wrong, left.size, low, high)

    def _n_wrong(self, points: np.ndarray, code: np.ndarray) -> int:
        """Count computed points that differ from what was inferred."""
        return int((self.labels.least[points] != code[points]).sum())
