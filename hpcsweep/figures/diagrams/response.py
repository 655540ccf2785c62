"""Frequency response: what a row does along each path of a sweep, with branches beneath.

Values are those of the file (`output.rows`), or computed from its stroboscopic points.
"""

import contextlib
import math
from functools import lru_cache
from pathlib import Path

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.options import BRANCHES, FLOORS, ROWS, Option, figure_of
from hpcsweep.figures.overlay import Overlay
from hpcsweep.model.coordinates import Coordinate, coordinate_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.grid import DOWN, RunGrid
from hpcsweep.studies.quantities import ROWS as HELD
from hpcsweep.studies.study import as_kind

VALUES = {each.name.removeprefix("row_"): each.label or "phase" for each in HELD}
MEASURE = Option(
    "--measure",
    "what a row does over the orbit or the window (default: range, half peak-to-peak)",
    choices=tuple(VALUES),
)
SCALES = Option("--log", "logarithmic axes", choices=("x", "y", "xy"))
MOST = 12
"""Paths drawn."""


@lru_cache(maxsize=64)
def _solver(structure, omega: float):
    from hpcsweep.solvers.solver import make_solver  # loads what computes

    return make_solver("flow", structure, omega, 1e-9, yields=True)


def _value(structure, forcing, points, coordinate: Coordinate, measure: str) -> float:
    """Return what a coordinate does from each stroboscopic point of a motion, all together."""
    amplitude, omega = map(float, forcing)
    moving = structure.within_reach(amplitude, points).measured_at(omega, amplitude)
    try:
        seen = _solver(moving, omega).rows_of(points, amplitude, np.array([coordinate.row]), 1)
    except ArithmeticError:
        return math.nan
    return float(getattr(seen, measure).flat[0])


def load(frames, floors=(), measure: str | None = None, branches: Path | None = None, log=None):
    """Read or compute the values of the runs, and of branches beneath them."""
    study, measure = as_kind(frames.study, RunGrid), measure or "range"
    style.need_amplitudes(study)
    (coordinate, *more) = coordinates(study.structure, floors or (study.structure.floor_names[0],))
    if more:
        raise style.PlotError("--kind response shows one --floor or --row")
    rows = [coordinate_of(study.structure, word) for word in study.settings.rows]
    stored = coordinate in rows
    names = (f"row_{measure}",) if stored else ("poincare", "n_points")
    style.need(frames.dataset(0), *names)
    paths, dims = [], study.run_dims
    shown = np.linspace(0, study.n_frames - 1, min(study.n_frames, MOST)).round().astype(int)
    with contextlib.ExitStack() as stack:
        beneath = None
        if branches:
            beneath = stack.enter_context(contextlib.closing(Overlay(branches, study)))
        for frame in shown.tolist():
            results = frames.dataset(frame).isel({dims[-2]: 0})
            forcing = np.stack((study.amplitudes_of(frame), study.omegas_of(frame)))
            values = np.full(results["outcome"].shape, math.nan)
            for at in np.argwhere(results["outcome"].values == Outcome.COMPLETE).tolist():
                run = results.isel(dict(zip(results["outcome"].dims, at, strict=True)))
                if stored:
                    held = run[names[0]].isel(coordinate=rows.index(coordinate)).values
                    values[tuple(at)] = held.flat[0]
                else:
                    points = run["poincare"].values[: int(run["n_points"])]
                    of = study.structure_at(at[-1]), forcing[:, at[-1]], points
                    values[tuple(at)] = _value(*of, coordinate, measure)
            lines = []
            for branch in beneath.at(frame) if beneath else ():
                each = zip(branch.forcing.T, branch.points, strict=True)
                held = [_value(study.structure, *orbit, coordinate, measure) for orbit in each]
                lines.append((branch, np.array(held)))
            paths.append((float(study.frames[frame]), study.along_of(frame), values, lines))
    return frames.dataset(0), study, coordinate, paths


@figure_of("response", "motions", load, FLOORS, ROWS, MEASURE, BRANCHES, SCALES)
def response(loaded, measure: str | None = None, log: str | None = None, **_options):
    """What a row does along the path: up full, down hollow, a colour each frame; half peak-to-peak.

    Or another --measure of one --floor or --row; --branches FILE lays branches beneath, stable
    ones thick, unstable ones thin.
    """
    results, study, coordinate, paths = loaded
    structure, measure = study.structure, measure or "range"
    figure, (axis,) = style.new_figure(1, 4.4)
    colours = [palette.series_colour(k) for k in range(len(paths))]
    if len(paths) > 6:
        colours = [palette.mode_colour(k, len(paths)) for k in range(len(paths))]
    for colour, (_, along, values, lines) in zip(colours, paths, strict=True):
        for branch, held in lines:
            for piece, steady in branch.pieces():
                looks = {"lw": 1.6, "alpha": 0.6} if steady else {"lw": 0.7, "ls": (0, (4, 2))}
                axis.plot(branch.value[piece], held[piece], color=colour, zorder=1.5, **looks)
        for name, row in zip(study.directions, values, strict=True):
            face = "white" if name == DOWN else colour
            looks = {"ms": 3.2, "mew": 0.7, "mfc": face, "color": colour, "lw": 0.5 * (not lines)}
            axis.plot(along, row, "v-" if name == DOWN else "o-", **looks)
    symbol = labels.displacement(structure, coordinate.symbol)
    if measure == "phase":
        symbol = f"${coordinate.symbol.replace('@', 'u')}$  [rad]"
    axis.set(xlabel=labels.along(study), ylabel=f"{VALUES[measure]} of {symbol}")
    axis.set(**{f"{way}scale": "log" for way in log or ""})
    name = labels.typeset(study.run_dims[-2])
    keys = [
        labels.key(f"{name} = {at:.4g}", color=c)
        for c, (at, *_) in zip(colours, paths, strict=True)
    ]
    if len(study.directions) > 1:
        keys += [labels.dot("up", "0.3"), labels.dot("down", "0.3", "v", face="white")]
    if any(lines for *_, lines in paths):
        keys += [labels.key("stable branch", color="0.3", lw=1.6, alpha=0.6)]
        keys += [labels.key("unstable", color="0.3", lw=0.7, ls=(0, (4, 2)))]
    labels.legend_below(figure, keys, "")
    fixed = labels.path_words(study, None if "amplitude" in study.run_dims else results)
    return style.head(figure, style.caption(results, more=fixed))
