"""Branches of periodic orbits through all motions of results files, along one parameter.

A *line* is where all but the parameter is fixed: along the amplitude there is one for each forcing
frequency of the job, along the frequency one for each amplitude, along a number of the structure
one for each pair. A line is a run and a task of its own: its seeds are the periodic motions that
the files have on it. Each is taken in turn, in the order of the files; one that lies on a branch
found before gets its number, of any other the branch is followed. Then follow the branches that
leave these, and, if the job has starts, those of orbits that a search finds
(`hpcsweep.dynamics.continuation.catalogue`, `.search`). So the numbers of branches depend on the
files and the job alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from hpcsweep.dynamics.continuation.forced import FORCING_PARAMETERS
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Block, Poll, Rows
from hpcsweep.studies.branches import variables
from hpcsweep.studies.branches.keys import CHECKED, KEYS, BranchGrid, read_lines
from hpcsweep.studies.branches.tally import BranchTally
from hpcsweep.studies.invariants import Broken, misnumbered
from hpcsweep.studies.keys import OMEGA, Tables
from hpcsweep.studies.points import POINTS
from hpcsweep.studies.seeds import Reader, Seeds, Where
from hpcsweep.studies.study import Lines
from hpcsweep.studies.variable import Coordinate, Variable
from hpcsweep.studies.variables import numbered

START = "branches"
SPECIALS_SHARE = 8
"""Points of branches, as stored, to one special point."""
ROUNDING = 1e-9
AGAIN = 5
"""Points of branches that `validate` computes again."""


@dataclass(frozen=True, eq=False)
class Branches(BranchGrid):
    """Branches along a parameter, a line a task; see `BranchGrid`.

    Attributes
    ----------
    reader : callable, optional
        Reads the results files; no part of what the study means.
    """

    reader: Reader | None = field(default=None, compare=False, repr=False)

    kind: ClassVar[str] = "branches"
    summary: ClassVar[str] = (
        "curves of periodic orbits, stable or not, through the motions of results files"
    )
    run_noun: ClassVar[str] = "line"
    words: ClassVar[dict[str, str]] = {START: "branches through the motions of files"}
    direction_name: ClassVar[str] = "what is followed"
    keys: ClassVar[Tables] = {"study": (POINTS,), "branches": KEYS, "sweep": OMEGA}
    without: ClassVar[tuple[str, ...]] = ("output",)
    run_dims: ClassVar[tuple[str, ...]] = variables.RUN
    always: ClassVar[frozenset[str]] = frozenset(["impacts"])
    """An orbit's signature counts them."""
    carried: ClassVar[tuple[str, ...]] = ()
    content: ClassVar[str] = "branches"
    point_dim: ClassVar[str] = "step"
    slots: ClassVar[Mapping[str, str]] = variables.SLOTS
    status_variables: ClassVar[tuple[str, ...]] = ("n_branches", "n_seeds", "n_covered")

    @classmethod
    def read(cls, values, **common) -> "Branches":
        """Read seeds, parameter, span and limits; see `RunGrid.read`."""
        structure, settings = common["structure"], common["settings"]
        if settings.solver != "flow":
            limit = 'must be "flow": branches need exact tangent maps'
            raise values.error("solver.method", settings.solver, limit)
        common["settings"] = replace(settings, metrics=frozenset(), classify_cycles=None)
        return cls(directions=(START,), **read_lines(values, structure), **common)

    @property
    def covered(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and amplitudes of the branches: of the parameter its span."""
        omega, amplitude = self.forcing(np.linspace(*self.span, CHECKED))
        return np.unique(omega), np.unique(amplitude)

    def lines(self) -> Lines:
        """Tell the ranges, and what is followed from where."""
        yield from super().lines()
        low, high = self.span
        through = f"through the periodic motions of {', '.join(self.seeds)}"
        along = f"along {self.parameter} from {low:.6g} to {high:.6g}"
        yield "branches", ", ".join([along, *self.ties, through])

    def cut(self, frames: slice) -> dict[str, Any]:
        """Return the fields of a study of some lines; none where strips lie between lines."""
        lines = {"omega": self.omega[frames], "amplitude": self.amplitude[frames]}
        return {} if self.curves else lines

    def where(self, line: int) -> Where:
        """Return of which motions of the files the seeds of a line are."""
        omega, amplitude = float(self.omega[line]), float(self.amplitude[line])
        along = dict.fromkeys(self.moves, (0.0, np.inf)) | {self.parameter: self.span}
        return Where(
            self.structure,
            along.get("omega", (omega, omega)),
            along.get("amplitude", (amplitude, amplitude)),
            self.given_by,
        )

    def with_reader(self, reader: Reader) -> Self:
        """Return the study with what reads the results files."""
        return replace(self, reader=reader)

    def seeds_of(self, line: int) -> Seeds:
        """Return the motions of the files from which the branches of a line are followed."""
        assert self.reader is not None
        return self.reader(self.seeds, self.where(line))

    def missing_inputs(self) -> str:
        """Return that no line has a seed; '' if one has."""
        if any(self.seeds_of(line).periodic for line in range(self.n_frames)):
            return ""
        low, high = self.span
        return (
            f"{', '.join(self.seeds)}: no periodic motion for {self.parameter} from {low:g} to "
            f"{high:g} at the frequencies and amplitudes of the job"
        )

    @property
    def n_along(self) -> int:
        """Runs of one line."""
        return 1

    def amplitudes_of(self, frame: int) -> np.ndarray:
        """Return the amplitude of a line; along the amplitude the highest, shape (1,)."""
        return self.amplitude[frame : frame + 1]

    @property
    def of_run(self) -> list[Variable]:
        """Variables of a line, see `Part.of_run`."""
        of_branches = variables.variables_of(self.structure)
        return [*of_branches, *(variables.CURVE_VARIABLES if self.curves else ())]

    @property
    def coordinates(self) -> dict[str, Coordinate]:
        """Values of every dimension."""
        n_special, n_met = (
            max(most // SPECIALS_SHARE, 1) for most in (self.max_points, self.max_curve_points)
        )
        coordinates = super().coordinates | {
            "line": numbered(self.omega.size, "line along the parameter"),
            "amplitude": Coordinate(np.array([np.nan]), "acceleration", "see the line's"),
            "branch": numbered(self.max_branches, "branch, in the order found"),
            "step": numbered(self.max_points, "point of a branch, branch after branch"),
            "special": numbered(n_special, "special point, branch after branch"),
            "seed": numbered(self.max_seeds, "periodic motion of the files"),
            "number": numbered(
                self.structure.state_units.size, "multiplier, largest modulus first", first=1
            ),
        }
        sizes = {"curve": self.max_curves, "curve_step": self.max_curve_points, "meeting": n_met}
        for name, most in sizes.items() if self.curves else ():
            coordinates[name] = numbered(most, f"{name}, of each curve in turn")
        del coordinates["omega"], coordinates["mode"]
        return coordinates

    @property
    def given(self) -> list[tuple[Variable, np.ndarray]]:
        """Frequency and amplitude of each line, NaN where they change along it."""
        lines = variables.LINE_OMEGA, variables.LINE_AMPLITUDE
        rows = zip(FORCING_PARAMETERS[::-1], lines, (self.omega, self.amplitude), strict=True)
        return [
            (variable, np.full_like(values, np.nan) if name in self.moves else values)
            for name, variable, values in rows
        ]

    def runs_at(self, frame: int, places: np.ndarray, state: np.ndarray, poll: Poll = None) -> Rows:
        """Follow the branches of a line."""
        # here, where orbits are computed: who only reads them loads no kernel
        from hpcsweep.studies.branches.runs import line_of

        return line_of(self, frame, self.seeds_of(frame), poll)

    def motions(self, run: Rows) -> list[dict[str, Any]]:
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
        varied: dict[str, Any] = {self.parameter: value}
        tied: dict[str, Any] = {name: of(**varied) for name, of in self.given_by.items()}
        if self.parameter in FORCING_PARAMETERS:
            return tied | varied
        return tied | {"structure": replace(self.structure, **varied)}

    def count(self, done: np.ndarray, runs: Rows) -> dict[str, Any]:
        """Count branches, and the seeds that lie on them."""
        return {name: int(runs[name][done].sum()) for name in self.status_variables}

    def kernels(self, n_ranks: float | None = None) -> list[Any]:
        """Return the kernels that its runs call; see `Part.kernels`."""
        from hpcsweep.solvers.flow.specialised import branch_kernels

        return super().kernels(n_ranks) + branch_kernels(self.structure)

    def tally(self) -> BranchTally:
        """Make what counts the lines for ``summary``."""
        return BranchTally(self)

    def relations(self, _block: Block, rows: Rows) -> Broken:
        """Return where relations between variables are broken; see `Part.relations`."""
        broken = {**_of_branches(rows), **_of_points(self.span, rows), **_of_seeds(rows)}
        return broken | (_of_curves(self, rows) if self.curves else {})

    def describe_task(self, task: int) -> str:
        """Describe a line by what is fixed on it."""
        values = {"omega": ("Omega", self.omega), "amplitude": ("A", self.amplitude)}
        fixed = [pair for name, pair in values.items() if name not in self.moves]
        return ", ".join(f"{symbol} = {each[task]:.6g}" for symbol, each in fixed) or "the line"


def _of_branches(rows: Rows) -> Broken:
    ids = rows["branch_id"]
    held = ids > 0
    return {
        "branches are numbered from 1": misnumbered(ids),
        "n_branches counts them": held.sum(axis=1) != rows["n_branches"],
        "a branch leaves one found before it": (held & (rows["parent"] >= ids)).any(axis=1),
    }


def _of_points(span: tuple[float, float], rows: Rows) -> Broken:
    branch, value = rows["step_branch"], rows["value"]
    held = branch > 0
    with np.errstate(invalid="ignore"):
        size = np.hypot(rows["multiplier_real"], rows["multiplier_imag"])
        steady = size.max(axis=2) < 1.0
    special = rows["special_branch"] > 0
    step = rows["special_step"]
    return {
        "points come branch after branch": (
            (np.diff(branch, axis=1) < 0) & (branch[:, 1:] > 0)
        ).any(axis=1),
        "values lie in the span": (held & ~_inside(value, span)).any(axis=1),
        "stable is that of the multipliers": (held & (steady != (rows["stable"] > 0))).any(axis=1),
        "special points are at steps": (special & (step >= branch.shape[1])).any(axis=1),
    }


def _of_curves(study: BranchGrid, rows: Rows) -> Broken:
    ids, step = rows["curve_id"], rows["curve_of_step"]
    n_curves = rows["n_curves"][:, None]
    inside = _inside(rows["curve_amplitude"], study.span)
    inside &= _inside(rows["curve_omega"], study.curve_span)
    return {
        "curves are numbered from 1": misnumbered(ids),
        "n_curves counts them": (ids > 0).sum(axis=1) != rows["n_curves"],
        "points of curves lie in the spans": ((step > 0) & ~inside).any(axis=1),
        "points, meetings and special points are on curves of the line": (
            (step > n_curves).any(axis=1)
            | (rows["meeting_curve"] > n_curves).any(axis=1)
            | (rows["special_curve"] > n_curves).any(axis=1)
        ),
    }


def _of_seeds(rows: Rows) -> Broken:
    held, branch = rows["seed_period"] > 0, rows["seed_branch"]
    return {
        "each seed lies on a branch, or is told why not": (
            held & ((branch > 0) == (rows["seed_reason"] > 0))
        ).any(axis=1),
        "seeds lie on branches of the line": (branch > rows["n_branches"][:, None]).any(axis=1),
        "n_covered counts those on a branch": (branch > 0).sum(axis=1) != rows["n_covered"],
        "seeds are counted": (rows["n_seeds"] < held.sum(axis=1)),
    }


def _inside(values: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    low, high = span
    slack = ROUNDING * (high - low)
    with np.errstate(invalid="ignore"):
        return (values >= low - slack) & (values <= high + slack)
