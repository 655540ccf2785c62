"""Branches of one line over an orbit diagram: stable full, unstable thin, special points marked."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.figures.labels import amplitude, choose_floors, displacement, frequency
from hpcsweep.figures.options import FLOORS, SWEEP, Option, whole_number
from hpcsweep.figures.palette import DARK_INK, GRAZING, MOTION_COLOURS, series_colour
from hpcsweep.figures.style import PlotError, head, new_figure, parameters, save

NAME = "branches"
DRAWS = "branches"
HELP = """\
branches of periodic orbits along the parameter: stable full, unstable thin, special
points marked; with --sweep the stroboscopic points of a sweep over them"""
OPTIONS = (
    FLOORS,
    Option("--line", "line, from 0 (default: the first)", "line", {"type": whole_number(0, 10**9)}),
    SWEEP,
)
MARKS = {
    Kind.FOLD: ("fold", "o", series_colour(1)),
    Kind.DOUBLING: ("period doubling", "s", series_colour(0)),
    Kind.TORUS: ("torus", "D", series_colour(2)),
    Kind.BRANCH_POINT: ("branch point", "^", series_colour(3)),
    Kind.GRAZING: ("grazing", "|", GRAZING),
}
"""Word, marker and colour of each kind of special point."""
PANEL, PAGE = 1.75, 8.75
"""Height of a panel, and of all of them where there are many (inches)."""
COLUMNS = 5


class Drawn(NamedTuple):
    """What is drawn.

    Attributes
    ----------
    line : xarray.Dataset
    branches : list of (period, value, stable, points)
        By branch: arrays over its steps, points of shape (steps, period, 2n).
    runs : xarray.Dataset or None
        Runs of a sweep.
    study : Branches
    """

    line: Any
    branches: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]
    runs: Any
    study: Any


def load(frames, line: int = 0, sweep: Path | None = None, **_options) -> Drawn:
    """Read a line, and the runs of a sweep at its frequency."""
    from hpcsweep.store import Frames

    study = frames.study
    if line >= study.n_frames:
        raise PlotError(f"--line {line}: there are {study.n_frames} lines, from 0")
    runs = None
    if sweep is not None:
        if study.parameter != "amplitude":
            raise PlotError(f"--sweep {sweep}: goes with branches of the amplitude alone")
        held = Frames(sweep)
        try:
            there = np.flatnonzero(held.study.omega == study.omega[line])
            if not there.size or "poincare" not in held:
                what = f"has no stroboscopic points at Omega = {study.omega[line]:g}"
                raise PlotError(f"--sweep {sweep}: {what}")
            runs = held.dataset(int(there[0]))
        finally:
            held.close()
    found = frames.dataset(line)
    return Drawn(found, list(_branches(_of_line(found), study, line)), runs, study)


def _of_line(line) -> dict[str, np.ndarray]:
    return {name: line[name].values[0, 0, 0] for name in line.data_vars if line[name].ndim >= 3}


def _branches(run: dict, study, line: int):
    """Return period, values, stability and all stroboscopic points of each branch."""
    place = float(study.amplitude[line]), float(study.omega[line])
    forced = ForcedMap(study.structure, *place, study.parameter, study.settings.rtol)
    for number, period in zip(
        run["branch_id"].tolist(), run["branch_period"].tolist(), strict=True
    ):
        own = run["step_branch"] == number
        if number and own.any():
            points = np.empty((own.sum(), period, forced.size))
            for k, (x, value) in enumerate(zip(run["point"][own], run["value"][own], strict=True)):
                for turn in range(period):
                    points[k, turn] = x
                    if turn < period - 1:
                        x = forced.image(x / forced.units, float(value)) * forced.units
            yield period, run["value"][own], run["stable"][own] > 0, points


def draw(
    results: Drawn,
    path: Path,
    floors: Sequence[int] = (),
    line: int = 0,
    sweep: Path | None = None,
) -> None:
    """Draw a line, as `load` has read it, and write it to `path`."""
    del line, sweep
    found, branches, runs, study = results
    run = _of_line(found)
    if not branches:
        raise PlotError("no branch of this line is computed")
    structure = study.structure
    shown = choose_floors(structure.n_floors, floors)
    figure, axes = new_figure(len(shown), 1.2 + min(PANEL * len(shown), PAGE))
    for floor, axis in zip(shown[::-1], axes, strict=True):
        if runs is not None:
            _draw_runs(axis, runs, floor)
        _draw_branches(axis, branches, floor)
        _draw_specials(axis, run, floor)
        axis.set_ylabel(displacement(structure, floor, "(jT)"))
        axis.margins(y=0.08)
    axes[-1].set_xlabel(_label(study, structure))
    axes[-1].set_xlim(*study.span)
    fixed = float(found["omega"].values[0])
    omega = fixed if np.isfinite(fixed) else None
    head(figure, parameters(structure, omega), fontsize=10)
    handles = _handles(run, runs is not None)
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(len(handles), COLUMNS),
        fontsize=8,
        frameon=False,
    )
    save(figure, path)


def _label(study, structure) -> str:
    if study.parameter == "amplitude":
        return amplitude(structure)
    return frequency(structure) if study.parameter == "omega" else study.parameter


def _draw_runs(axis, runs, floor: int) -> None:
    """Draw the stroboscopic points of all runs."""
    points = runs["poincare"].values[..., floor]
    at = np.broadcast_to(runs["amplitude"].values[:, None], points.shape)
    axis.plot(
        at.ravel(), points.ravel(), ".", color=DARK_INK, markersize=0.8, zorder=3, rasterized=True
    )


def _draw_branches(axis, branches: list, floor: int) -> None:
    """Draw each branch, cut where its stability changes; the piece between is unstable."""
    for period, value, stable, points in branches:
        both = stable[:-1] & stable[1:]
        for steady, width in ((False, 0.6), (True, 1.8)):
            ends = np.flatnonzero(both == steady)
            for piece in np.split(ends, np.flatnonzero(np.diff(ends) > 1) + 1):
                if piece.size:
                    chosen = slice(piece[0], piece[-1] + 2)
                    shown = points[chosen, :, floor]
                    axis.plot(value[chosen], shown, color=_colour(period), lw=width, zorder=2)


def _draw_specials(axis, run: dict, floor: int) -> None:
    for kind in MARKS:
        own = run["special_kind"] == kind
        looks = {**_looks(kind, 3.5), "markeredgewidth": 0.9, "zorder": 4}
        axis.plot(run["special_value"][own], run["special_point"][own, floor], **looks)


def _looks(kind: Kind, size: float) -> dict[str, Any]:
    """Return the style of special points of a kind; the bar of grazings has its own size."""
    _, marker, colour = MARKS[kind]
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": 7 if marker == "|" else size,
        "markerfacecolor": "white" if marker != "|" else colour,
        "markeredgecolor": colour,
    }


def _colour(period: int) -> str:
    """Return the colour of orbits of a period, as in all figures."""
    return MOTION_COLOURS[min(period, 9)]


def _handles(run: dict, runs: bool) -> list:
    from matplotlib.lines import Line2D

    periods = np.unique(np.minimum(run["branch_period"][run["branch_id"] > 0], 9)).tolist()
    names = {p: f"P{p}" if p < 9 else "P9 and longer" for p in periods}
    handles = [Line2D([], [], color=_colour(p), lw=1.8, label=names[p]) for p in periods]
    handles += [
        Line2D([], [], color=DARK_INK, lw=1.8, label="stable"),
        Line2D([], [], color=DARK_INK, lw=0.6, label="unstable"),
    ]
    for kind, (word, _, _) in MARKS.items():
        if (run["special_kind"] == kind).any():
            handles.append(Line2D([], [], label=word, **_looks(kind, 4)))
    if runs:
        handles.append(
            Line2D([], [], linestyle="none", marker=".", markersize=3, color=DARK_INK, label="runs")
        )
    return handles
