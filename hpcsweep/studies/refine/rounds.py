"""The rounds of a refined map: which points are computed next, from those computed before.

Rounds are a function of the labels of points alone, and each of them of the points of earlier
rounds alone: whoever knows more, from a file that is resumed or taken over, walks the same rounds.
"""

from collections.abc import Iterator

import numpy as np

from hpcsweep.studies.refine.audit import MOST_LOOKS, Look, draw, interval, n_drawn
from hpcsweep.studies.refine.cells import NOTHING, Cells, Labels
from hpcsweep.studies.refine.refinement import Refinement, Source


class Rounds:
    """One refined map on its way.

    Parameters
    ----------
    shape : tuple of int
        Points of every axis.
    refinement : Refinement
    labels : Labels
        Filled by the caller: before a round is requested, all points of those before are known.

    Attributes
    ----------
    source : ndarray of int8, shape (n,)
        Of the points computed so far, see `Source`; `UNKNOWN` elsewhere.
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
        """Return level and code (`Labels`) of every inferred point, shape (n,); of others 0."""
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
        """Return what the labels say of the points of rounds so far, and of no others."""
        done = self.source != Source.UNKNOWN
        return (
            np.where(done, self._labels.least, np.int32(NOTHING)),
            np.where(done, self._labels.greatest, np.int32(-1)),
        )

    def _look(self, look: int, before: np.ndarray, drawn: np.ndarray, code: np.ndarray) -> Look:
        """Return what a look has found, given the codes of the points inferred before it."""
        still = self.source[before] == Source.UNKNOWN
        left, gone = before[still], before[~still]
        _, now = self.inferred()
        wrong, found = self._n_wrong(drawn, code), self._n_wrong(gone, code)
        changed = int((now[left] != code[left]).sum())
        low, high = interval(look, before.size, drawn.size, wrong, found, changed, left.size)
        return Look(before.size, drawn.size, wrong, left.size, low, high)

    def _n_wrong(self, points: np.ndarray, code: np.ndarray) -> int:
        """Count computed points that were inferred to be something else."""
        return int((self._labels.least[points] != code[points]).sum())
