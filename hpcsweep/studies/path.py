"""Paths: the forcing and the structure at each value of one parameter.

A path leads along the amplitude unless the job says otherwise, at each frequency as it is. Along
another parameter (``sweep.along``), or where a formula ties frequency or amplitude to it, every
step has a frequency, an amplitude and a structure of its own. A run depends on these and on
what the run before it has left: states at phase 0 of the forcing, carried along as they are,
whatever changes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.keys import Key
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
    limiting=True,
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
