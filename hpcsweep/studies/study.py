"""Interfaces of a study: what differs between studies, and nothing else.

A study is cut into independent tasks, and each task into blocks, which are computed in order along
the task's path and committed one by one. A block is a stretch of runs; each block starts from the
state at the end of the previous one.

`store` creates the file from a study's variables and verifies its blocks, `campaign` hands its
tasks to ranks, `checks` has its runs recomputed; none of them knows which study it is. A new study
is a module in this folder and an entry in `hpcsweep.studies.kinds`.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.studies.blocks import Block, Place, Poll, Rows, Say, Timed
from hpcsweep.studies.refinement import Refinement
from hpcsweep.studies.seeds import Reader
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import Coordinate, Variable

ROWS = "rows"
"""Key of ``vary`` whose rows, one a structure, each have a value of several keys."""
Lines = Iterator[tuple[str, str]]
"""What users are told: names and texts."""


@dataclass(frozen=True)
class Axis:
    """Values of a varied key of the job, or of keys that vary together; a dimension of the file.

    Attributes
    ----------
    name : str
        Name of the dimension.
    key : str
        ``TABLE.KEY`` of job files; `ROWS` of keys that vary together.
    values : tuple of int, of float or of str
        As the file holds them; others, such as true, as they are written in TOML.
    units : str
    given : tuple
        As the job holds them.
    columns : tuple of Axis
        Of keys that vary together, each with a value a row, which may recur.
    """

    name: str
    key: str
    values: tuple[Any, ...]
    units: str
    given: tuple[Any, ...]
    columns: tuple["Axis", ...] = ()

    @property
    def keys(self) -> "tuple[Axis, ...]":
        """The keys that vary, each with its values."""
        return self.columns or (self,)

    @property
    def coordinate(self) -> Coordinate:
        """The values as stored in the file."""
        types: dict[type, Any] = {int: "<i8", float: "<f8", str: object}
        return Coordinate(np.array(self.values, types[type(self.values[0])]), self.units, self.key)


@dataclass
class RunAgain:
    """Result of recomputing one run.

    Attributes
    ----------
    at : str
        Which run.
    solver : str
        The other solver.
    omega, amplitude : float
        Of a motion.
    orbit_period : int
        0 of what is no orbit.
    compared : str
        What was compared with it.
    difference, allowed : float or None
        Largest difference of a point (in units of the state), and the allowed one; None if nothing
        could be compared.
    whole_run : str
        Outcome of the whole run by ``flow``: ``equal`` to the last bit, ``same`` within the
        allowed difference, ``other`` points.
    problem : str
        '' if there is none.
    """

    at: str
    solver: str
    omega: float = 0.0
    amplitude: float = 0.0
    orbit_period: int = 0
    compared: str = ""
    difference: float | None = None
    allowed: float | None = None
    whole_run: str = ""
    problem: str = ""


class Work(Protocol):
    """What a study computes: tasks, each a path of blocks, in any order and on any rank.

    A block's results are arrays by variable name, first axis its runs in file order.
    """

    @property
    def n_tasks(self) -> int:
        """Number of tasks."""

    @property
    def n_runs(self) -> int:
        """Number of runs."""

    @property
    def n_frames(self) -> int:
        """Sweeps over the last axis, of each direction."""

    @property
    def block_size(self) -> int:
        """Most runs of a block."""

    @property
    def polls_per_run(self) -> int:
        """Times that a run calls its `poll`, at least."""

    @property
    def initial_state(self) -> np.ndarray:
        """State from which the first run of every task starts, shape (2n,)."""

    @property
    def carried(self) -> tuple[str, ...]:
        """Variables that hold the start of the next run."""

    def path(self, task: int) -> Sequence[Block]:
        """Return the blocks of a task in the order of computation."""

    def block(self, place: Place) -> Block:
        """Return the block with an index in ``commit``."""

    def task_of(self, *place):
        """Return the task of blocks, numbers or arrays of their places."""

    def descends(self, direction: int, /) -> bool:
        """Return whether the runs of a direction are computed in descending order."""

    def with_reader(self, reader: Reader) -> "Study":
        """Return the study with what reads the results files that its runs start from.

        Without it no run is computed that starts from a motion of a file.
        """

    def missing_inputs(self) -> str:
        """Return what these files do not hold though runs need it; '' if nothing."""

    def predecessor(self, block: Block, row: int) -> Place | None:
        """Return the index of the run from whose end state a run starts; None: `initial_state`."""

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the state from which the run after one of the rows starts.

        Made of the variables `carried`: the end state, or whatever else the study carries along its
        path; a finite one-dimensional array, stored completely in the file.
        """

    def compute(self, block: Block, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute a block from the present state of its path."""

    def check(self, block: Block, rows: Rows) -> list[tuple[int, str]]:
        """Return the broken invariants of runs: (row, message)."""

    def time_runs(self, share: float, along: float, n_runs: int, poll: Poll = None) -> Timed:
        """Time a few runs, for the pilot, at a share of the tasks' frames and along their axis."""

    def run_again(self, block: Block, row: int, run: dict, start: np.ndarray) -> RunAgain:
        """Compute a complete stored run again, another way."""

    def is_compiled(self, n_ranks: float | None = None) -> bool:
        """Return whether the cache is known to hold all that its runs call; see `warm_up`."""

    def warm_up(self, say: Say = None, n_ranks: float | None = None) -> None:
        """Compile, or load from disk, all that its runs call.

        With `n_ranks`, for all of its runs on that many ranks, or that share of one: where it
        pays, kernels are specialised to the structure.
        """

    @property
    def settings(self) -> SweepSettings:
        """How runs are computed."""

    def part_of(self, block: Block) -> tuple["Study", Block]:
        """Return the part to which a block belongs, and the block with its index there."""


class Contents(Protocol):
    """What a study's file holds: variables along axes, by name."""

    @property
    def kind(self) -> str:
        """Name in job files."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Keys that are varied, the first dimensions of the file; see `hpcsweep.studies.vary`."""

    @property
    def run_dims(self) -> tuple[str, ...]:
        """Dimensions of a run: ..., the frames, and the runs of a frame."""

    @property
    def directions(self) -> tuple[str, ...]:
        """Values of the dimension ``direction``; empty if runs have none."""

    @property
    def commit(self) -> Variable:
        """Checksums of the blocks."""

    @property
    def structure(self) -> Structure:
        """Structure, that of the first part."""

    @property
    def structures(self) -> tuple[Structure, ...]:
        """The structure of each run of a frame, or of all of them."""

    def structure_at(self, at: int) -> Structure:
        """Return the structure of a run of a frame."""

    def units_at(self, omega: float, amplitude: Any, at: int = 0) -> np.ndarray:
        """Return the units of states, `Structure.units_at`, of a run of a frame."""

    @property
    def variables(self) -> list[Variable]:
        """Variables of the runs, in the order of the file."""

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""

    @property
    def n_parts(self) -> int:
        """Number of points of `axes`."""

    def part(self, place: Place) -> "Study":
        """Return the study at an index of `axes`: the study itself where there are none."""

    @property
    def grid_fields(self) -> tuple[str, ...]:
        """Fields that say which runs there are; empty where a run depends on all of the job."""

    @property
    def refine(self) -> Refinement | None:
        """Which points of its map are computed, round by round; None: all."""

    @property
    def map_axes(self) -> dict[str, np.ndarray]:
        """Values of the axes of its map, by key of the job."""

    @property
    def content(self) -> str:
        """``motions``, one a run, ``attractors``, several, or ``responses`` to records."""

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:
        """Component and range of drawn or gridded starts, by name; empty if there are none."""

    @property
    def is_list(self) -> bool:
        """Whether each frame has one amplitude of its own."""

    @property
    def starts_at_rest(self) -> bool:
        """Whether runs start from static equilibrium, whatever `initial_state` is."""


class Description(Protocol):
    """What users are told of a study and of its runs."""

    def describe_part(self, place: Place) -> str:
        """Describe a part by the values of `axes`; empty where there are none."""

    @property
    def run_noun(self) -> str:
        """Noun for a run."""

    @property
    def status_variables(self) -> tuple[str, ...]:
        """Variables of `count`."""

    def lines(self) -> Lines:
        """Tell, before anything is computed, what drives the structure."""

    def warnings(self) -> Iterable[str]:
        """Return one line for each thing there that looks like a mistake."""

    def describe(self, run: Place) -> dict[str, Any]:
        """Describe a run by its dimensions: ``record``, ``scale``, say; the values of `axes`."""

    def describe_task(self, task: int) -> str:
        """Describe a task by its frequency and other properties."""

    def motions(self, run: Rows) -> list[dict[str, Any]]:
        """Return the motions of a run, each as the variables of a run of a sweep.

        One that is not at the run's own place has its ``omega``, ``amplitude`` or ``structure``.
        """

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count, for ``status``, what only this kind of study reports.

        Parameters
        ----------
        done : ndarray of bool, shape of the runs
        runs : dict of str to ndarray
            The variables `status_variables`, ``outcome`` and ``cycles``.
        """

    def tally(self) -> Any:
        """Return a tally of runs for ``summary``; see `hpcsweep.studies.tally.BaseTally`."""


class Study(Work, Contents, Description, Protocol):
    """A study: each of its users asks one part of it alone."""


Kind = TypeVar("Kind")


def as_kind(study: object, kind: type[Kind]) -> Kind:
    """Return a study that is known to be of a kind."""
    assert isinstance(study, kind)
    return study
