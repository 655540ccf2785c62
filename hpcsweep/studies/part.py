"""Base of studies without varied keys: each is its own only part (`hpcsweep.studies.vary`)."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Block, Path, Place, Poll, Rows, Say
from hpcsweep.studies.invariants import Broken, listed, of_each
from hpcsweep.studies.keys import Tables
from hpcsweep.studies.refinement import Refinement
from hpcsweep.studies.seeds import Reader
from hpcsweep.studies.study import Axis
from hpcsweep.studies.variable import Coordinate, Variable


class Part(ABC):
    """A study of the values of one job: its runs are independent unless it says otherwise.

    Runs stand along the last of their axes, in each frame and, if there are any, each direction.
    They are cut into blocks of `block_size`, in ascending order; block b of a descending direction
    holds as many, counted from the top.
    """

    structure: Structure
    initial_state: np.ndarray
    block_size: int
    directions: tuple[str, ...]

    kind: ClassVar[str]
    summary: ClassVar[str]
    """What is computed, in a line."""
    run_noun: ClassVar[str] = "run"
    keys: ClassVar[Tables]
    """Keys of job files, by table, of this study alone."""
    without: ClassVar[tuple[str, ...]] = ()  # tables of which it knows its own keys alone
    default_block: ClassVar[int] = 1
    run_dims: ClassVar[tuple[str, ...]]
    carried: ClassVar[tuple[str, ...]] = ()
    checksum: ClassVar[str] = "checksum of a block"
    """Long name of `commit`."""
    by_frame: ClassVar[bool] = False
    """Whether a frame is a task, as a path is; else each block is one."""
    is_list: ClassVar[bool] = False
    grid_fields: ClassVar[tuple[str, ...]] = ()
    axes: ClassVar[tuple[Axis, ...]] = ()
    starts_at_rest: ClassVar[bool] = False
    recurs: ClassVar[bool] = True
    """Whether its motions must recur, which no motion does that nothing confines."""
    n_parts: ClassVar[int] = 1
    polls_per_run: ClassVar[int] = 1
    """Least number of calls of `poll` in a run."""
    starting_range: ClassVar[dict[str, tuple[int, float, float]]] = {}
    """Component and range of drawn or gridded starts, by name; empty if there are none."""
    map_axes: ClassVar[dict[str, np.ndarray]] = {}
    """Values of the axes of a map that may be refined, by key of the job."""
    slots: ClassVar[Mapping[str, str]] = {}
    """See `hpcsweep.studies.invariants.of_each`."""
    refine: Refinement | None = None
    """Which points of its map are computed; None: all."""

    def cut(self, _frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some frames; empty where they depend on others."""
        return {}

    @property
    def commit(self) -> Variable:
        """Checksums of the blocks, which cut the last of the dimensions of a run."""
        return Variable("commit", (*self.run_dims[:-1], "block"), "<u8", "1", self.checksum)

    @property
    def structures(self) -> tuple[Structure, ...]:
        """The structure of each run of a frame, or of all of them."""
        return (self.structure,)

    def structure_at(self, at: int) -> Structure:
        """Return the structure of a run of a frame."""
        return self.structures[at % len(self.structures)]

    def units_at(self, omega: float, amplitude: Any, at: int = 0) -> np.ndarray:
        """Return the units of states, `Structure.units_at`, of a run of a frame."""
        return self.structure_at(at).units_at(omega, amplitude)

    @property
    @abstractmethod
    def n_frames(self) -> int:
        """Number of frames."""

    @property
    @abstractmethod
    def n_along(self) -> int:
        """Number of runs of one frame and direction."""

    @abstractmethod
    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute the runs of a frame at places along its last axis, in this order.

        They start from the present state of their path.
        """

    @property
    @abstractmethod
    def of_run(self) -> list[Variable]:
        """Variables of a run, in the order of the file; their dimensions those of its values."""

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the runs, in the order of the file."""
        return [variable.along(self.run_dims) for variable in self.of_run]

    @property
    @abstractmethod
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""
        return {name: coordinate.values.size for name, coordinate in self.coordinates.items()}

    @abstractmethod
    def relations(self, block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken in runs, by what should be so."""

    def check(self, block: Block, rows: Rows) -> list[tuple[int, str]]:
        """Return the broken invariants of runs: (row, message)."""
        each = of_each(self.variables, rows, self.structure, self.slots)
        return listed(each | self.relations(block, rows))

    @property
    def n_blocks(self) -> int:
        """Number of blocks of one frame and direction."""
        return -(-self.n_along // self.block_size)

    @property
    def n_tasks(self) -> int:
        """Number of tasks of the study."""
        last = len(self.directions) - 1, self.n_frames - 1, self.n_blocks - 1
        return int(self.task_of(*last)) + 1

    @property
    def n_runs(self) -> int:
        """Number of runs of all frames and directions."""
        return max(len(self.directions), 1) * self.n_frames * self.n_along

    def task_of(self, *place):
        """Return the task of blocks, numbers or arrays of their places."""
        return place[-2] if self.by_frame else place[-2] * self.n_blocks + place[-1]

    def path(self, task: int) -> Sequence[Block]:
        """Return the blocks of a task in the order of computation, direction after direction."""
        if not self.by_frame:
            return Path(1, lambda _: self.block((0, *divmod(task, self.n_blocks))))

        def block(position: int) -> Block:
            direction, number = divmod(position, self.n_blocks)
            return self.block((direction, task, number)[-len(self.run_dims) :])

        return Path(max(len(self.directions), 1) * self.n_blocks, block)

    def descends(self, _direction: int) -> bool:
        """Return whether the runs of a direction are computed in descending order."""
        return False

    def block(self, place: Place) -> Block:
        """Return the block with an index in ``commit``: direction, frame, number along the path."""
        *outer, number = place
        descends = self.descends(outer[0])
        begin, end = number * self.block_size, (number + 1) * self.block_size
        if descends:
            begin, end = self.n_along - end, self.n_along - begin
        low, high = max(begin, 0), min(end, self.n_along)
        return Block(int(self.task_of(*place)), place, (*outer, low), high - low, descends)

    def compute(self, block: Block, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute a block from the present state of its path; rows in file order."""
        *_, frame, low = block.first
        result = self.runs_at(frame, np.arange(low, low + block.n_runs)[block.order], state, poll)
        return {name: np.ascontiguousarray(values[block.order]) for name, values in result.items()}

    def compute_run(self, block: Block, row: int, state: np.ndarray) -> Rows:
        """Compute one run alone from a state."""
        *_, frame, at = block.run(row)
        return self.runs_at(frame, np.array([at]), state)

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the state from which the run after one of the rows starts."""
        return rows["final_state"][row] if self.carried else self.initial_state

    def predecessor(self, _block: Block, _row: int) -> Place | None:
        """Return None: every run is independent."""
        return None

    @abstractmethod
    def kernels(self, n_ranks: float | None = None) -> list[Any]:
        """Return the kernels that its runs call.

        With `n_ranks`, of all of its runs on that many ranks, or that share of one: where it pays,
        those specialised to the structure.
        """

    def is_compiled(self, n_ranks: float | None = None) -> bool:
        """Return whether the cache holds its `kernels`."""
        from hpcsweep.kernels.compile.warm import missing

        return not missing(self.kernels(n_ranks))

    def warm_up(self, say: Say = None, n_ranks: float | None = None) -> None:
        """Compile its `kernels`, or load them from disk."""
        from hpcsweep.studies.compilation import load

        load(self.kernels(n_ranks), say)

    def with_reader(self, _reader: Reader) -> Self:
        """Return the study itself, whose runs start from no motions of files."""
        return self

    def missing_inputs(self) -> str:
        """Return nothing."""
        return ""

    def describe_part(self, _place: Place) -> str:
        """Return nothing, as there are no `axes`."""
        return ""

    def part(self, _place: Place) -> Self:
        """Return the study itself, as there are no `axes`."""
        return self

    def part_of(self, block: Block) -> tuple[Self, Block]:
        """Return the part to which a block belongs, and the block with its index there."""
        return self, block
