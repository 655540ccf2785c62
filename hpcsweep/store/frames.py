"""Read one frame at a time, for files that do not fit in memory."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.job import part_of
from hpcsweep.job.paths import path_of
from hpcsweep.model import arguments
from hpcsweep.store.commit import Blocks
from hpcsweep.store.inferred import Inferred, frame_variables
from hpcsweep.store.layout import StoreError
from hpcsweep.store.opening import open_layout
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import Axis, as_kind
from hpcsweep.studies.variable import Variable

MAX_TOLD = 20
"""Most values of an axis that an error lists."""
NEAR_ENOUGH = 1e-5
"""Relative tolerance of a requested value: as rounded in figures and messages."""


class Frames:
    """Read single frames of a campaign file, only blocks whose checksum holds.

    Parameters
    ----------
    path : str or Path
    content : str or tuple of str, optional
        What the file must hold (`Study.content`), or one of several; None: anything.
    at : mapping of str to number or str, optional
        Value of each axis of a job that varies keys; the nearest is chosen, by default the first.

    Attributes
    ----------
    job : Job
        The job the file was made for; of one that varies keys, the job of the part that is read.
    whole : Job
        The job the file was made for.
    place : tuple of int
        Of the part that is read.
    at : dict
        The value of each key that the job varies.
    given : tuple of str
        The keys of `at` as it was given.

    Raises
    ------
    StoreError
        If it is not a campaign file, or holds something else, or does not vary what `at` names.
    """

    def __init__(
        self,
        path: str | Path,
        content: str | tuple[str, ...] | None = "motions",
        at: Mapping[str, float | str] | None = None,
    ):
        self.path = path_of("path", path)
        self._layout = open_layout(self.path)
        self.whole = self._layout.job
        self._blocks = Blocks(self.path, self._layout)
        self.given = tuple(at or ())
        try:
            self.choose(_place_of(self.path, self.whole.study.axes, at or {}))
            accepted = (content,) if isinstance(content, str) else content
            if accepted is not None and self.study.content not in accepted:
                held = f'{self.study.content} (study.kind = "{self.study.kind}")'
                raise StoreError(
                    f"{self.path}: holds {held} where {' or '.join(accepted)} are needed; "
                    "hpcsweep plot FILE draws it"
                )
        except BaseException:
            self.close()
            raise

    def choose(self, place: Place) -> None:
        """Select the part of the job at an index of the varied axes."""
        self.place = place
        self.job = part_of(self.whole, place)
        self.study = self.job.study
        axes = self.whole.study.axes
        self.at = {axis.name: axis.values[at] for axis, at in zip(axes, place, strict=True)}
        is_whole = self.study is self.whole.study
        self._own = self._layout if is_whole else self._layout.of(self.job, place)
        self._variables = {v.name: v for v in (*self._own.variables, *frame_variables(self._own))}

    @property
    def part(self) -> str:
        """Return the selected part as text; empty where the job varies no key."""
        return self.whole.study.describe_part(self.place)

    @property
    def places(self) -> list[Place]:
        """Return the indices of all parts of the job; one if it varies no key."""
        return list(np.ndindex(*(len(axis.values) for axis in self.whole.study.axes)))

    def __contains__(self, variable: str) -> bool:
        return variable in self._variables

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the variables of a run."""
        return iter(sorted(self._variables))

    @property
    def variables(self) -> list[Variable]:
        """The variables of a run, in the order of the file."""
        return [*self._variables.values()]

    def parts(self) -> Iterator[dict[str, Any]]:
        """Select one after the other the parts of the given `at`, and yield the values of its keys.

        Of keys that vary together, also those of their columns.
        """
        axes, chosen = self.whole.study.axes, self.place
        asked = [i for i, axis in enumerate(axes) if axis.name in self.given]
        for place in self.places:
            if all(place[i] == chosen[i] for i in asked):
                self.choose(place)
                pairs = list(zip(axes, place, strict=True))
                yield {k.name: k.values[i] for axis, i in pairs for k in (axis, *axis.columns)}

    def close(self) -> None:
        """Close the file."""
        self._blocks.close()

    def read(self, frame: int, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Read variables of one frame: first axes (direction, amplitude), of records (scale,).

        Runs without valid commit hold what `open_results` gives them: 0 or NaN. A variable that
        the file does not hold is a `StoreError`.
        """
        frame = self._frame(frame)
        for name in arguments.words("names", names):
            if name not in self:
                raise StoreError(
                    f"{self.path}: holds no {name}: set output.{name} = true in the job"
                )
        rows_of: dict[str, np.ndarray] = {}
        for name in names:
            variable = self._variables[name]
            shape = list(self._own.shape(variable))
            del shape[self._axis]
            rows_of[name] = np.full(shape, variable.missing, variable.dtype)
        derived = [v.name for v in frame_variables(self._own) if v.name in names]
        for task in self._begun(frame):
            for block, valid in self._blocks.verify(task):
                at = list(block.runs[len(self.place) :])
                if at.pop(self._axis) == frame and valid:
                    for name in names:
                        if name not in derived:
                            rows = self._blocks.read_rows(name, block.first, block.n_runs)
                            rows_of[name][tuple(at)] = rows
        if derived:
            inferred = self._inferred.frame((*self.place, 0, frame)) or {}
            for name in derived:
                rows_of[name][0] = inferred.get(name, rows_of[name][0])
        return rows_of

    def audit(self) -> dict:
        """Return ``runs_inferred`` and ``audit`` (a `Look`) of a refined map; of others nothing."""
        return self._inferred.summary(self._inferred.mask()) if self._layout.derived else {}

    @cached_property
    def _inferred(self) -> Inferred:
        return Inferred(self._blocks)

    def _begun(self, frame: int) -> list[int]:
        """Return the tasks with a block of a frame that has a checksum, ascending."""
        *shape, n_blocks, tasks = *self._own.shape(self._own.commit), set()
        for before in np.ndindex(*shape[: self._axis]):
            place = (*self.place, *before, frame)
            stored = self._blocks.read_rows("commit", (*place, 0), n_blocks)
            numbers = np.flatnonzero(stored).tolist()
            tasks |= {self.whole.study.block((*place, number)).task for number in numbers}
        return sorted(tasks)

    def _frame(self, frame: int) -> int:
        return arguments.count("frame", frame, 0, self.study.n_frames - 1)

    @property
    def _axis(self) -> int:
        """Axis of the frames in a run's variables."""
        return len(self.study.run_dims) - 2

    def dataset(self, frame: int):
        """Read one frame as an xarray.Dataset.

        As of `open_results`, with one `omega`; of the attributes only `job` and `name`.
        """
        return self.gather([*self._variables], [frame])

    def _dataset(self, frames: Sequence[int], arrays: dict, directions: slice = slice(None)):
        """Make a dataset of arrays of some frames and their coordinates."""
        import xarray

        study, layout = self.study, self._own
        frame_dim, last = study.run_dims[-2:]
        chosen: dict[str, Any] = {frame_dim: list(frames), "direction": directions}
        fixed = {
            variable.name: (
                variable.dims,
                values[chosen.get(variable.dims[0], slice(None))],
                layout.notes(variable),
            )
            for variable, values in layout.given
        }
        for name in arrays.keys() & self._variables.keys():
            arrays[name] = (*arrays[name], layout.notes(self._variables[name]))
        coordinates = {}
        for name, (values, units, long_name) in layout.coordinates.items():
            values = values[chosen.get(name, slice(None))]
            if name == last == "amplitude" and len(frames) == 1:
                # the amplitudes of one frame are its own even where frames share none
                values = as_kind(study, RunGrid).amplitudes_of(frames[0])
            values = values.astype(str) if values.dtype == object else values
            coordinates[name] = name, values, {"units": units, "long_name": long_name}
        del coordinates["block"]
        # frequency and amplitude of each run, where they are no dimension
        steps = {name: fixed.pop(name) for name in ("omega", "amplitude") if name in fixed}
        return xarray.Dataset(
            {**fixed, **arrays},
            coords=steps | coordinates,
            attrs={"job": self.job.text, "name": self.job.name, "part": self.part},
        )

    def gather(
        self,
        names: Sequence[str],
        frames: Sequence[int] | None = None,
        direction: str | None = None,
        derive: Mapping[str, Callable] | None = None,
    ):
        """Gather a few variables of many frames, with one whole frame in memory at a time.

        Parameters
        ----------
        names : sequence of str
            Variables to keep; those that the file does not hold are left out.
        frames : sequence of int, optional
            Default all.
        direction : str, optional
            Keep only this direction.
        derive : mapping of str to callable, optional
            New variables: functions from a frame's dataset (all variables and directions) to an
            array of axes (direction, omega, amplitude).

        Returns
        -------
        xarray.Dataset
            As from `dataset`, with all `frames`.
        """
        study = self.study
        names = arguments.words("names", names)
        if frames is None:
            frames = range(study.n_frames)
        elif not isinstance(frames, Sequence | np.ndarray):
            raise arguments.refused("frames", "a sequence of whole numbers", frames)
        frames = [self._frame(frame) for frame in frames]
        kept = [v for v in self.variables if v.name in names]
        axes = {v.name: v.dims for v in kept} | dict.fromkeys(derive or {}, study.run_dims)
        chosen = slice(None)
        if direction is not None:
            place = study.directions.index(
                arguments.choice("direction", direction, study.directions)
            )
            chosen = slice(place, place + 1)
        arrays: dict[str, np.ndarray] = {}
        axis = self._axis
        for place, frame in enumerate(frames):
            read = self.read(frame, tuple(v.name for v in kept))
            if derive:
                dataset = self.dataset(frame)
                read |= {n: np.take(function(dataset), 0, axis) for n, function in derive.items()}
            for name, values in read.items():
                values = values[chosen] if axis else values
                if name not in arrays:
                    arrays[name] = np.empty((len(frames), *values.shape), values.dtype)
                arrays[name][place] = values
        moved = {n: (axes[n], np.moveaxis(values, 0, axis)) for n, values in arrays.items()}
        return self._dataset(frames, moved, chosen)


class Grid:
    """The frames of a file over the values along any of them, amplitudes, say, in ascending order.

    Frames of one frequency are one row: a list of points becomes a grid with runs that are not
    computed. Where all frames have the same amplitudes nothing changes but their order.

    Parameters
    ----------
    frames : Frames

    Attributes
    ----------
    rows : ndarray, shape (n_rows,)
        Frequencies, or what else the frames have; ascending.
    along : ndarray, shape (n_along,)
        Amplitudes, or what else the sweeps are along; ascending.
    """

    def __init__(self, frames: Frames):
        self._study = study = as_kind(frames.study, RunGrid)
        self._frames = frames
        self.rows = np.unique(study.frames)
        each = [study.along_of(frame) for frame in range(study.n_frames)]
        self.along = np.unique(np.concatenate(each))

    def dataset(self, row: int):
        """Read one row as `Frames.dataset` reads a frame."""
        frames = np.flatnonzero(self._study.frames == self.rows[row]).tolist()
        parts = [self._frames.dataset(frame) for frame in frames]
        missing = {variable.name: variable.missing for variable in self._frames.variables}
        last = self._study.run_dims[-1]
        whole = parts[0].reindex({last: self.along}, fill_value=missing)
        for part in parts[1:]:
            for name in missing:
                whole[name].loc[{last: part[last]}] = part[name]
        return whole


def _place_of(path: Path, axes: Sequence[Axis], at: Mapping[str, float | str]) -> Place:
    """Return the index of values on the varied axes; the first value where none is given."""
    names = [axis.name for axis in axes]
    for name in at:
        if name not in names:
            there = f"it varies {', '.join(names)}" if names else "it varies no key"
            raise StoreError(f"{path}: {name} = {at[name]}: {there}")
    return tuple(_nearest(path, axis, at[axis.name]) if axis.name in at else 0 for axis in axes)


def _nearest(path: Path, axis: Axis, value: float | str) -> int:
    """Return the index of a value on an axis."""
    if isinstance(value, bool):
        value = str(value).lower()
    if value in axis.values:
        return axis.values.index(value)
    if not isinstance(axis.values[0], str) and not isinstance(value, str):
        nearest = min(axis.values, key=lambda number: abs(number - value))
        if math.isclose(nearest, value, rel_tol=NEAR_ENOUGH):
            return axis.values.index(nearest)
    there = ", ".join(x if isinstance(x, str) else f"{x:.6g}" for x in axis.values[:MAX_TOLD])
    raise StoreError(f"{path}: {axis.name} = {value}: must be one of {there}")
