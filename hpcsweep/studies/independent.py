"""Base of studies whose blocks depend on no other: each is a task of its own."""

from typing import ClassVar

import numpy as np

from hpcsweep.studies.blocks import Block, Path
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.refine.growth import MapGrowth
from hpcsweep.studies.refine.refinement import Refinement


class IndependentRuns(RunGrid):
    """A grid of runs without a path: every block is a task, each run starts afresh."""

    is_path: ClassVar[bool] = False
    refine: Refinement | None = None

    @property
    def growth(self) -> MapGrowth | None:
        """How its map grows; None if all runs are computed."""
        return None if self.refine is None else MapGrowth(self, self.refine, self.map_axes)

    @property
    def map_axes(self) -> dict[str, np.ndarray]:
        """Values of the axes of a refined map, by key of the job."""
        return {"sweep.omega": self.omega, "sweep.amplitude": self.amplitude}

    def task_of(self, direction, frame, number):
        """Return the task of blocks: every block is one."""
        del direction
        return frame * self.n_blocks + number

    def path(self, task: int) -> Path:
        """Return the one block of a task."""
        return Path(1, lambda _: self.block((0, *divmod(task, self.n_blocks))))

    def descends(self, direction: int) -> bool:
        """Return False: runs are computed in ascending order."""
        del direction
        return False

    def predecessor(self, block: Block, row: int) -> tuple[int, ...] | None:
        """Return None: every run is independent."""
        del block, row
        return None

    def describe_task(self, task: int) -> str:
        """Describe a task by its frequency and amplitudes."""
        (block,) = self.path(task)
        first, last = self.describe(block.first), self.describe(block.run(block.n_runs - 1))
        more = f" to {last['amplitude']:.6g}" if block.n_runs > 1 else ""
        return f"Omega = {first['omega']:.6g}, A = {first['amplitude']:.6g}{more}"
