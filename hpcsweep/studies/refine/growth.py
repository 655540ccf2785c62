"""How a refined map grows: what a campaign, which knows no maps, asks of one.

The points of a map are counted through ``commit``, where each is a block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, cast

import numpy as np

from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.crossing import KnownCurve, crossed_boxes
from hpcsweep.studies.refine.refinement import Refinement, Source, map_shape
from hpcsweep.studies.refine.rounds import RefinementRounds, n_least
from hpcsweep.studies.refine.variables import (
    derived_coordinates,
    derived_values,
    derived_variables,
)
from hpcsweep.studies.study import Study
from hpcsweep.studies.variable import Coordinate, Variable

AT_ONCE = 64
"""Points of a task, at most; where a point takes long one is."""


class Mapped(Protocol):
    """Part of a study whose map grows."""

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> dict:
        """Compute the runs of a frame at places along its last axis, in this order."""


@dataclass(frozen=True)
class MapGrowth:
    """Growth of a study's map; see `hpcsweep.studies.growth.StudyGrowth`.

    Attributes
    ----------
    study : Study
        The whole: with the axes of its job.
    refinement : Refinement
    axes : dict of str to ndarray
        Values of the last two axes of the map, by key of the job.
    """

    study: Study
    refinement: Refinement
    axes: dict[str, np.ndarray]

    def problem(self) -> str:
        """Return why the points of the map have no neighbours and cannot be refined, or ''."""
        varied = self.study.axes
        if varied and "attractor" in self.refinement.on:
            key = f"vary.{varied[0].key}"
            return f"study.refine: does not go with {key}: each slice numbers its attractors anew"
        axes: dict = {f"vary.{axis.key}": axis.values for axis in varied} | self.axes
        for key, values in axes.items():
            numbers = np.asarray(values)
            finite = numbers.dtype.kind in "if" and bool(np.isfinite(numbers).all())
            if not finite or numbers.size < 2 or np.any(np.diff(numbers) <= 0):
                return f"study.refine: {key} must have two finite numbers or more, which ascend"
        return ""

    def of_whole(self, study: Study) -> "MapGrowth":
        """Return the growth of a study of which this is one of a part."""
        return replace(self, study=study)

    @property
    def at_once(self) -> int:
        """Most runs of a task."""
        solver = SOLVERS[self.study.settings.solver]
        return AT_ONCE if solver.follows_orbits and self.study.polls_per_run == 1 else 1

    def compute(self, blocks: Sequence[Block], state: np.ndarray, poll: Poll) -> list[Rows]:
        """Compute points of a frame, each a block, from a state."""
        parts = [self.study.part_of(block) for block in blocks]
        part, (_, frame, _) = cast(Mapped, parts[0][0]), parts[0][1].first
        places = np.array([inner.first[-1] for _, inner in parts])
        found = part.runs_at(frame, places, state, poll)
        return [{name: rows[k : k + 1] for name, rows in found.items()} for k in range(len(blocks))]

    def labels(self, rows: Rows) -> np.ndarray:
        """Return what rounds depend on; see `Refinement.labels`."""
        return self.refinement.labels(rows)

    @property
    def variables(self) -> list[Variable]:
        """Variables of the map besides those of its runs, checksums last."""
        return derived_variables(self.study, self.refinement)

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Dimensions of refined maps alone."""
        return derived_coordinates()

    @property
    def curves(self) -> tuple[str, ...]:
        """Results files whose curves are not to be missed."""
        return self.refinement.curves

    def crossed(self, curves: Iterable[KnownCurve]) -> np.ndarray:
        """Return which boxes of the map curves cross; see `crossed_boxes`."""
        return crossed_boxes(map_shape(self.study), [*self.axes.values()], curves)

    def begin(self, crossed: np.ndarray | None) -> "MapRounds":
        """Return the rounds of a map whose boxes `crossed` known curves cross."""
        return MapRounds(self.study, self.refinement, crossed)

    def describe(self, crossed: np.ndarray | None) -> tuple[int, str]:
        """Return how many points of the map are computed at least, and that in words."""
        least = n_least(map_shape(self.study), self.refinement, crossed)
        curves = ", those that curves cross" if self.refinement.curves else ""
        return least, (
            f"refined:    the coarsest cells{curves} and the first draw of the audit are {least} "
            f"points ({100 * least / self.study.n_runs:.2g} %), the least; all points are the most"
        )


class MapRounds:
    """Rounds of a map as far as its points are known; see `hpcsweep.studies.growth.Rounds`."""

    def __init__(self, study: Study, refinement: Refinement, crossed: np.ndarray | None):
        self._study, self._refinement = study, refinement
        self._labels = Labels(study.n_runs)
        self._rounds = RefinementRounds(map_shape(study), refinement, self._labels, crossed)
        self._walk = iter(self._rounds)

    @property
    def n_known(self) -> int:
        """Number of points whose labels are known."""
        return int(self._labels.known.sum())

    @property
    def n_inferred(self) -> int:
        """Number of points that are not computed."""
        return int((self._rounds.source == Source.UNKNOWN).sum())

    def learn(self, points: np.ndarray, labels: np.ndarray) -> None:
        """Take the labels of computed points."""
        self._labels.store(points, labels)

    def next(self) -> np.ndarray | None:
        """Return the points of the next round that are not known yet; None if the map is complete.

        All points of earlier rounds must be known.
        """
        for points in self._walk:
            new = points[~self._labels.known[points]]
            if new.size:
                return new
        return None

    def derived(self) -> Rows:
        """Return the variables that follow from a complete map; see `derived_values`."""
        return derived_values(self._study, self._refinement, self._rounds, self._labels)
