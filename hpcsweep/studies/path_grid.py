"""Base of studies each frame of which is a path: along the amplitude, or any other parameter.

A path leads along the amplitude unless the job says otherwise, at each frequency as it is. Along
another parameter (``sweep.along``), or where a formula ties frequency or amplitude to it, every
step has a frequency, an amplitude and a structure of its own. A run depends on these and on
what the run before it has left: states at phase 0 of the forcing, carried along as they are,
whatever changes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Block, Place, Poll, Rows, joined
from hpcsweep.studies.grid import DOWN, RunGrid
from hpcsweep.studies.keys import Key
from hpcsweep.studies.report import MAX_FRAMES, Driven
from hpcsweep.studies.run_names import run_name
from hpcsweep.studies.study import Lines
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import AMPLITUDE, OMEGA, numbered

FORCING = {"omega": OMEGA, "amplitude": AMPLITUDE}
"""Unit and long name of what drives each step."""
ALONG = Key(
    "along",
    'parameter along which states are carried from run to run: `"amplitude"`, `"omega"`, or a '
    "key of structure, pounding or `building[0]` whose values `[vary]` has "
    "([how](studies.md#sweeps-along-other-parameters))",
    "amplitude",
)


@dataclass(frozen=True)
class Tie:
    """A formula that gives the frequency or the amplitude.

    Attributes
    ----------
    name : {"omega", "amplitude"}
    text : str
        The formula, written in one way.
    of : callable
        Takes numbers by their names, also of those that it does not use; NaN where it has no value.
    """

    name: str
    text: str
    of: Callable[..., float] = field(compare=False, repr=False)

    @property
    def meaning(self) -> tuple:
        """What identifies it."""
        return self.name, self.text

    @property
    def words(self) -> str:
        """The formula in words."""
        return f"{self.name} = {self.text}"


class Followed(NamedTuple):
    """A key along which a path leads, its ascending values, and the structure at each."""

    name: str
    key: str
    units: str
    values: np.ndarray
    structures: tuple[Structure, ...] = ()


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps of paths, the same number in each frame.

    Attributes
    ----------
    along : Followed
    frame : str
        Dimension of the frames: what has a value in each, ``omega`` or ``amplitude``, or ``frame``
        where formulas tie both.
    frames : ndarray, shape (n_frames,)
        These values.
    omega, amplitude : ndarray, shape (n_frames, n_along)
    ties : tuple of str
        The formulas, in words.
    """

    along: Followed
    frame: str
    frames: np.ndarray
    omega: np.ndarray
    amplitude: np.ndarray
    ties: tuple[str, ...] = ()

    @property
    def meaning(self) -> tuple:
        """What identifies the runs, however the formulas are written."""
        return self.along, self.frame, self.frames, self.omega, self.amplitude

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of the dimensions of frames and steps."""
        name, key, units, values, _ = self.along
        frames = numbered(1, "path")
        if self.frame in FORCING:
            frames = Coordinate(self.frames.astype("<f8"), *FORCING[self.frame])
        along = FORCING.get(name, (units, key))
        return {self.frame: frames, name: Coordinate(values.astype("<f8"), *along)}

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Frequency and amplitude of each step, where they are no dimension."""
        dims = self.frame, self.along.name
        return [
            (Variable(name, dims, "<f8", *words), getattr(self, name))
            for name, words in FORCING.items()
            if name not in dims
        ]

    @property
    def words(self) -> str:
        """The path in words."""
        values = self.along.values
        text = f"along {self.along.key} from {values[0]:.6g} to {values[-1]:.6g}"
        return ", ".join([text, *self.ties])


def read_ties(values: Any, along: str, what: str) -> dict[str, str]:
    """Return the formulas of frequency and amplitude; of what a path is along there is none."""
    table = values.table("sweep")
    ties = {name: table[name] for name in FORCING if isinstance(table.get(name), str)}
    if along in ties:
        raise values.error(f"sweep.{along}", ties[along], f"must be numbers: {what} along it")
    return ties


def read_path(values: Any, followed: Followed | None) -> Steps | None:
    """Read the paths of a job; None along the amplitude, each at one frequency.

    Parameters
    ----------
    values : hpcsweep.job.values.Values
    followed : Followed, optional
        Of a key of the structure.
    """
    along = followed.name if followed else values.get("sweep.along", ALONG.default)
    ties = read_ties(values, along, "the sweep is")
    if along == ALONG.default and not ties:
        return None
    numbers = {name: values.forcing(name) for name in FORCING if name not in ties}
    if followed is None:
        column = numbers.pop(along)
        if np.any(np.diff(column) <= 0):
            raise values.error(
                f"sweep.{along}", column.tolist(), "must ascend: the sweep is along it"
            )
        followed = Followed(along, f"sweep.{along}", FORCING[along][0], column)
    several = [name for name, column in numbers.items() if column.size > 1]
    if len(several) > 1:
        limit = f"must be one number or a formula along {along} where sweep.omega has several"
        raise values.error("sweep.amplitude", numbers["amplitude"].tolist(), limit)
    frame = [*several, *numbers, "frame"][0]
    frames = numbers.get(frame, np.zeros(1))
    shape = frames.size, followed.values.size
    columns = {along: np.broadcast_to(followed.values, shape)}
    columns |= {name: np.broadcast_to(column[:, None], shape) for name, column in numbers.items()}
    for name, text in ties.items():
        columns[name] = values.tied(f"sweep.{name}", text, columns)
    words = tuple(f"{name} = {text}" for name, text in ties.items())
    omega, amplitude = (np.ascontiguousarray(columns[name]) for name in FORCING)
    return Steps(followed, frame, frames, omega, amplitude, words)


@dataclass(frozen=True, eq=False)
class PathGrid(RunGrid):
    """A grid each frame of which is a path: up, then down if that is a direction too.

    Attributes
    ----------
    steps : Steps, optional
        Where the paths lead, if not along the amplitude at each frequency. `omega` and `amplitude`
        are then the values that occur, ascending.
    """

    steps: Steps | None = None

    by_frame: ClassVar[bool] = True

    @staticmethod
    def read_grid(values: Any, followed: Followed | None) -> dict[str, Any]:
        """Read the fields that say where the paths of a job lead."""
        if steps := read_path(values, followed):
            forcing = {name: np.unique(getattr(steps, name)) for name in FORCING}
            return {"steps": steps, **forcing}
        return {name: values.forcing(name) for name in FORCING}

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some frames."""
        if self.steps is None:
            return {"omega": self.omega[frames]}
        arrays = {name: getattr(self.steps, name)[frames] for name in ("frames", *FORCING)}
        forcing = {name: np.unique(arrays[name]) for name in FORCING}
        return {"steps": replace(self.steps, **arrays), **forcing}

    @property
    def grid_fields(self) -> tuple[str, ...]:  # type: ignore[override]
        """Fields that say which runs there are; none where each has a structure of its own."""
        fields = "omega", "amplitude", "directions", "block_size", "steps"
        return fields if len(self.structures) == 1 else ()

    @property
    def run_dims(self) -> tuple[str, ...]:  # type: ignore[override]
        """Dimensions of a run."""
        return ("direction", *self.grid)

    @property
    def grid(self) -> dict[str, Coordinate]:
        """Values of the dimensions of the frames, and of the runs of a frame."""
        return self.steps.coordinates if self.steps else super().grid

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
        return super().describe(run) | {self.run_dims[-1]: float(self.along_of(run[1])[run[2]])}

    def describe_task(self, task: int) -> str:
        """Describe a frame by its frequency, or its amplitude."""
        name = self.run_dims[-2]
        return run_name({name: float(self.frames[task])}) if name in FORCING else "the path"

    @property
    def path_steps(self) -> list[Driven]:  # type: ignore[override]
        """Steps along the paths; of many some."""
        if self.steps is None:
            return []
        name, n = self.run_dims[-1], self.n_frames * self.n_along
        some = np.unique(np.linspace(0, n - 1, min(n, MAX_FRAMES)).astype(int)).tolist()
        at = [divmod(number, self.n_along) for number in some]
        omega, amplitude, values = self.steps.omega, self.steps.amplitude, self.steps.along.values
        return [
            Driven(name, values[k], self.structure_at(k), omega[frame, k], amplitude[frame, k])
            for frame, k in at
        ]

    def lines(self) -> Lines:
        """Tell the path, and what drives the structure along it."""
        if self.steps:
            yield "path", f"{self.steps.words}; {self.carries} at phase 0 of the forcing"
        yield from super().lines()

    carries: ClassVar[str]
    """What runs leave to the next ones, in words."""

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute consecutive runs, each from what the previous one has left."""
        amplitudes, omegas = self.amplitudes_of(frame), self.omegas_of(frame).tolist()
        several = len(self.structures) > 1  # out of reach of one, a contact may be hit by another
        parts: list[Rows] = []
        for (omega, at), stretch in groupby(places.tolist(), lambda k: (omegas[k], k * several)):
            structure = self.structure_at(at) if several else self.moving
            runs = self.runs_of(structure, omega)
            parts.append(runs.follow(amplitudes[[*stretch]], state, poll))
            state = self.end_state(parts[-1], -1)
        return joined(parts)

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
