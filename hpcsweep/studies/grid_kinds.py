"""Two kinds of grid: frames that are paths along amplitudes, and maps that may be refined."""

from typing import ClassVar

import numpy as np

from hpcsweep.studies.blocks import Block, Path
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.refine.growth import MapGrowth
from hpcsweep.studies.refine.refinement import Refinement

UP, DOWN = "up", "down"


class AlongAmplitudes(RunGrid):
    """A grid each frame of which is a path: up, then down if that is a direction too."""

    is_path: ClassVar[bool] = True

    def task_of(self, *place):
        """Return the task of blocks: their frame."""
        return place[-2]

    def path(self, task: int) -> Path:
        """Return the blocks of a frame: up, then down."""

        def block(position: int) -> Block:
            direction, number = divmod(position, self.n_blocks)
            return self.block((direction, task, number))

        return Path(len(self.directions) * self.n_blocks, block)

    def descends(self, direction: int) -> bool:
        """Return whether the amplitudes of a direction are computed in descending order."""
        return self.directions[direction] == DOWN

    def predecessor(self, block: Block, row: int) -> tuple[int, ...] | None:
        """Return the index of the previous run on the path; None for the first."""
        if row != block.begin:
            return block.run(row + 1 if block.descending else row - 1)
        path = self.path(block.task)
        position = next(k for k, other in enumerate(path) if other.place == block.place)
        before = path[position - 1] if position else None
        return before.run(before.end) if before else None

    def describe_task(self, task: int) -> str:
        """Describe a frame by its frequency."""
        return f"Omega = {self.omega[task]:.6g}"


class MappedRuns(RunGrid):
    """A grid of which a map may be refined."""

    refine: Refinement | None = None

    @property
    def growth(self) -> MapGrowth | None:
        """How its map grows; None if all runs are computed."""
        return None if self.refine is None else MapGrowth(self, self.refine, self.map_axes)

    @property
    def map_axes(self) -> dict[str, np.ndarray]:
        """Values of the axes of a refined map, by key of the job."""
        return {"sweep.omega": self.omega, "sweep.amplitude": self.amplitude}
