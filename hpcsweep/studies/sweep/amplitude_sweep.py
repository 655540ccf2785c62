"""Amplitude sweep: path-following, each amplitude from the end state of the previous one.

A frame is one path, up and then, if requested, down from the end of the way up. It is the study of
the paper, and the default.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Block, Path
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.study import Amplitudes
from hpcsweep.studies.sweep.runs import end_of, frame_runs

UP, DOWN = "up", "down"
DIRECTIONS = Key(
    "directions",
    'ways through the amplitudes: `["up"]`, or `["up", "down"]`, the way back too',
    [UP, DOWN],
)


@dataclass(frozen=True, eq=False)
class AmplitudeSweep(RunGrid):
    """Amplitude sweeps, a frame a task; see `RunGrid`."""

    kind: ClassVar[str] = "amplitude_sweep"
    summary: ClassVar[str] = (
        "at each frequency the amplitudes in their order, each from where the one before it ended"
    )
    words: ClassVar[dict[str, str]] = {UP: "sweep up", DOWN: "sweep down"}
    direction_name: ClassVar[str] = "direction of the amplitude sweep"
    keys: ClassVar[Tables] = {"sweep": (*OMEGA, DIRECTIONS)}
    default_block: ClassVar[int] = 50
    grid_fields: ClassVar[tuple[str, ...]] = ("omega", "amplitude", "directions", "block_size")

    @classmethod
    def read(cls, values, **common) -> "AmplitudeSweep":
        """Read the sweeps of a job; see `RunGrid.read`."""
        given = values.get("sweep.directions", DIRECTIONS.default)
        if given not in ([UP], [UP, DOWN]):
            raise values.error("sweep.directions", given, f'must be ["{UP}"] or ["{UP}", "{DOWN}"]')
        return cls(
            omega=values.frequencies("sweep.omega"),
            amplitude=values.amplitudes("sweep.amplitude"),
            directions=tuple(given),
            **common,
        )

    def task_of(self, direction, frame, number):
        """Return the task of blocks: their frame."""
        del direction, number
        return frame

    def path(self, task: int) -> Path:
        """Return the blocks of a frame: up, then down."""

        def block(position: int) -> Block:
            direction, number = divmod(position, self.n_blocks)
            return self.block((direction, task, number))

        return Path(len(self.directions) * self.n_blocks, block)

    def descends(self, direction: int) -> bool:
        """Return whether the amplitudes of a direction are computed in descending order."""
        return self.directions[direction] == DOWN

    @property
    def carried(self) -> tuple[str, ...]:  # type: ignore[override]
        """Variables that hold the start of the next run."""
        tested = ("motion", "classification_cycles") if self.settings.classify_cycles else ()
        return ("final_state", *tested)

    def end_state(self, rows: dict[str, np.ndarray], row: int) -> np.ndarray:
        """Return the state from which the next run starts, and how long its chaos was followed."""
        return end_of(rows, row)

    def rows(
        self,
        frame: int,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Compute consecutive runs, each from the end of the previous one."""
        omega = float(self.omega[frame])
        return sweep_block(self.moving, omega, amplitudes, state, self.settings, poll)

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


def sweep_block(
    structure: Structure,
    omega: float,
    amplitudes: Amplitudes,
    state: np.ndarray,
    settings: SweepSettings,
    poll: Callable[[], None] | None = None,
) -> dict[str, np.ndarray]:
    """Run consecutive amplitudes of one sweep at one frequency; see `runs.FrameRuns.follow`."""
    return frame_runs(structure, omega, settings).follow(amplitudes, state, poll)
