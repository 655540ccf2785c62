"""Study of basins of attraction at one point (A, Omega), on a slice of the initial states.

A row of the slice is a run and a task of its own, so that a slice scales to as many ranks as it has
rows; each row depends only on the job. Of a refined map a run is a start: each is classified as if
it were the only one, so that its label depends on the job alone, whichever others are computed. The
attractors are listed when the map is complete.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from hpcsweep.dynamics.attractor import FAILED
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors import search, variables
from hpcsweep.studies.attractors.search import attractors_as_runs
from hpcsweep.studies.attractors.tally import BasinTally, StartTally
from hpcsweep.studies.basins.slice import SliceGrid, read_slice
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.invariants import Broken
from hpcsweep.studies.refinement import Refinement, read_refinement
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import numbered

LABEL = "attractor"
"""What distinguishes starts, of `hpcsweep.studies.refinement.LABELS`."""


@lru_cache(maxsize=2)
def runs_of(study: SliceGrid):
    """Return the runs of a slice, see `hpcsweep.studies.basins.runs.SliceRuns`.

    The attractors of the last two slices are cached.
    """
    # imported here: reading results needs no kernels
    from hpcsweep.studies.basins.runs import SliceRuns

    return SliceRuns(study)


@dataclass(frozen=True, eq=False)
class Basins(SliceGrid):
    """Basins on a slice, a row a run; see `SliceGrid`."""

    run_noun: ClassVar[str] = "row"
    run_dims: ClassVar[tuple[str, ...]] = variables.RUN
    slots: ClassVar[Mapping[str, str]] = variables.SLOTS
    status_variables: ClassVar[tuple[str, ...]] = search.COUNTS

    @classmethod
    def read(cls, values, **common) -> "Basins | RefinedBasins":
        """Read the point, the slice and the limits; see `RunGrid.read`."""
        fields = read_slice(values, common)
        size = common["block_size"]
        refine = read_refinement(values, fields["settings"], size, (LABEL,))
        if refine is not None:
            return RefinedBasins(refine=refine, **fields)
        if size != 1:
            block = values.get("output.block")
            raise values.error("output.block", block, "must be 1, each row a block")
        return cls(**fields)

    @property
    def polls_per_run(self) -> int:  # type: ignore[override]
        """Return the number of starts of a row."""
        return self.horizontal.size

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a row, see `Part.of_run`."""
        return variables.basin_variables(self.settings, self.structure)

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Return the attractors that the starts of a row reach."""
        return runs_of(self).row(self.horizontal, float(self.vertical[frame]), poll)

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the attractors listed by a row as motions in which runs ended."""
        return attractors_as_runs(self.of_run, run)

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count the starts, and those that reached none of the listed attractors."""
        return search.count_starts(done & (runs["outcome"] > 0), runs, self.horizontal.size)

    def tally(self) -> BasinTally:
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


@dataclass(frozen=True, eq=False)
class RefinedBasins(SliceGrid):
    """Basins on a slice, a start a run; see `SliceGrid`.

    Attributes
    ----------
    refine : Refinement
        Which starts of the slice are computed.
    """

    refine: Refinement | None = None

    run_noun: ClassVar[str] = "start"
    run_dims: ClassVar[tuple[str, ...]] = variables.START_RUN
    checksum: ClassVar[str] = "checksum of a start"
    status_variables: ClassVar[tuple[str, ...]] = ("label",)

    @property
    def n_along(self) -> int:
        """Number of runs of one frame: the starts of a row."""
        return self.horizontal.size

    @property
    def map_axes(self) -> dict[str, np.ndarray]:  # type: ignore[override]
        """Values of the axes of the map, by key of the job."""
        return {"study.vertical": self.vertical, "study.horizontal": self.horizontal}

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a start, see `Part.of_run`."""
        return variables.START_VARIABLES

    @property
    def listed_variables(self) -> list[Variable]:
        """Variables of the attractors, which a complete map lists for each row."""
        return variables.listed_variables(self.settings, self.structure)

    def listed_values(self) -> Rows:
        """Return the values of `listed_variables` for a row, first axis the attractors."""
        attractors = runs_of(self).attractors()
        return {variable.name: attractors[variable.name][0] for variable in self.listed_variables}

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        coordinates = super().coordinates
        del coordinates["amplitude"]
        return coordinates | {"block": numbered(self.n_blocks, "start of a row")}

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        amplitude = np.full(self.vertical.size, self.amplitude[0])
        return [*super().given, (variables.ROW_AMPLITUDE, amplitude)]

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> dict:
        """Classify starts of a row, each on its own."""
        return runs_of(self).starts(self.horizontal[places], float(self.vertical[frame]), poll)

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the attractor that a start goes to as the motion in which a run ended."""
        label = int(run["label"])
        if label <= 0:
            return []
        attractors = {name: values[0] for name, values in runs_of(self).attractors().items()}
        listed = variables.of_attractors(self.settings, self.structure)
        return attractors_as_runs(listed, attractors)[label - 1 : label]

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count the computed starts, and those that reached none of the listed attractors."""
        counts = {f"n_{name}": runs["label"] == k for name, k in search.UNSTORED.items()}
        return search.count_starts(done, runs | counts, 1)

    def tally(self) -> StartTally:
        """Return a tally of starts for ``summary``."""
        return StartTally(self)

    def relations(self, _block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        label, failed = rows["label"], rows["outcome"] != Outcome.COMPLETE
        codes = (*search.UNSTORED.values(), *range(1, self.max_attractors + 1))
        return {
            "label is of an attractor of the list, -1, -2 or -3": ~np.isin(label, codes),
            "a start that failed, and no other, is labelled so": (label == FAILED) != failed,
        }

    def describe(self, run: tuple[int, ...]) -> dict[str, Any]:
        """Describe a start by its place on the slice and the point (A, Omega)."""
        direction, row, at = run
        return {
            "row": row,
            "column": float(self.horizontal[at]),
            "direction": self.directions[direction],
            "omega": float(self.omega[row]),
            "amplitude": float(self.amplitude[0]),
        }

    def describe_task(self, task: int) -> str:
        """Describe a start by its two components."""
        row, at = divmod(task, self.horizontal.size)
        first, second = self.names()
        return f"{first} = {self.horizontal[at]:.6g}, {second} = {self.vertical[row]:.6g}"
