"""Keys of a study of branches, and the fields that are read from them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.borders import check_hardening
from hpcsweep.dynamics.continuation.forced import (
    FORCING_PARAMETERS,
    PARAMETERS,
    ForcedMap,
    check_parameter,
)
from hpcsweep.dynamics.continuation.plane import KINDS
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import CURVES
from hpcsweep.studies.blocks import Poll
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.keys import Key
from hpcsweep.studies.path_grid import FORCING, Tie, read_ties
from hpcsweep.studies.points import read_points

PARAMETER = Key("parameter", "what changes along a branch", "amplitude", PARAMETERS)
_NUMBERS = (
    Key("steps", "most points of a branch to either side of a motion", 2000, (1, 100_000)),
    Key("largest_step", "longest step, in units of the state and of the span", 0.05, (1e-6, 1.0)),
    Key("max_branches", "room for branches of each line", 64, (1, 10_000)),
    Key("max_points", "room for points of branches of each line", 20_000, (1, 10_000_000)),
    Key("max_seeds", "room for motions of each line", 4000, (1, 10_000_000)),
    Key("starts", "starts of a search for orbits that no motion shows", 0, (0, 1_000_000)),
    Key("seed", "of the sequence of these starts", 0, (0, 2**62)),
    Key("max_curves", "room for curves of each line", 256, (1, 10_000)),
    Key("max_curve_points", "room for points of curves of each line", 5000, (1, 10_000_000)),
)
CHECKED = 101
"""Values of the span at which formulas are checked."""
ZOOMS = 25
"""Steps to an extreme between them, to a quarter each: to the last digit."""
POLE = 1e6
"""Times as large as at these values a formula has a pole between them."""
PAIR = "must be [low, high]"
NUMBERS = {key.name: key for key in _NUMBERS}
KEYS = (
    Key(
        "seeds",
        "results files of sweeps, points or attractors, one or a list, relative to where the job "
        "is run: branches go through their periodic motions ([how](branches.md#a-study))",
    ),
    PARAMETER,
    Key(
        "span",
        "lowest and highest value of the parameter",
        told="those of `sweep.amplitude`, or `sweep.omega`",
    ),
    *_NUMBERS[:7],
    Key(
        "curves",
        'kinds of special points, a list of `"fold"`, `"doubling"`, `"torus"`, `"grazing"`, that '
        "are followed over A and Omega, of orbits up to `sweep.max_orbit_period`, each line's half "
        "way to the next line ([how](branches.md#curves-of-a-study)); with `branches.parameter` "
        "amplitude",
        told="[]",
    ),
    Key("curve_span", "lowest and highest frequency of curves", told="those of `sweep.omega`"),
    *_NUMBERS[7:],
)


@dataclass(frozen=True, eq=False)
class BranchGrid(RunGrid):
    """Lines along which branches are followed; see `RunGrid`, whose frames are the lines.

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
    curves : tuple of str
        Kinds of special points whose curves over A and Omega are followed.
    curve_span : (float, float)
        Lowest and highest frequency of curves, where they are followed.
    max_curves, max_curve_points : int
        Room of a line; of meetings an eighth of `max_curve_points`.
    formulas : tuple of Tie
        What gives frequency or amplitude along the parameter; `omega` and `amplitude` then hold
        what it gives at the end of the span.
    """

    seeds: tuple[str, ...]
    parameter: str
    span: tuple[float, float]
    steps: int = NUMBERS["steps"].default
    largest_step: float = NUMBERS["largest_step"].default
    max_branches: int = NUMBERS["max_branches"].default
    max_points: int = NUMBERS["max_points"].default
    max_seeds: int = NUMBERS["max_seeds"].default
    starts: int = NUMBERS["starts"].default
    seed: int = NUMBERS["seed"].default
    curves: tuple[str, ...] = ()
    curve_span: tuple[float, float] = (0.0, 0.0)
    max_curves: int = NUMBERS["max_curves"].default
    max_curve_points: int = NUMBERS["max_curve_points"].default
    formulas: tuple[Tie, ...] = ()

    @property
    def ties(self) -> tuple[str, ...]:  # type: ignore[override]
        """Formulas of frequency and amplitude, in words."""
        return tuple(tie.words for tie in self.formulas)

    @property
    def moves(self) -> tuple[str, ...]:
        """The parameter, and what formulas give along it."""
        return (self.parameter, *self.given_by)

    @property
    def given_by(self) -> dict[str, Callable[..., float]]:
        """What gives the frequency or the amplitude along the parameter."""
        return {tie.name: tie.of for tie in self.formulas}

    def forced(self, line: int, poll: Poll = None) -> ForcedMap:
        """Return the stroboscopic map of a line."""
        return ForcedMap(
            self.structure,
            float(self.amplitude[line]),
            float(self.omega[line]),
            self.parameter,
            self.settings.rtol,
            poll,
            ties=self.given_by,
        )

    def forcing(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the frequencies and amplitudes of lines at values, shapes (n_lines, n_values)."""
        shape = self.omega.size, len(values)
        numbers = {name: np.tile(getattr(self, name)[:, None], shape[1]) for name in FORCING}
        numbers[self.parameter] = np.tile(values, (shape[0], 1))
        for name, of in self.given_by.items():
            numbers[name][:] = [of(**{self.parameter: value}) for value in values.tolist()]
        return numbers["omega"], numbers["amplitude"]


def _tied(values: Any, key: str, text: str, parameter: str, along: np.ndarray) -> np.ndarray:
    """Return what a formula gives at `CHECKED` values; look for poles between them."""
    tied = values.tied(key, text, {parameter: along})
    for turn in np.flatnonzero(np.diff(np.sign(np.diff(tied)))) + 1:
        low, high, top = along[turn - 1], along[turn + 1], tied[turn]
        side = np.sign(top - tied[turn - 1]) or np.sign(top - tied[turn + 1])
        for _ in range(ZOOMS):
            near = np.linspace(low, high, 9)
            curve = values.tied(key, text, {parameter: near})
            k = min(max(int(np.argmax(side * curve)), 1), near.size - 2)
            if not abs(curve[k]) <= POLE * np.abs(tied).max():
                raise values.error(key, text, f"must have no pole, has one at {near[k]:.4g}")
            low, high = near[k - 1], near[k + 1]
    return tied


def _read_curves(values, structure: Structure, parameter: str, omega: np.ndarray) -> dict:
    """Read which curves are followed, and over which frequencies."""
    names = values.choices("branches.curves", values.get("branches.curves", []), KINDS)
    if names and (parameter != "amplitude" or omega.size == 0):
        limit = 'must be "amplitude", without formulas, where branches.curves are followed'
        raise values.error("branches.parameter", parameter, limit)
    if names and not CURVES.of(structure):
        raise values.error("branches.curves", names, f"must be [] {CURVES.lacks}")
    whole = [float(omega.min()), float(omega.max())] if omega.size else [1.0, 1.0]
    span = values.get("branches.curve_span", whole)
    ((low, high),) = values.pairs("branches.curve_span", span, [span], PAIR).tolist()
    values.check_range("branches.curve_span", omega=(low, high))
    if names and not (low < high and low <= omega.min() and omega.max() <= high):
        raise values.error("branches.curve_span", span, "must be two ends that hold sweep.omega")
    kinds = tuple(name for name in KINDS if name in names)
    return {"curves": kinds, "curve_span": (low, high)} if kinds else {}


def read_lines(values, structure: Structure) -> dict[str, Any]:
    """Read the fields of a study: parameter and span, lines, seeds, curves and limits."""
    parameter = values.read("branches", PARAMETER)
    try:
        check_parameter(structure, parameter)
    except ValueError as error:
        raise values.error("branches.parameter", parameter, str(error)) from None
    try:
        check_hardening(structure)
    except ValueError as error:
        raise values.error("study.kind", "branches", str(error)) from None
    listed, texts = values.has("study.points"), read_ties(values, parameter, "the branches are")
    if listed and parameter in FORCING_PARAMETERS:
        chosen = values.get("study.points")
        limit = f"must not be given along {parameter}: sweep.omega and sweep.amplitude make lines"
        raise values.error("study.points", chosen, limit)
    if listed:
        omega, amplitude = read_points(values)
    else:
        omega, amplitude = (
            np.empty(0) if name in texts else values.forcing(name) for name in FORCING
        )
    span = _span_of(values, parameter, omega, amplitude)
    # the parameter of a line is at the end of its span
    ends = np.array(span[1:])
    axes = {"omega": omega, "amplitude": amplitude} | ({} if listed else {parameter: ends})
    chosen = {name: each for name, each in axes.items() if name not in texts}
    if not listed:
        mesh = np.meshgrid(*chosen.values(), indexing="ij")
        chosen = {name: each.ravel() for name, each in zip(chosen, mesh, strict=True)}
    formulas, n_lines = [], next(iter(chosen.values())).size
    for name, text in texts.items():
        formulas.append(values.tie(f"sweep.{name}", text, (parameter,)))
        tied = _tied(values, f"sweep.{name}", text, parameter, np.linspace(*span, CHECKED))
        chosen[name] = np.full(n_lines, tied[-1])
    lines = [chosen[name] for name in FORCING]
    seeds = values.get("branches.seeds")
    return {
        "omega": lines[0],
        "amplitude": lines[1],
        "seeds": values.names("branches.seeds", seeds, "a results file, or a list of them"),
        "parameter": parameter,
        "span": span,
        "formulas": tuple(formulas),
        **_read_curves(values, structure, parameter, omega),
        **{key.name: values.read("branches", key) for key in NUMBERS.values()},
    }


def _span_of(
    values, parameter: str, omega: np.ndarray, amplitude: np.ndarray
) -> tuple[float, float]:
    """Read the span; default, along A and Omega, that of the job's own."""
    axis = {"omega": omega, "amplitude": amplitude}.get(parameter, np.empty(0))
    default = [float(axis.min()), float(axis.max())] if axis.size > 1 else None
    pair = values.get("branches.span", default)
    ((low, high),) = values.spans("branches.span", pair, [pair], PAIR).tolist()
    if parameter in FORCING:
        values.check_range("branches.span", **{parameter: (low, high)})
    elif low < 0:
        raise values.error("branches.span", pair, f"{parameter} must be at least 0")
    return low, high
