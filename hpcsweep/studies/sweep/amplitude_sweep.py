"""Sweep: path-following, each run from the end state of the previous one.

A frame is one path, up and then, if requested, down from the end of the way up: along the
amplitude, as in the study of the paper, or along another parameter (`hpcsweep.studies.path_grid`).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import TANGENTS
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.grid import DOWN, UP
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.path_grid import ALONG, Followed, PathGrid
from hpcsweep.studies.settings import SKIP_RULES
from hpcsweep.studies.study import Lines
from hpcsweep.studies.sweep.runs import FrameRuns, end_of, frame_runs

DIRECTIONS = Key(
    "directions",
    'ways along the path: `["up"]`, or `["up", "down"]`, the way back too',
    [UP, DOWN],
)


@dataclass(frozen=True, eq=False)
class AmplitudeSweep(PathGrid):
    """Sweeps, a frame a task; see `PathGrid`."""

    kind: ClassVar[str] = "amplitude_sweep"
    summary: ClassVar[str] = (
        "at each frequency the amplitudes in their order, each from where the one before it ended; "
        "or so along any other parameter"
    )
    words: ClassVar[dict[str, str]] = {UP: "sweep up", DOWN: "sweep down"}
    keys: ClassVar[Tables] = {"sweep": (*OMEGA, ALONG, DIRECTIONS)}
    default_block: ClassVar[int] = 50
    carries: ClassVar[str] = "the state is carried"

    @classmethod
    def read(cls, values, followed: Followed | None = None, **common) -> "AmplitudeSweep":
        """Read the sweeps of a job; see `RunGrid.read`."""
        ways = values.get("sweep.directions", DIRECTIONS.default)
        if ways not in ([UP], [UP, DOWN]):
            raise values.error("sweep.directions", ways, f'must be ["{UP}"] or ["{UP}", "{DOWN}"]')
        return cls(directions=tuple(ways), **cls.read_grid(values, followed), **common)

    @property
    def direction_name(self) -> str:  # type: ignore[override]
        """Long name of the first dimension."""
        return f"direction of the {'' if self.steps else 'amplitude '}sweep"

    def lines(self) -> Lines:
        """Tell the path, and which rules hold along it."""
        yield from super().lines()
        if self.steps:
            mapped = SKIP_RULES[: 3 if TANGENTS.of(self.structure) else 2]  # newton needs them
            rules = [name for name in mapped if name in self.settings.skip]
            yield "skip rules", ", ".join(rules or ["none"]) + ": all hold along any path"

    @property
    def carried(self) -> tuple[str, ...]:  # type: ignore[override]
        """Variables that hold the start of the next run."""
        tested = ("motion", "classification_cycles") if self.settings.classify_cycles else ()
        return ("final_state", *tested)

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the state from which the next run starts, and how long its chaos was followed."""
        return end_of(rows, row)

    def runs_of(self, structure: Structure, omega: float) -> FrameRuns:
        """Return what computes runs of one structure at one frequency."""
        return frame_runs(structure, omega, self.settings)
