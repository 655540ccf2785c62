"""How a refined map grows: what a campaign, which knows no maps, asks of one.

The points of a map are counted through ``commit``, where each is a block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.part import Part
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.crossing import KnownCurve, crossed_boxes
from hpcsweep.studies.refine.rounds import RefinementRounds, n_least
from hpcsweep.studies.refine.variables import derived_values, map_shape
from hpcsweep.studies.refinement import Refinement
from hpcsweep.studies.study import Study, as_kind

AT_ONCE = 64
"""Points of a task, at most; where a point takes long one is."""


@dataclass(frozen=True)
class MapGrowth:
    """Growth of a study's map, round by round.

    Attributes
    ----------
    study : Study
        The whole: with the axes of its job.
    refinement : Refinement
    """

    study: Study
    refinement: Refinement

    def problem(self) -> str:
        """Return why the points of the map have no neighbours and cannot be refined, or ''."""
        varied = self.study.axes
        if varied and "attractor" in self.refinement.on:
            key = f"vary.{varied[0].key}"
            return f"study.refine: does not go with {key}: each slice numbers its attractors anew"
        axes: dict = {f"vary.{axis.key}": axis.values for axis in varied} | self.study.map_axes
        for key, values in axes.items():
            numbers = np.asarray(values)
            finite = numbers.dtype.kind in "if" and bool(np.isfinite(numbers).all())
            if not finite or numbers.size < 2 or np.any(np.diff(numbers) <= 0):
                return f"study.refine: {key} must have two finite numbers or more, which ascend"
        return ""

    @property
    def at_once(self) -> int:
        """Most runs of a task."""
        solver = SOLVERS[self.study.settings.solver]
        return AT_ONCE if solver.follows_orbits and self.study.polls_per_run == 1 else 1

    def compute(self, blocks: Sequence[Block], state: np.ndarray, poll: Poll) -> list[Rows]:
        """Compute points of a frame, each a block, from a state."""
        parts = [self.study.part_of(block) for block in blocks]
        part, (_, frame, _) = as_kind(parts[0][0], Part), parts[0][1].first
        places = np.array([inner.first[-1] for _, inner in parts])
        found = part.runs_at(frame, places, state, poll)
        return [{name: rows[k : k + 1] for name, rows in found.items()} for k in range(len(blocks))]

    def crossed(self, curves: Iterable[KnownCurve]) -> np.ndarray:
        """Return which boxes of the map curves cross; see `crossed_boxes`."""
        return crossed_boxes(map_shape(self.study), [*self.study.map_axes.values()], curves)

    def begin(self, crossed: np.ndarray | None) -> RefinementRounds:
        """Return the rounds of a map whose boxes `crossed` known curves cross."""
        labels = Labels(self.study.n_runs)
        return RefinementRounds(map_shape(self.study), self.refinement, labels, crossed)

    def derived(self, rounds: RefinementRounds) -> Rows:
        """Return the variables that follow from a complete map; see `derived_values`."""
        return derived_values(self.study, rounds)

    def describe(self, crossed: np.ndarray | None) -> tuple[int, str]:
        """Return how many points of the map are computed at least, and that in words."""
        least = n_least(map_shape(self.study), self.refinement, crossed)
        curves = ", those that curves cross" if self.refinement.curves else ""
        return least, (
            f"the coarsest cells{curves} and the first draw of the audit are {least} "
            f"points ({100 * least / self.study.n_runs:.2g} %), the least; all points are the most"
        )


def growth_of(study: Study) -> MapGrowth | None:
    """Return how a study grows by what its runs are found to be; None if all are computed."""
    return None if study.refine is None else MapGrowth(study, study.refine)
