"""Branches of periodic orbits through all motions of results files, along one parameter.

A *line* is where all but the parameter is fixed: along the amplitude there is one for each forcing
frequency of the job, along the frequency one for each amplitude, along a number of the structure
one for each pair. A line is a run and a task of its own: its seeds are the periodic motions that
the files have on it. Each is taken in turn, in the order of the files; one that lies on a branch
found before is told so, of any other the branch is followed. Then follow the branches that leave
these, and, if the job has starts, those of orbits that a search finds
(`hpcsweep.dynamics.continuation.catalogue`, `.search`). So the numbers of branches depend on the
files and the job alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from hpcsweep.dynamics.continuation.forced import FORCING_PARAMETERS, PARAMETERS, check_parameter
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.branches.seeds import Where
from hpcsweep.studies.branches.tally import BranchTally
from hpcsweep.studies.branches.variables import (
    COMMIT,
    LINE_AMPLITUDE,
    LINE_OMEGA,
    RUN,
    VARIABLES,
)
from hpcsweep.studies.independent import IndependentRuns
from hpcsweep.studies.study import Amplitudes, Block, Coordinate, Variable
from hpcsweep.studies.variables import numbered

START = "branches"
MOST = {"steps": 100_000, "max_branches": 10_000, "max_points": 10_000_000, "max_seeds": 10_000_000}
MOST_STARTS = 1_000_000
SPECIALS_SHARE = 8
"""Points of branches, as stored, to one special point."""
MIN_OMEGA = 1e-4
AGAIN = 5
"""Points of branches that `validate` computes again."""


@dataclass(frozen=True, eq=False)
class Branches(IndependentRuns):
    """Branches along a parameter, a line a task; see `RunGrid`, whose frames are the lines.

    Attributes
    ----------
    seeds : tuple of str
        Results files.
    parameter : str
    span : (float, float)
        Its lowest and highest value.
    steps : int
        Most points of a branch on either side of the orbit by which it is found.
    largest_step : float
        Between neighbouring points: in units of the state, and of the span.
    max_branches, max_points, max_seeds : int
        Room of a line; of special points an eighth of `max_points`.
    starts, seed : int
        Starts of the search for further orbits, and the seed of their sequence.
    """

    seeds: tuple[str, ...]
    parameter: str
    span: tuple[float, float]
    steps: int = 2000
    largest_step: float = 0.05
    max_branches: int = 64
    max_points: int = 20_000
    max_seeds: int = 4000
    starts: int = 0
    seed: int = 0

    kind: ClassVar[str] = "branches"
    task_noun: ClassVar[str] = "line"
    why_whole: ClassVar[str] = (
        "branches of a line are told apart in the order in which they are found"
    )
    words: ClassVar[dict[str, str]] = {START: "branches through the motions of files"}
    direction_name: ClassVar[str] = "what is followed"
    keys: ClassVar[dict] = {
        "branches": (
            *("seeds", "parameter", "span", "steps", "largest_step", "max_branches"),
            *("max_points", "max_seeds", "starts", "seed"),
        ),
        "sweep": ("omega", "frequency", "amplitude"),
    }
    default_block: ClassVar[int] = 1
    frame_dim: ClassVar[str] = "line"
    run_dims: ClassVar[tuple[str, ...]] = RUN
    commit: ClassVar[Variable] = COMMIT
    carried: ClassVar[tuple[str, ...]] = ()
    holds: ClassVar[str] = "branches"
    point_dim: ClassVar[str] = "step"
    status_variables: ClassVar[tuple[str, ...]] = ("n_branches", "n_seeds", "n_covered")

    @classmethod
    def read(cls, values, **common) -> "Branches":
        """Read seeds, parameter, span and limits; see `RunGrid.read`."""
        structure, settings = common["structure"], common["settings"]
        if settings.solver != "flow":
            limit = 'must be "flow": branches need exact tangent maps'
            raise values.error("solver.method", settings.solver, limit)
        if common["block_size"] != 1:
            given = values.get("output.block")
            raise values.error("output.block", given, "must be 1, each line a block")
        parameter = values.get("branches.parameter", "amplitude")
        if parameter not in PARAMETERS:
            limit = f"must be one of {', '.join(PARAMETERS)}"
            raise values.error("branches.parameter", parameter, limit)
        _check_parameter(values, structure, parameter)
        omega = values.frequencies("sweep.omega")
        amplitude = values.amplitudes("sweep.amplitude")
        span = _span(values, parameter, omega, amplitude)
        lines = _lines(parameter, omega, amplitude, span)
        common["settings"] = replace(settings, metrics=frozenset(), classify_cycles=None)
        return cls(
            omega=lines[0],
            amplitude=lines[1],
            directions=(START,),
            seeds=_seeds(values),
            parameter=parameter,
            span=span,
            largest_step=_largest_step(values, cls.largest_step),
            starts=values.whole("branches.starts", cls.starts, 0, MOST_STARTS),
            seed=values.whole("branches.seed", cls.seed, 0, 2**62),
            **{
                name: values.whole(f"branches.{name}", getattr(cls, name), 1, most)
                for name, most in MOST.items()
            },
            **common,
        )

    @property
    def followed(self) -> list[str]:
        """What is followed, and from where, in words."""
        low, high = self.span
        return [
            f"branches:   along {self.parameter} from {low:.6g} to {high:.6g}, through the "
            f"periodic motions of {', '.join(self.seeds)}"
        ]

    def where(self, line: int) -> Where:
        """Return of which motions of the files the seeds of a line are."""
        omega, amplitude = float(self.omega[line]), float(self.amplitude[line])
        along = {self.parameter: self.span}
        return Where(
            self.structure,
            along.get("omega", (omega, omega)),
            along.get("amplitude", (amplitude, amplitude)),
        )

    @property
    def n_amplitudes(self) -> int:
        """Runs of one line."""
        return 1

    def amplitudes_of(self, frame: int) -> np.ndarray:
        """Return the amplitude of a line; along the amplitude the highest, shape (1,)."""
        return self.amplitude[frame : frame + 1]

    @cached_property
    def variables(self) -> list[Variable]:
        """Variables of the lines, in the order of the file."""
        return list(VARIABLES)

    @property
    def dimensions(self) -> dict[str, int]:
        """Size of every dimension."""
        n = self.structure.n_floors
        return super().dimensions | {
            "branch": self.max_branches,
            "step": self.max_points,
            "special": max(self.max_points // SPECIALS_SHARE, 1),
            "seed": self.max_seeds,
            "number": 2 * n,
        }

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        size = self.dimensions
        coordinates = super().coordinates | {
            "line": numbered(self.omega.size, "line along the parameter"),
            "amplitude": Coordinate(np.array([np.nan]), LINE_AMPLITUDE.units, "see the line's"),
            "branch": numbered(size["branch"], "branch, in the order found"),
            "step": numbered(size["step"], "point of a branch, branch after branch"),
            "special": numbered(size["special"], "special point, branch after branch"),
            "seed": numbered(size["seed"], "periodic motion of the files"),
            "number": numbered(size["number"], "multiplier, largest modulus first", first=1),
        }
        del coordinates["omega"], coordinates["mode"]
        return coordinates

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Frequency and amplitude of each line, NaN where it is the parameter."""
        told = {"omega": (LINE_OMEGA, self.omega), "amplitude": (LINE_AMPLITUDE, self.amplitude)}
        return [
            (variable, np.full_like(values, np.nan) if name == self.parameter else values)
            for name, (variable, values) in told.items()
        ]

    def rows(
        self,
        frame: int,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Follow the branches of a line."""
        # here, where orbits are computed: who only reads them loads no kernel
        from hpcsweep.studies.branches.runs import line_of

        del amplitudes, state
        return line_of(self, frame, poll)

    def time_runs(
        self, share: float, along: float, n_runs: int, poll: Callable[[], None] | None = None
    ) -> tuple[tuple[int, float], int, float]:
        """Time one line."""
        del along, n_runs
        place, _, seconds = super().time_runs(share, 0.0, 0, poll)
        return place, 1, seconds

    def motions(self, run: dict[str, np.ndarray]) -> list[dict[str, Any]]:
        """Return points of branches, evenly over all, as runs that ended in them.

        Each tells the parameter's value there: ``omega``, ``amplitude`` or ``structure``.
        """
        held = np.flatnonzero(run["step_branch"])
        chosen = held[np.linspace(0, held.size - 1, min(AGAIN, held.size)).astype(int)]
        period = dict(zip(run["branch_id"].tolist(), run["branch_period"].tolist(), strict=True))
        return [
            {
                **self._placed_at(float(run["value"][step])),
                "final_state": run["point"][step],
                "orbit_period": np.int32(period[int(run["step_branch"][step])]),
                "skip_rule": np.int8(SkipRule.NEWTON),
                "contact": run["contact"][step],
                "drift": run["drift"][step],
            }
            for step in chosen.tolist()
        ]

    def _placed_at(self, value: float) -> dict[str, Any]:
        if self.parameter in FORCING_PARAMETERS:
            return {self.parameter: value}
        changed: dict[str, Any] = {self.parameter: value}
        return {"structure": replace(self.structure, **changed)}

    def count(self, done: np.ndarray, runs: dict[str, np.ndarray]) -> dict[str, Any]:
        """Count branches, and the seeds that lie on them."""
        return {name: int(runs[name][done].sum()) for name in self.status_variables}

    def tally(self) -> Any:
        """Make what counts the lines for ``summary``."""
        return BranchTally(self)

    def check(self, block: Block, rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
        """Return what is not as every line promises: row and what is wrong there."""
        from hpcsweep.studies.branches.invariants import broken_invariants

        return broken_invariants(self, rows)

    def describe_task(self, task: int) -> str:
        """Describe a line by what is fixed on it."""
        values = {"omega": ("Omega", self.omega), "amplitude": ("A", self.amplitude)}
        fixed = [one for name, one in values.items() if name != self.parameter]
        return ", ".join(f"{symbol} = {each[task]:.6g}" for symbol, each in fixed)


def _seeds(values) -> tuple[str, ...]:
    given = values.get("branches.seeds")
    listed = given if isinstance(given, list) else [given]
    if not listed or not all(isinstance(one, str) and one for one in listed):
        raise values.error("branches.seeds", given, "must be a results file, or a list of them")
    return tuple(listed)


def _check_parameter(values, structure: Structure, parameter: str) -> None:
    """Refuse a number that the structure does not have as one."""
    try:
        check_parameter(structure, parameter)
    except ValueError as error:
        raise values.error("branches.parameter", parameter, str(error)) from None


def _span(values, parameter: str, omega: np.ndarray, amplitude: np.ndarray) -> tuple[float, float]:
    """Read the span; default, along A and Omega, that of the job's own."""
    own = {"omega": omega, "amplitude": amplitude}.get(parameter, np.empty(0))
    default = [float(own.min()), float(own.max())] if own.size > 1 else None
    given = values.get("branches.span", default)
    if not isinstance(given, list) or len(given) != 2:
        raise values.error("branches.span", given, "must be [low, high]")
    low, high = (values.number("branches.span", one) for one in given)
    if not -1e200 <= low < high <= 1e200:
        raise values.error("branches.span", given, "must have low below high, both at most 1e200")
    least = {"omega": MIN_OMEGA}.get(parameter, 0.0)
    if low < least:
        raise values.error("branches.span", given, f"{parameter} must be at least {least:g}")
    return low, high


def _lines(parameter: str, omega: np.ndarray, amplitude: np.ndarray, span) -> np.ndarray:
    """Return frequency and amplitude of each line, the parameter's at the end of its span."""
    ends = np.array(span[1:])
    first = ends if parameter == "omega" else omega
    second = ends if parameter == "amplitude" else amplitude
    return np.array([each.ravel() for each in np.meshgrid(first, second, indexing="ij")])


def _largest_step(values, default: float) -> float:
    value = values.number("branches.largest_step", values.get("branches.largest_step", default))
    if not 0 < value <= 1:
        raise values.error("branches.largest_step", value, "must lie above 0, at most 1")
    return value
