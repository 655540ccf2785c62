"""Rounds of a refined map: the points to compute next, from those computed before.

Rounds depend only on the labels of points, and each round only on the points of earlier rounds:
with more known points, from a resumed or reused file, the rounds are the same.
"""

from collections.abc import Iterator

import numpy as np

from hpcsweep.studies.refine.audit import MOST_LOOKS, Look, draw, interval, n_drawn
from hpcsweep.studies.refine.cells import NOTHING, Cells, Labels
from hpcsweep.studies.refine.refinement import Refinement, Source


class Rounds:
    """State of a refined map.

    Parameters
    ----------
    shape : tuple of int
        Points of every axis.
    refinement : Refinement
    labels : Labels
        Filled by the caller: when a round is requested, all points of earlier rounds must be known.

    Attributes
    ----------
    source : ndarray of int8, shape (n,)
        Source of the points computed so far, see `Source`; `UNKNOWN` elsewhere.
    looks : list of Look
    """

    def __init__(self, shape: tuple[int, ...], refinement: Refinement, labels: Labels):
        self._refinement, self._labels = refinement, labels
        self._cells = Cells(shape, refinement.levels)
        self.source = np.zeros(int(np.prod(shape)), np.int8)
        self.looks: list[Look] = []

    def __iter__(self) -> Iterator[np.ndarray]:
        """Yield the points of each round, flat indices, ascending."""
        yield self._computed(self._cells.first(), Source.COMPUTED)
        yield from self._agree()
        wrong = self._refinement.wrong
        for look in range(1, MOST_LOOKS + 1):
            _, code = self.inferred()
            before = np.flatnonzero(self.source == Source.UNKNOWN)
            drawn = draw(before, n_drawn(wrong, look), self._refinement.seed, look)
            if drawn.size:
                yield self._computed(drawn, Source.AUDIT)
                yield from self._agree()
            self.looks.append(self._look(look, before, drawn, code))
            if self.looks[-1].high < wrong:
                return

    def inferred(self) -> tuple[np.ndarray, np.ndarray]:
        """Return level and code (`Labels`) of every inferred point, shape (n,); 0 for others."""
        return self._cells.inferred(*self._known())

    def _agree(self) -> Iterator[np.ndarray]:
        """Cut cells until the points of each of them agree."""
        while True:
            wanted = self._cells.cut(*self._known())
            new = wanted[self.source[wanted] == Source.UNKNOWN]
            if new.size:
                yield self._computed(new, Source.COMPUTED)
            elif not wanted.size:
                return

    def _computed(self, points: np.ndarray, source: Source) -> np.ndarray:
        self.source[points] = source
        return points

    def _known(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the labels of the points of all rounds so far, and of no others."""
        done = self.source != Source.UNKNOWN
        return (
            np.where(done, self._labels.least, np.int32(NOTHING)),
            np.where(done, self._labels.greatest, np.int32(-1)),
        )

    def _look(self, look: int, before: np.ndarray, drawn: np.ndarray, code: np.ndarray) -> Look:
        """Return the result of a look, given the codes of the points inferred before it."""
        still = self.source[before] == Source.UNKNOWN
        left, gone = before[still], before[~still]
        _, now = self.inferred()
        wrong, found = self._n_wrong(drawn, code), self._n_wrong(gone, code)
        changed = int((now[left] != code[left]).sum())
        low, high = interval(look, before.size, drawn.size, wrong, found, changed, left.size)
        return Look(before.size, drawn.size, wrong, left.size, low, high)

    def _n_wrong(self, points: np.ndarray, code: np.ndarray) -> int:
        """Count computed points that differ from what was inferred."""
        return int((self._labels.least[points] != code[points]).sum())
