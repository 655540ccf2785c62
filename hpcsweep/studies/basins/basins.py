"""Study of basins of attraction at one point (A, Omega), on a slice of the initial states.

Two components of the state run over a grid; the others are those of `initial_state`. A row of the
grid is a run and a task of its own, so that a slice scales to as many ranks as it has rows.

Starts are classified by attractors that are found first, from a low-discrepancy sequence of starts
on the same slice (`hpcsweep.dynamics.basins`). Each process finds them itself: they depend only on
the job, and so does each row.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from hpcsweep.dynamics.shares import starts_needed
from hpcsweep.dynamics.starts import usual_reach
from hpcsweep.studies.attractors.search import attractors_as_runs, read_limits
from hpcsweep.studies.basins.tally import BasinTally
from hpcsweep.studies.basins.variables import COMMIT, ORDINATE, ROW_OMEGA, RUN, basin_variables
from hpcsweep.studies.independent import IndependentRuns
from hpcsweep.studies.study import Amplitudes, Block, Coordinate, Variable
from hpcsweep.studies.variables import numbered

START = "slice"
SPAN = 200
"""Values of either component, from minus to plus the usual reach, unless a job gives them."""
MOST_COLUMNS = 100_000
MOST_STATE = 1e200


@dataclass(frozen=True, eq=False)
class Basins(IndependentRuns):
    """Basins on a slice, a row a task; see `RunGrid`, which holds one frequency for each row.

    Attributes
    ----------
    components : tuple of two int
        Components of the state along a row, and from row to row.
    horizontal, vertical : ndarray
        Values of the components, ascending; one row for each value of `vertical`.
    starts, seed : int
        Starts on the slice from which the attractors are found, and the seed of their sequence.
    max_attractors : int
        Most attractors listed: those that most starts reach.
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    """

    components: tuple[int, int]
    horizontal: np.ndarray
    vertical: np.ndarray
    starts: int = starts_needed(0.01, 0.01)
    seed: int = 0
    max_attractors: int = 8
    max_cycles: int = 5000

    kind: ClassVar[str] = "basins"
    task_noun: ClassVar[str] = "row"
    why_whole: ClassVar[str] = "a row of starts is one run, which cannot be cut"
    words: ClassVar[dict[str, str]] = {START: "each start on its own"}
    direction_name: ClassVar[str] = "where starts lie"
    keys: ClassVar[dict] = {
        "study": (
            "components",
            "horizontal",
            "vertical",
            "starts",
            "seed",
            "max_attractors",
            "max_cycles",
        ),
        "sweep": ("omega", "frequency", "amplitude"),
    }
    default_block: ClassVar[int] = 1
    frame_dim: ClassVar[str] = "row"
    run_dims: ClassVar[tuple[str, ...]] = RUN
    commit: ClassVar[Variable] = COMMIT
    carried: ClassVar[tuple[str, ...]] = ()
    holds: ClassVar[str] = "basins"
    point_dim: ClassVar[str] = "column"
    status_variables: ClassVar[tuple[str, ...]] = ("n_undecided", "n_failed", "n_elsewhere")

    @classmethod
    def read(cls, values, **common) -> "Basins":
        """Read the point, the slice and the limits; see `RunGrid.read`."""
        structure, settings = common["structure"], common["settings"]
        limits = read_limits(values, cls, "basins")
        if common["block_size"] != 1:
            given = values.get("output.block")
            raise values.error("output.block", given, "must be 1, each row a block")
        point = values.frequencies("sweep.omega"), values.amplitudes("sweep.amplitude")
        for key, found in zip(("sweep.omega", "sweep.amplitude"), point, strict=True):
            if found.size != 1:
                raise values.error(key, values.get(key), "must be one number: basins of one point")
        metrics = frozenset(settings.metrics) | {"lyapunov"}
        common["settings"] = replace(settings, metrics=metrics, classify_cycles=None)
        components = _components(values, structure.n_floors)
        reach = usual_reach(structure)
        horizontal, vertical = (
            _span(values, f"study.{name}", float(reach[component]))
            for name, component in zip(("horizontal", "vertical"), components, strict=True)
        )
        if horizontal.size > MOST_COLUMNS:
            limit = f"must have at most {MOST_COLUMNS} values"
            raise values.error("study.horizontal", values.get("study.horizontal"), limit)
        return cls(
            omega=np.full(vertical.size, point[0][0]),
            amplitude=point[1],
            directions=(START,),
            components=components,
            horizontal=horizontal,
            vertical=vertical,
            **limits,
            **common,
        )

    @property
    def starting_range(self) -> dict[str, tuple[int, float, float]]:
        """Component and range of the slice."""
        n, told = self.structure.n_floors, {}
        for k, values in zip(self.components, (self.horizontal, self.vertical), strict=True):
            name = f"u_{k + 1}" if k < n else f"v_{k - n + 1}"
            told[f"{name}, {values.size} values"] = (k, float(values[0]), float(values[-1]))
        return told

    @property
    def starting_states(self) -> np.ndarray:
        """A state at least as far out as any of the slice."""
        state = np.array(self.initial_state)
        first, second = self.components
        state[first] = np.abs(self.horizontal).max()
        state[second] = np.abs(self.vertical).max()
        return state[None]

    @property
    def polls_per_run(self) -> int:
        """Return the number of starts of a row."""
        return self.horizontal.size

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the rows, in the order of the file."""
        return basin_variables(self.settings)

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""
        own = {"column": self.horizontal.size, "attractor": self.max_attractors}
        return super().dimensions | own

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        coordinates = super().coordinates | {
            "row": numbered(self.vertical.size, "row of starts"),
            "attractor": numbered(self.max_attractors, "attractor, by falling share"),
            "column": Coordinate(
                self.horizontal, ORDINATE.units, "first component of a row's starts"
            ),
        }
        del coordinates["omega"]
        return coordinates

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Variables that are known in advance, with their values."""
        return [(ROW_OMEGA, self.omega), (ORDINATE, self.vertical)]

    def names(self) -> tuple[str, str]:
        """Names of the components of the slice."""
        names = self.coordinates["state"].values
        first, second = self.components
        return str(names[first]), str(names[second])

    def rows(
        self,
        frame: int,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Return the attractors that the starts of a row reach."""
        # imported here: reading results needs no kernels
        from hpcsweep.studies.basins.runs import Slice, slice_runs

        del amplitudes, state
        shape = Slice(
            self.components,
            (float(self.horizontal[0]), float(self.horizontal[-1])),
            (float(self.vertical[0]), float(self.vertical[-1])),
            tuple(self.initial_state.tolist()),
            self.starts,
            self.seed,
            self.max_attractors,
            self.max_cycles,
        )
        point = float(self.omega[frame]), float(self.amplitude[0])
        runs = slice_runs(self.moving, *point, self.settings, shape)
        return runs.row(self.horizontal, float(self.vertical[frame]), poll)

    def motions(self, run: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
        """Return the attractors listed by a row as motions in which runs ended."""
        return attractors_as_runs(self.variables, run)

    def count(self, done: np.ndarray, runs: dict[str, np.ndarray]) -> dict[str, Any]:
        """Count the starts, and those that reached none of the listed attractors."""
        good = done & (runs["outcome"] > 0)
        starts = int(good.sum()) * self.horizontal.size
        return {
            "starts": starts,
            "periods_per_start": float(runs["cycles"][good].sum()) / starts if starts else None,
            "starts_undecided": int(runs["n_undecided"][good].sum()),
            "starts_failed": int(runs["n_failed"][good].sum()),
            "starts_elsewhere": int(runs["n_elsewhere"][good].sum()),
        }

    def tally(self) -> Any:
        """Return a tally of rows for ``summary``."""
        return BasinTally(self)

    def check(self, block: Block, rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
        """Return the broken invariants of rows: (row, message)."""
        from hpcsweep.studies.basins.invariants import broken_invariants

        return broken_invariants(self, rows)

    def describe_task(self, task: int) -> str:
        """Describe a row by its value of the component."""
        return f"{self.names()[1]} = {self.vertical[task]:.6g}"


def _components(values, n: int) -> tuple[int, int]:
    """Read the two components of the slice."""
    names = [f"{letter}_{i}" for letter in "uv" for i in range(1, n + 1)]
    given = values.get("study.components", ["u_1", "v_1"])
    known = isinstance(given, list) and len(given) == 2 and all(one in names for one in given)
    if not known or given[0] == given[1]:
        limit = f"must be two of {names[0]} .. {names[n - 1]}, {names[n]} .. {names[-1]}"
        raise values.error("study.components", given, limit)
    return names.index(given[0]), names.index(given[1])


def _span(values, key: str, reach: float) -> np.ndarray:
    """Read the values of a component, ascending, two or more."""
    if not values.has(key):
        return np.linspace(-reach, reach, SPAN)
    found = values.numbers(key, ascending=True)
    if found.size < 2 or not np.abs(found).max() <= MOST_STATE:
        limit = f"must have two values or more, at most {MOST_STATE:g}"
        raise values.error(key, values.get(key), limit)
    return found
