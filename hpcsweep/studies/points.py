"""Study of the motions of single points, each from the job's initial state."""

from dataclasses import dataclass
from typing import ClassVar

from hpcsweep.model.structure import Structure
from hpcsweep.studies.keys import OMEGA, Tables
from hpcsweep.studies.point_grid import POINTS, PointGrid
from hpcsweep.studies.refinement import REFINE, read_refinement
from hpcsweep.studies.sweep.runs import FrameRuns, frame_runs

START = "initial"


@dataclass(frozen=True, eq=False)
class Points(PointGrid):
    """Motions of points, a block of them a task; see `PointGrid`."""

    directions: tuple[str, ...] = (START,)

    kind: ClassVar[str] = "points"
    summary: ClassVar[str] = (
        "every amplitude at every frequency, or a list of points, each from the initial state"
    )
    words: ClassVar[dict[str, str]] = {START: "each from the initial state"}
    direction_name: ClassVar[str] = "where each run starts"
    keys: ClassVar[Tables] = {"study": (POINTS, REFINE), "sweep": OMEGA}

    @classmethod
    def read(cls, values, **common) -> "Points":
        """Read the grid, or the list, of points of a job; see `RunGrid.read`."""
        refine = read_refinement(values, common["settings"], common["block_size"])
        return cls.of(values, refine=refine, **common)

    def runs_of(self, structure: Structure, omega: float) -> FrameRuns:
        """Return what computes runs of one structure at one frequency."""
        return frame_runs(structure, omega, self.settings)
