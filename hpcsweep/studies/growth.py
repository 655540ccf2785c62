"""Interface of studies that grow: rounds of runs, which depend on the results of those before."""

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.variable import Coordinate, Variable


class Rounds(Protocol):
    """Rounds of runs, each known when the labels of those before are.

    Runs are counted through ``commit``: each is a block.
    """

    @property
    def n_known(self) -> int:
        """Number of runs whose labels are known."""

    @property
    def n_inferred(self) -> int:
        """Number of runs that need not be computed."""

    def learn(self, runs: np.ndarray, labels: np.ndarray) -> None:
        """Take the labels of computed runs."""

    def next(self) -> np.ndarray | None:
        """Return the runs of the next round that are not known yet; None if none is left."""

    def derived(self) -> Rows:
        """Return the variables that follow from all rounds."""


class StudyGrowth(Protocol):
    """How a study grows by what its runs are found to be."""

    @property
    def at_once(self) -> int:
        """Most runs of a task."""

    def compute(self, blocks: Sequence[Block], state: np.ndarray, poll: Poll) -> list[Rows]:
        """Compute runs of a frame, each a block, from a state."""

    def labels(self, rows: Rows) -> np.ndarray:
        """Return what rounds depend on, shape (k, m): first whether a run failed."""

    @property
    def variables(self) -> list[Variable]:
        """Variables besides those of the runs, which follow from all rounds; checksums last."""

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Dimensions of these alone."""

    @property
    def curves(self) -> tuple[str, ...]:
        """Results files whose curves guide it."""

    def crossed(self, curves: Iterable) -> np.ndarray:
        """Return where curves, `refine.crossing.KnownCurve`, cross the map of all runs."""

    def problem(self) -> str:
        """Return why the study cannot grow; '' if it can."""

    def begin(self, crossed: np.ndarray | None) -> Rounds:
        """Return the rounds, given where the curves cross, if there are any."""

    def describe(self, crossed: np.ndarray | None) -> tuple[int, str]:
        """Return how many runs are computed at least, and that in words."""
