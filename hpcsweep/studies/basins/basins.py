"""Study of basins of attraction at one point (A, Omega), on a slice of the initial states.

A row of the slice is a run and a task of its own, so that a slice scales to as many ranks as it has
rows; each row depends only on the job.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from hpcsweep.studies.attractors.search import UNSTORED, attractors_as_runs, count_starts
from hpcsweep.studies.attractors.tally import BasinTally
from hpcsweep.studies.attractors.variables import SLOTS
from hpcsweep.studies.basins.refined import LABEL, RefinedBasins, runs_of
from hpcsweep.studies.basins.slice import SliceGrid, read_slice
from hpcsweep.studies.basins.variables import COMMIT, RUN, basin_variables
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.invariants import Broken
from hpcsweep.studies.refinement import read_refinement
from hpcsweep.studies.study import StudyTally
from hpcsweep.studies.variable import Variable


@dataclass(frozen=True, eq=False)
class Basins(SliceGrid):
    """Basins on a slice, a row a run; see `SliceGrid`."""

    run_noun: ClassVar[str] = "row"
    run_dims: ClassVar[tuple[str, ...]] = RUN
    commit: ClassVar[Variable] = COMMIT
    slots: ClassVar[Mapping[str, str]] = SLOTS
    status_variables: ClassVar[tuple[str, ...]] = ("n_undecided", "n_failed", "n_elsewhere")

    @classmethod
    def read(cls, values, **common) -> "Basins | RefinedBasins":
        """Read the point, the slice and the limits; see `RunGrid.read`."""
        fields = read_slice(values, common)
        size = common["block_size"]
        refine = read_refinement(values, fields["settings"], size, (LABEL,))
        if refine is not None:
            return RefinedBasins(refine=refine, **fields)
        if size != 1:
            given = values.get("output.block")
            raise values.error("output.block", given, "must be 1, each row a block")
        return cls(**fields)

    @property
    def polls_per_run(self) -> int:
        """Return the number of starts of a row."""
        return self.horizontal.size

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the rows, in the order of the file."""
        return basin_variables(self.settings)

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Return the attractors that the starts of a row reach."""
        del places, state
        return runs_of(self).row(self.horizontal, float(self.vertical[frame]), poll)

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the attractors listed by a row as motions in which runs ended."""
        return attractors_as_runs(self.variables, run)

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count the starts, and those that reached none of the listed attractors."""
        good = done & (runs["outcome"] > 0)
        return count_starts(
            int(good.sum()) * self.horizontal.size,
            runs["cycles"][good].sum(),
            (runs[f"n_{name}"][good].sum() for name in UNSTORED),
        )

    def tally(self) -> StudyTally:
        """Return a tally of rows for ``summary``."""
        return BasinTally(self)

    def relations(self, _block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        from hpcsweep.studies.attractors.invariants import broken_rows

        return broken_rows(rows)

    def describe(self, run: tuple[int, ...]) -> dict[str, Any]:
        """Describe a row by its value of the component and the point (A, Omega)."""
        return {self.names()[1]: float(self.vertical[run[1]])} | super().describe(run)

    def describe_task(self, task: int) -> str:
        """Describe a row by its value of the component."""
        return f"{self.names()[1]} = {self.vertical[task]:.6g}"
