"""Sweep: path-following, each run from the end state of the previous one.

A frame is one path, up and then, if requested, down from the end of the way up: along the
amplitude, as in the study of the paper, or along another parameter (`SweepPath`).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any, ClassVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Amplitudes, Place, Poll, Rows
from hpcsweep.studies.grid import DOWN, UP, AlongAmplitudes
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.settings import SKIP_RULES, SweepSettings
from hpcsweep.studies.study import Lines
from hpcsweep.studies.sweep.path import ALONG, FORCING, Followed, SweepPath, read_path
from hpcsweep.studies.sweep.runs import end_of, frame_runs, joined
from hpcsweep.studies.variable import Coordinate, Variable

DIRECTIONS = Key(
    "directions",
    'ways along the path: `["up"]`, or `["up", "down"]`, the way back too',
    [UP, DOWN],
)


@dataclass(frozen=True, eq=False)
class AmplitudeSweep(AlongAmplitudes):
    """Sweeps, a frame a task; see `RunGrid`.

    Attributes
    ----------
    steps : SweepPath, optional
        Where they lead, if not along the amplitude at each frequency. `omega` and `amplitude` are
        then the values that occur, ascending.
    """

    steps: SweepPath | None = None

    yields: ClassVar[bool] = True
    kind: ClassVar[str] = "amplitude_sweep"
    summary: ClassVar[str] = (
        "at each frequency the amplitudes in their order, each from where the one before it ended; "
        "or so along any other parameter"
    )
    words: ClassVar[dict[str, str]] = {UP: "sweep up", DOWN: "sweep down"}
    keys: ClassVar[Tables] = {"sweep": (*OMEGA, ALONG, DIRECTIONS)}
    default_block: ClassVar[int] = 50

    @classmethod
    def read(cls, values, followed: Followed | None = None, **common) -> "AmplitudeSweep":
        """Read the sweeps of a job; see `RunGrid.read`."""
        given = values.get("sweep.directions", DIRECTIONS.default)
        if given not in ([UP], [UP, DOWN]):
            raise values.error("sweep.directions", given, f'must be ["{UP}"] or ["{UP}", "{DOWN}"]')
        common |= {"directions": tuple(given), "steps": read_path(values, followed)}
        if path := common["steps"]:
            return cls(omega=np.unique(path.omega), amplitude=np.unique(path.amplitude), **common)
        return cls(
            omega=values.frequencies("sweep.omega"),
            amplitude=values.amplitudes("sweep.amplitude"),
            **common,
        )

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some frames."""
        if self.steps is None:
            return {"omega": self.omega[frames]}
        arrays = {name: getattr(self.steps, name)[frames] for name in ("frames", *FORCING)}
        own = {name: np.unique(arrays[name]) for name in FORCING}
        return {"steps": replace(self.steps, **arrays), **own}

    @property
    def direction_name(self) -> str:  # type: ignore[override]
        """Long name of the first dimension."""
        return f"direction of the {'' if self.steps else 'amplitude '}sweep"

    @property
    def grid_fields(self) -> tuple[str, ...]:  # type: ignore[override]
        """Fields that say which runs there are; none where each has a structure of its own."""
        own = "omega", "amplitude", "directions", "block_size", "steps"
        return own if len(self.structures) == 1 else ()

    @property
    def run_dims(self) -> tuple[str, ...]:  # type: ignore[override]
        """Dimensions of a run."""
        return ("direction", *self.grid)

    @property
    def grid(self) -> dict[str, Coordinate]:
        """Values of the dimensions of the frames, and of the runs of a frame."""
        return self.steps.coordinates if self.steps else super().grid

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the runs, in the order of the file."""
        size = len(self.run_dims)
        return [replace(one, dims=(*self.run_dims, *one.dims[size:])) for one in super().variables]

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        return super().given + (self.steps.given if self.steps else [])

    @property
    def ties(self) -> tuple[str, ...]:  # type: ignore[override]
        """Formulas of frequency and amplitude."""
        return self.steps.ties if self.steps else ()

    @property
    def frames(self) -> np.ndarray:
        """Values of the dimension of the frames."""
        return self.steps.frames if self.steps else self.omega

    @property
    def structures(self) -> tuple[Structure, ...]:
        """The structure of each run of a frame, or of all of them."""
        return (self.steps.along.structures if self.steps else ()) or super().structures

    def along_of(self, frame: int) -> np.ndarray:
        """Return the values of the last dimension of the runs of a frame, ascending."""
        return self.steps.along.values if self.steps else self.amplitude

    def amplitudes_of(self, frame: int) -> np.ndarray:
        """Return the amplitudes of the runs of a frame, shape (n_along,)."""
        return self.steps.amplitude[frame] if self.steps else self.amplitude

    def omegas_of(self, frame: int) -> np.ndarray:
        """Return the frequencies of the runs of a frame, shape (n_along,)."""
        return self.steps.omega[frame] if self.steps else super().omegas_of(frame)

    def describe(self, run: Place) -> dict[str, Any]:
        """Describe a run: ``direction``, ``omega``, ``amplitude``, and a key that it follows."""
        found, name = super().describe(run), self.run_dims[-1]
        return found | {name: float(self.along_of(run[1])[run[2]])}

    def describe_task(self, task: int) -> str:
        """Describe a frame by its frequency, or its amplitude."""
        name = self.run_dims[-2]
        return run_name({name: float(self.frames[task])}) if name in FORCING else "the path"

    def lines(self) -> Lines:
        """Tell the path, and what drives the structure along it."""
        if self.steps:
            yield "path", f"{self.steps.words}; the state is carried at phase 0 of the forcing"
            rules = [name for name in SKIP_RULES if name in self.settings.skip]
            yield "skip rules", ", ".join(rules or ["none"]) + ": all hold along any path"
        yield from super().lines()

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
        amplitudes, omegas = self.amplitudes_of(frame), self.omegas_of(frame).tolist()
        several = len(self.structures) > 1  # out of reach of one, a contact may be hit by another
        parts = []
        for (omega, at), own in groupby(places.tolist(), lambda k: (omegas[k], k * several)):
            structure = self.structure_at(at) if several else self.moving
            along = amplitudes[[*own]]
            parts.append(sweep_block(structure, omega, along, state, self.settings, poll))
            state = end_of(parts[-1], -1)
        return joined(parts)


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
