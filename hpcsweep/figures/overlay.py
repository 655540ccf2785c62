"""Branches, special points and curves of a study of branches, laid over figures of another file."""

import contextlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import continued
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.figures import labels, palette
from hpcsweep.figures.style import PlotError, stretches
from hpcsweep.model.coordinates import Coordinate
from hpcsweep.store import Frames
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.path_grid import FORCING
from hpcsweep.studies.study import as_kind

STABLE, UNSTABLE = (palette.DARK_INK, 2.2), ("#8c8c8c", 0.7)
"""Colour of a branch beneath points, and width."""

MARKS = {
    Kind.FOLD: ("fold", "o", palette.series_colour(1)),
    Kind.DOUBLING: ("period doubling", "s", palette.series_colour(0)),
    Kind.TORUS: ("torus", "D", palette.series_colour(2)),
    Kind.BRANCH_POINT: ("branch point", "^", palette.series_colour(3)),
    Kind.GRAZING: ("grazing", "|", palette.GRAZING),
    Kind.SLIP: ("slip", "v", palette.DARK_INK),
    Kind.CHATTER: ("chatter", "<", palette.DARK_INK),
}
"""Word, marker and colour of each kind of special point."""
SPECIALS = ("special_kind", "special_value")
CURVES = ("curve_kind", "curve_of_step", "curve_amplitude", "curve_omega")


class Drawn(NamedTuple):
    """A branch.

    Attributes
    ----------
    number, period : int
    value : ndarray, shape (k,)
        Of the parameter.
    stable : ndarray of bool, shape (k,)
    points : ndarray, shape (k, period, 2n)
        All stroboscopic points.
    forcing : ndarray, shape (2, k)
        Amplitude and frequency.
    contact : ndarray of uint64, shape (k,)
    multipliers : ndarray of complex, shape (k, 2n)
    """

    number: int
    period: int
    value: np.ndarray
    stable: np.ndarray
    points: np.ndarray
    forcing: np.ndarray
    contact: np.ndarray
    multipliers: np.ndarray

    def pieces(self) -> Iterator[tuple[slice, bool]]:
        """Cut it where its stability changes; the piece between is unstable."""
        both = self.stable[:-1] & self.stable[1:]
        for first, last in stretches(both) if both.size else ():
            yield slice(first, last + 1), bool(both[first])


class Overlay:
    """Branches of a file along the paths of another one.

    Parameters
    ----------
    path : Path
    under : RunGrid
        Of the file over which they lie.

    Raises
    ------
    PlotError
        If the branches are along another parameter, or those of another structure.
    """

    def __init__(self, path: Path, under: RunGrid):
        self.frames = Frames(path, content="branches")
        self.study = as_kind(self.frames.study, Branches)
        if problem := not_beneath(self.study, under):
            raise PlotError(f"--branches {path}: {problem}")
        self._under = under

    def at(self, frame: int) -> list[Drawn]:
        """Return the branches along the path of a frame, none where the file has no line."""
        line = line_beneath(self.study, self._under, frame)
        if line is None:
            return []
        return list(branches_of(run_of(self.frames.dataset(line)), self.study, line))

    def need(self, frames: Iterable[int]) -> None:
        """Make sure that there are branches along one of the frames.

        Raises
        ------
        PlotError
            If there are none.
        """
        if all(line_beneath(self.study, self._under, frame) is None for frame in frames):
            raise PlotError(
                f"--branches {self.frames.path}: has no line along any path that is drawn"
            )

    def close(self) -> None:
        """Close the file."""
        self.frames.close()


def not_beneath(study: Branches, under: RunGrid) -> str:
    """Return why branches do not fit beneath the paths of another study; '' if they do."""
    along, first = study.parameter, float(under.along_of(0)[0])
    if along != under.run_dims[-1]:
        return f"holds branches along {along}, not {under.run_dims[-1]}"
    changed: dict[str, Any] = {} if along in FORCING else {along: first}
    if replace(study.structure, **changed) != under.structure_at(0):
        return "is of another structure"
    return ""


def line_beneath(study: Branches, under: RunGrid, frame: int) -> int | None:
    """Return the line along which the path of a frame leads, None if there is none."""
    pairs = zip(
        study.forcing(under.along_of(frame)),
        (under.omegas_of(frame), under.amplitudes_of(frame)),
        strict=True,
    )
    same = [np.isclose(there, swept, rtol=1e-12, atol=0.0).all(axis=1) for there, swept in pairs]
    lines = np.flatnonzero(same[0] & same[1])
    return int(lines[0]) if lines.size else None


def lay(axis, branches: Iterable[Drawn], coordinate: Coordinate, thick: float = 1.0) -> list[Any]:
    """Draw branches beneath points, stable ones on top, so thick; return the lines."""
    pieces = [(branch, *piece) for branch in branches for piece in branch.pieces()]
    lines: list[Any] = []
    for branch, piece, steady in sorted(pieces, key=lambda entry: entry[-1]):
        colour, width = STABLE if steady else UNSTABLE
        drawn = branch.value[piece], coordinate.of(branch.points[piece])
        lines += axis.plot(*drawn, color=colour, lw=thick * width, zorder=1.5)
    return lines


def overlay_keys() -> list[Any]:
    """Return the legend keys of branches beneath points."""
    words = ((STABLE, "stable branch"), (UNSTABLE, "unstable"))
    return [labels.key(word, color=c, linewidth=width) for (c, width), word in words]


def run_of(line) -> dict[str, np.ndarray]:
    """Return the variables of a dataset of one line, with the dimensions of `hpcsweep.branch`."""
    line = line.isel(direction=0, line=0, amplitude=0)
    return {name: variable.values for name, variable in line.items()}


def branches_of(run: dict[str, Any], study: Branches, line: int) -> Iterator[Drawn]:
    """Return the branches of a line with all their stroboscopic points."""
    forced = study.forced(line)
    numbers, periods = run["branch_id"].tolist(), run["branch_period"].tolist()
    for number, period in zip(numbers, periods, strict=True):
        steps = run["step_branch"] == number
        if number and steps.any():
            pairs = zip(run["point"][steps] / forced.units, run["value"][steps], strict=True)
            orbits = [continued(forced, x[None], float(value), period) for x, value in pairs]
            points = np.array(orbits) * forced.units
            yield Drawn(
                *(number, period, run["value"][steps], run["stable"][steps] > 0, points),
                np.stack([each[line] for each in study.forcing(run["value"][steps])[::-1]]),
                run["contact"][steps],
                run["multiplier_real"][steps] + 1j * run["multiplier_imag"][steps],
            )


def with_specials(results, path: Path, under: RunGrid):
    """Add the special points and curves of a file of branches to the results of a map.

    Raises
    ------
    PlotError
        If the file holds branches along another parameter, or those of another structure.
    """
    with contextlib.closing(Overlay(path, under)) as held:
        study = as_kind(held.study, Branches)
        names = (*SPECIALS, *(CURVES if study.curves else ()))
        lines = held.frames.gather(names)
    of = {name: lines[name].values[0, :, 0] for name in names}
    kind = of["special_kind"]
    line, place = np.nonzero(kind)
    at = {"amplitude": study.amplitude[line], "omega": study.omega[line]}
    at[study.parameter] = of["special_value"][line, place]
    marked = results.assign(
        special_kind=("special", kind[line, place]),
        special_amplitude=("special", at["amplitude"]),
        special_omega=("special", at["omega"]),
    )
    if study.curves:
        line, step = np.nonzero(of["curve_of_step"])
        number = of["curve_of_step"][line, step]
        marked = marked.assign(
            curve_number=("curve_step", line * study.max_curves + number),
            curve_kind=("curve_step", of["curve_kind"][line, number - 1]),
            curve_amplitude=("curve_step", of["curve_amplitude"][line, step]),
            curve_omega=("curve_step", of["curve_omega"][line, step]),
        )
    return marked


def draw_specials(axis, results) -> None:
    """Draw what `with_specials` has added, if anything."""
    if "special_kind" not in results:
        return
    for kind, (_, _, colour) in MARKS.items():
        marked = results["special_kind"].values == kind
        at = results["special_amplitude"].values[marked], results["special_omega"].values[marked]
        axis.plot(*at, **_looks(colour, 2.6))
    if "curve_number" in results:
        for _, curve in results.groupby("curve_number"):
            colour = MARKS[Kind(int(curve["curve_kind"][0]))][-1]
            places = curve["curve_amplitude"].values, curve["curve_omega"].values
            axis.plot(*places, color=colour, lw=1)


def special_keys(results) -> list:
    """Return the legend keys of the special points."""
    there = np.unique(results["special_kind"].values).tolist() if "special_kind" in results else []
    return [
        labels.key(word, **_looks(colour, 5.0))
        for kind, (word, _, colour) in MARKS.items()
        if kind in there
    ]


def _looks(colour: str, size: float) -> dict:
    edge = {"markeredgecolor": "white", "markeredgewidth": 0.3}
    return {"linestyle": "none", "marker": "o", "color": colour, "markersize": size, **edge}
