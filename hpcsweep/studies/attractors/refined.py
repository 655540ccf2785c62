"""Attractors of points on their own, of which a refined map of their number is made.

Nothing is continued from the amplitude before: the seed at every point is the initial state, and
attractors are numbered at each point anew. So a point depends on the job alone, whichever others
are computed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hpcsweep.studies.attractors.attractors import Attractors
from hpcsweep.studies.refine.refinement import Refinement
from hpcsweep.studies.study import Amplitudes, Block, Path
from hpcsweep.studies.sweep.amplitude_sweep import UP


@dataclass(frozen=True, eq=False)
class RefinedAttractors(Attractors):
    """Attractors of points, a point a task; see `RunGrid`.

    Attributes
    ----------
    refine : Refinement
        Which points of the grid are computed.
    """

    refine: Refinement | None = None

    task_noun: ClassVar[str] = "point"
    why_whole: ClassVar[str] = "the attractors of a point are one run, which cannot be cut"
    words: ClassVar[dict[str, str]] = {UP: "each point on its own"}
    grid_fields: ClassVar[tuple[str, ...]] = (*Attractors.grid_fields, "refine")

    def task_of(self, direction, frame, number):
        """Return the task of blocks: every block is one."""
        del direction
        return frame * self.n_blocks + number

    def path(self, task: int) -> Path:
        """Return the one block of a task."""
        return Path(1, lambda _: self.block((0, *divmod(task, self.n_blocks))))

    def predecessor(self, block: Block, row: int) -> tuple[int, ...] | None:
        """Return None: every point is on its own."""
        del block, row
        return None

    def rows(
        self,
        frame: int,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Find the attractors of amplitudes, each from the same state."""
        found = [super(RefinedAttractors, self).rows(frame, [a], state, poll) for a in amplitudes]
        return {name: np.concatenate([one[name] for one in found]) for name in found[0]}

    def describe_task(self, task: int) -> str:
        """Describe a point by its frequency and amplitude."""
        (block,) = self.path(task)
        found = self.describe(block.first)
        return f"Omega = {found['omega']:.6g}, A = {found['amplitude']:.6g}"
