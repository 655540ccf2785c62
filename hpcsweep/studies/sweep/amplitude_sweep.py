"""Amplitude sweep: path-following, each amplitude from the end state of the previous one.

A frame is one path, up and then, if requested, down from the end of the way up. It is the study of
the paper, and the default.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Amplitudes, Poll, Rows
from hpcsweep.studies.grid import DOWN, UP, AlongAmplitudes
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.runs import end_of, frame_runs

DIRECTIONS = Key(
    "directions",
    'ways through the amplitudes: `["up"]`, or `["up", "down"]`, the way back too',
    [UP, DOWN],
)


@dataclass(frozen=True, eq=False)
class AmplitudeSweep(AlongAmplitudes):
    """Amplitude sweeps, a frame a task; see `RunGrid`."""

    yields: ClassVar[bool] = True
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

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some frames."""
        return {"omega": self.omega[frames]}

    @property
    def carried(self) -> tuple[str, ...]:  # type: ignore[override]
        """Variables that hold the start of the next run."""
        tested = ("motion", "classification_cycles") if self.settings.classify_cycles else ()
        return ("final_state", *tested)

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the state from which the next run starts, and how long its chaos was followed."""
        return end_of(rows, row)

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute consecutive runs, each from the end of the previous one."""
        omega, amplitudes = float(self.omega[frame]), self.amplitudes_of(frame)[places]
        return sweep_block(self.moving, omega, amplitudes, state, self.settings, poll)


def sweep_block(
    structure: Structure,
    omega: float,
    amplitudes: Amplitudes,
    state: np.ndarray,
    settings: SweepSettings,
    poll: Poll = None,
) -> Rows:
    """Run consecutive amplitudes of one sweep at one frequency; see `runs.FrameRuns.follow`."""
    return frame_runs(structure, omega, settings).follow(amplitudes, state, poll)
