"""Points (A, Omega) on their own, each from the job's initial state: a grid, or a list of pairs.

A list has one frame a point, and one amplitude a frame, held by `forcing_amplitude`. Each block of
points is a task, one point unless the job sets larger blocks, so that a study scales to as many
ranks as it has points.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.refinement import REFINE, Refinement, read_refinement
from hpcsweep.studies.sweep.runs import FrameRuns, frame_runs
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import AMPLITUDE

FORCING_AMPLITUDE = Variable("forcing_amplitude", ("omega",), "<f8", *AMPLITUDE)

POINTS = Key(
    "points",
    "list of pairs [A, Omega], in place of `sweep.omega` and `sweep.amplitude`; of branches along "
    "a number of the structure",
)


def read_points(values) -> tuple[np.ndarray, np.ndarray]:
    """Read the frequencies and amplitudes of the list of points of a job, or of its axes."""
    if not values.has("study.points"):
        return values.forcing("omega"), values.forcing("amplitude")
    for key in ("sweep.omega", "sweep.amplitude"):
        if values.has(key):
            raise values.error(
                key, values.get(key), "must not be given beside study.points, a list of points"
            )
    pairs = values.get("study.points")
    limit = "must be a list of pairs [A, Omega]"
    amplitude, omega = values.pairs("study.points", pairs, pairs, limit).T
    wrong = ~(np.isfinite(amplitude) & np.isfinite(omega) & (amplitude >= 0) & (omega > 0))
    if wrong.any():
        first = pairs[int(np.argmax(wrong))]
        raise values.error("study.points", first, "must have A of at least 0, Omega above 0")
    values.check_range("study.points", omega=omega, amplitude=amplitude)
    if np.unique(np.stack((amplitude, omega)), axis=1).shape[1] < len(pairs):
        raise values.error("study.points", pairs, "must not hold a point twice")
    return omega.copy(), amplitude.copy()


@dataclass(frozen=True, eq=False)
class PointGrid(RunGrid):
    """Points on their own, of a grid or a list; see `RunGrid`.

    Attributes
    ----------
    listed : bool
        Whether `omega` and `amplitude`, of one length, are a list of pairs.
    refine : Refinement, optional
        Which points of the grid are computed; default all.
    """

    listed: bool = False
    refine: Refinement | None = None

    grid_fields: ClassVar[tuple[str, ...]] = (
        "omega",
        "amplitude",
        "listed",
        "block_size",
        "refine",
    )

    @classmethod
    def of(cls, values, **common) -> Self:
        """Read the points of a job, a grid or a list, beside its other fields."""
        omega, amplitude = read_points(values)
        return cls(omega=omega, amplitude=amplitude, listed=values.has("study.points"), **common)

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some frames; none of a map that is refined as a whole."""
        listed = {"amplitude": self.amplitude[frames]} if self.listed else {}
        return {} if self.refine else {"omega": self.omega[frames], **listed}

    @property
    def is_list(self) -> bool:  # type: ignore[override]
        """Whether every frame has one amplitude of its own."""
        return self.listed

    @property
    def n_along(self) -> int:
        """Number of runs of one frame: 1 in a list."""
        return 1 if self.listed else self.amplitude.size

    def amplitudes_of(self, frame: int) -> np.ndarray:
        """Return the amplitudes of a frame, ascending, shape (n_along,)."""
        return self.amplitude[frame : frame + 1] if self.listed else self.amplitude

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension; the frames of a list share no amplitudes."""
        values = super().coordinates
        if self.listed:
            values["amplitude"] = Coordinate(np.array([np.nan]), *AMPLITUDE)
        return values

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        return super().given + ([(FORCING_AMPLITUDE, self.amplitude)] if self.listed else [])


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
