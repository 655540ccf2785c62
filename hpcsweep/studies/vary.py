"""A study at every value of further keys of its job, as ``[vary]`` requests.

The axes come first in every variable of the file, each with the values of its key. A point of the
axes is a *part*: the study of the job with these values, made when needed and cached. Its runs do
not depend on other parts, so the tasks of all parts are tasks of the whole, and a part's results
are equal, to the last bit, to those of a job of its own.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from hpcsweep.model.unit_names import is_in_gaps, unit_of
from hpcsweep.studies.blocks import Block, Path, Place, Poll, Rows, Say, Timed
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.run_names import written
from hpcsweep.studies.seeds import Reader
from hpcsweep.studies.study import Axis, Contents, Description, RunAgain, Work
from hpcsweep.studies.variable import Coordinate, Variable, real

PARTS_KEPT = 1000
"""Parts that a process keeps, 20 kB each: many ranks take tasks of any of them, costliest first."""


@dataclass(frozen=True, eq=False)
class Varied:
    """A study at each point of further axes; see `hpcsweep.studies.study.Study`.

    Parameters
    ----------
    base : RunGrid
        The part at the first value of every axis.
    axes : tuple of Axis
    make : callable
        Return the part at an index.
    reader : Reader, optional
        See `with_reader`.
    by_part : dict of str to (Variable, ndarray)
        Variables known beforehand in which parts differ, along the axes, by their names.
    """

    base: RunGrid
    axes: tuple[Axis, ...]
    make: Callable[[Place], RunGrid]

    reader: Reader | None = None
    by_part: dict[str, tuple[Variable, np.ndarray]] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute that all parts share, one of `SHARED`."""
        if name in SHARED and not name.startswith("_"):
            return getattr(self._first, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @cached_property
    def structure(self) -> Any:
        """Structure of the first part."""
        return self._first.structure

    @property
    def _first(self) -> RunGrid:
        return self.part((0,) * len(self.axes))

    @cached_property
    def _units(self) -> Any:
        """Structure in whose units all parts are told where some have units of their own."""
        at = tuple(self._in_other_units(i) for i in range(len(self.axes)))
        return _part(self.make, at).structure if any(at) else None

    def _in_other_units(self, i: int) -> int:
        """Return where on an axis a structure is not in units of its own; 0 if nowhere."""
        axis, rest = self.axes[i], (0,) * (len(self.axes) - i - 1)
        names = {column.key.rpartition(".")[2].partition("[")[0] for column in axis.keys}
        if names.isdisjoint(("gap", "gap_left", "p_delta")):
            return 0
        first = 0
        for k in range(len(axis.values)):
            at = (*(0,) * i, k, *rest)
            structure = (_part(self.make, at) if k else self.base).structure
            in_gaps = is_in_gaps(structure)
            if not structure.is_uniform or not (in_gaps or "p_delta" in names):
                return k
            first = first or k * (not in_gaps)
        return first

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def n_parts(self) -> int:
        """Number of parts."""
        return int(np.prod(self.shape, dtype=object))

    @property
    def n_tasks(self) -> int:
        """Number of tasks of all parts."""
        return self.n_parts * self.base.n_tasks

    @property
    def n_runs(self) -> int:
        """Number of runs of all parts."""
        return self.n_parts * self.base.n_runs

    @property
    def n_frames(self) -> int:
        """Number of frames of all parts."""
        return self.n_parts * self.base.n_frames

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the axes' dimensions."""
        return tuple(axis.name for axis in self.axes)

    @property
    def run_dims(self) -> tuple[str, ...]:
        """Dimensions of a run."""
        return self.names + self.base.run_dims

    @property
    def commit(self) -> Variable:
        """Checksums of the blocks."""
        return self.base.commit.along(self.names)

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the runs, in the order of the file."""
        return [variable.along(self.names) for variable in self.base.variables]

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance: those of all parts, and numbers of the rows."""
        shared = [self.by_part.get(each.name, (each, values)) for each, values in self.base.given]
        held = {each.name for each, _ in shared}
        return shared + [
            (
                real(column.name, (axis.name,), column.units, column.key, None),
                np.array(column.values, float),
            )
            for axis in self.axes
            for column in axis.columns
            if column.name not in held
            and not any(isinstance(value, str) for value in column.values)
        ]

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""
        return dict(zip(self.names, self.shape, strict=True)) | self.base.dimensions

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        return {axis.name: axis.coordinate for axis in self.axes} | self.base.coordinates

    def with_reader(self, reader: Reader) -> "Varied":
        """Return the study with what reads the results files that its runs start from."""
        return replace(self, base=self.base.with_reader(reader), reader=reader)

    def missing_inputs(self) -> str:
        """Return what these files do not hold though runs need it; '' if nothing."""
        if self.reader is None or self.base.with_reader(self.reader) is self.base:
            return ""  # it reads none
        return next(filter(None, (self.part(at).missing_inputs() for at in self.places())), "")

    def places(self) -> Sequence[Place]:
        """Return the indices of all parts, in task order."""
        return list(np.ndindex(*self.shape))

    def part(self, place: Place) -> RunGrid:
        """Return the study at an index of the axes."""
        part = _part(self.make, place, self._units)
        return part if self.reader is None else part.with_reader(self.reader)

    def part_of(self, block: Block) -> tuple[RunGrid, Block]:
        """Return the part to which a block belongs, and the block with its index there."""
        n = len(self.axes)
        part = self.part(block.place[:n])
        return part, part.block(block.place[n:])

    def block(self, place: Place) -> Block:
        """Return the block with an index in ``commit``."""
        n = len(self.axes)
        return self._outer(place[:n], self.base.block(place[n:]))

    def task_of(self, *place):
        """Return the task of blocks, numbers or arrays of their places."""
        number = 0
        for axis, index in zip(self.axes, place, strict=False):
            number = number * len(axis.values) + index
        return number * self.base.n_tasks + self.base.task_of(*place[len(self.axes) :])

    def path(self, task: int) -> Sequence[Block]:
        """Return the blocks of a task in the order of computation."""
        number, inner = divmod(task, self.base.n_tasks)
        at = self._place(number)
        path = self.base.path(inner)
        return Path(len(path), lambda position: self._outer(at, path[position]))

    def predecessor(self, block: Block, row: int) -> Place | None:
        """Return the index of the run from whose end state a run starts; None: `initial_state`."""
        n = len(self.axes)
        before = self.base.predecessor(self.base.block(block.place[n:]), row)
        return None if before is None else block.place[:n] + before

    def compute(self, block: Block, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute a block from the present state of its path; rows in file order."""
        part, inner = self.part_of(block)
        return part.compute(inner, state, poll)

    def check(self, block: Block, rows: Rows) -> list[tuple[int, str]]:
        """Return the broken invariants of runs: (row, message)."""
        part, inner = self.part_of(block)
        return part.check(inner, rows)

    def time_runs(self, share: float, along: float, n_runs: int, poll: Poll = None) -> Timed:
        """Time a few runs of a frame of a part; frames are counted through all parts."""
        number, frame = divmod(int(share * self.n_frames), self.base.n_frames)
        part = self.part(self._place(number))
        inside = (frame + 0.5) / part.n_frames
        (frame, middle), timed, seconds = part.time_runs(inside, along, n_runs, poll)
        return (number * self.base.n_frames + frame, middle), timed, seconds

    def describe(self, run: Place) -> dict[str, Any]:
        """Describe a run: the value of each axis, ``direction``, ``omega``, ``amplitude``."""
        n = len(self.axes)
        return self.part(run[:n]).describe(run[n:]) | self.values_at(run[:n])

    def values_at(self, place: Place) -> dict[str, Any]:
        """Return the value of each axis at a place."""
        return {axis.name: axis.values[at] for axis, at in zip(self.axes, place, strict=True)}

    def run_again(self, block: Block, row: int, run: dict, start: np.ndarray) -> RunAgain:
        """Compute a complete stored run again, another way."""
        part, inner = self.part_of(block)
        return part.run_again(inner, row, run, start)

    def describe_task(self, task: int) -> str:
        """Describe a task by the values of the axes and its description in its part."""
        number, inner = divmod(task, self.base.n_tasks)
        return f"{self.describe_part(self._place(number))}, {self.base.describe_task(inner)}"

    def describe_part(self, place: Place) -> str:
        """Describe a part by the values of the axes, with units that have names."""
        structure = self.base.structure
        named = any(structure.unit_names)
        return ", ".join(
            f"{axis.name} = {written(axis.values[at])}"
            + (f" {unit_of(structure, axis.units)}" if named and axis.units != "1" else "")
            for axis, at in zip(self.axes, place, strict=True)
        )

    def is_compiled(self, n_ranks: float | None = None) -> bool:
        """Return whether the cache holds the kernels of all parts."""
        return all(part.is_compiled(self._share(n_ranks)) for part in self._parts_by_kernels())

    def warm_up(self, say: Say = None, n_ranks: float | None = None) -> None:
        """Compile the kernels of all parts, or load them from disk."""
        for part in self._parts_by_kernels():
            part.warm_up(say, self._share(n_ranks))

    def _share(self, n_ranks: float | None) -> float | None:
        """Return the share of the ranks that each part has."""
        return None if n_ranks is None else n_ranks / self.n_parts

    def _parts_by_kernels(self) -> Iterator[RunGrid]:
        """Iterate over parts that together call all kernels."""
        several = [any(_picks_kernels(key.key) for key in axis.keys) for axis in self.axes]
        shape = [len(a.values) if picks else 1 for a, picks in zip(self.axes, several, strict=True)]
        return map(self.part, np.ndindex(*shape))

    def _place(self, number: int) -> Place:
        # for each task of millions: a tenth of the time of `unravel_index`
        place: Place = ()
        for axis in reversed(self.axes):
            number, at = divmod(number, len(axis.values))
            place = (at, *place)
        return place

    def _outer(self, at: Place, block: Block) -> Block:
        """Return a block of a part with its index in the whole."""
        task = int(self.task_of(*at, *block.place))
        return Block(task, at + block.place, at + block.first, block.n_runs, block.descending)


SHARED = frozenset((*vars(Work), *vars(Contents), *vars(Description)))
"""The interface of a study: what a `Varied` does not define all of its parts have in common."""


def shape_of(part: RunGrid) -> tuple:
    """Return what parts that share a file have in common, and what is known of each beforehand."""
    return part.structure.contact_labels, part.variables, part.coordinates, part.given


def difference(base: tuple, part: tuple) -> str:
    """Return why two parts, by `shape_of`, cannot share a file; '' where they can."""
    labels, variables, coordinates, known_first = base
    same = [("set of contacts", part[0] == labels), ("list of variables", part[1] == variables)]
    for name, coordinate in coordinates.items():
        same += [(name, name in part[2] and _equal(part[2][name].values, coordinate.values))]
    for (variable, before), (_, values) in zip(known_first, part[3], strict=False):
        alike = variable.by_part or _equal(before, values)
        same += [(variable.name, alike and before.shape == values.shape)]
    other = next((name for name, is_same in same if not is_same), "")
    return f"has another {other} than the first" * bool(other)


def _equal(first: np.ndarray, second: np.ndarray) -> bool:
    """Return whether values of a dimension are the same; NaN, of none, equals NaN."""
    return np.array_equal(first, second, equal_nan=first.dtype.kind == "f")


@lru_cache(maxsize=PARTS_KEPT)
def _part(make: Callable[[Place], RunGrid], place: Place, units: Any = None) -> RunGrid:
    made = make(place)
    if units is None:
        return made
    return replace(made, structure=made.structure.labelled(in_units_of=units))


def _picks_kernels(key: str) -> bool:
    """Return whether values of a key may need kernels that others do not: solvers, dashpots."""
    return key.startswith("solver.") or key.endswith(("restitution", "damping", "sharpness"))
