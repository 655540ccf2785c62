"""Frames of sweeps and of attractors: how they are opened, panels of their points, and of many."""

import contextlib
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.attractors import attractor_classes
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.diagrams.mesh import COLUMNS, panels
from hpcsweep.figures.options import DIRECTION, FLOORS, ROWS, figure_of
from hpcsweep.figures.overlay import Overlay, lay, overlay_keys
from hpcsweep.model.coordinates import Coordinate
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.store import Frames
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

THIN = 0.5
"""Thickness of branches beneath points, in those of a film."""
SINGLE, PANEL, PAGE = 3.4, 1.75, 8.75
"""Height of a panel alone, of one of several, and of all of them where there are many (inches)."""
FINE, FINE_KEY = 0.1, 3
"""Area of the points of a motion that does not repeat, in areas of an orbit's, and their size in
the legend."""
MAX_FRAMES = 12
ORBIT = 2.5
"""Area of the points of an orbit, in areas of those of a motion that does not repeat."""
ONE = 4.8, 2.75
"""Width and height (inches) of a figure of one panel, for its words."""
MAX_COLUMNS = 7
"""Columns of the legend."""


class Frame(NamedTuple):
    """One frame of sweeps or attractors, as `open_frame` finds it.

    Attributes
    ----------
    results, runs : xarray.Dataset
        With the dimension of the frames, and without.
    classes : ndarray of int, shape (n_directions, n_along)
        `MotionClass` of its runs, or of each attractor, a further axis.
    done : ndarray of bool, shape (n_directions, n_along)
        Complete ones.
    study : RunGrid
    structure : Structure
    omega : float
        NaN where it is not the same in all runs.
    along : ndarray, shape (n_along,)
        Values of the parameter along which the path leads.
    caption : str
    """

    results: Any
    runs: Any
    classes: np.ndarray
    done: np.ndarray
    study: RunGrid
    structure: Structure
    omega: float
    along: np.ndarray
    caption: str


def open_frame(results, *needed: str) -> Frame:
    """Take the first frame of results.

    Raises
    ------
    PlotError
        If it lacks a needed variable, its points have no amplitudes in common, or no run of it is
        complete.
    """
    style.need(results, *needed)
    study = style.study_of(results, RunGrid)
    style.need_amplitudes(study)
    frame, along = study.run_dims[-2:]
    results = results.isel({frame: [0]})
    runs = results.isel({frame: 0})
    done = runs["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise style.PlotError(f"no {study.run_noun} of this frame is complete yet")
    several = "attractor_id" in results
    classes = attractor_classes(runs) if several else style.classes_of(results)[:, 0]
    omega, path = labels.common(runs["omega"].values), runs[along].values
    caption = style.caption(results, omega, labels.path_words(study, runs))
    omega = math.nan if omega is None else omega
    return Frame(results, runs, classes, done, study, study.structure, omega, path, caption)


def lay_branches(axes: Mapping[Coordinate, Any], frame: Frame, path: Path | None) -> list[Any]:
    """Draw the branches of a file beneath the panels, if there is one; return keys."""
    if path is None:
        return []
    with contextlib.closing(Overlay(path, frame.study)) as overlay:
        is_shown = frame.study.frames == frame.results[frame.study.run_dims[-2]].values
        overlay.need(np.flatnonzero(is_shown).tolist())
        branches = overlay.at(int(np.argmax(is_shown)))
    for coordinate, axis in axes.items():
        lay(axis, branches, coordinate, THIN)
    return overlay_keys()


def load_frame(
    frames: "Frames", omega: float | None = None, amplitudes: Sequence[float] = (), **_options
):
    """Read the frame nearest to a frequency, along that to an amplitude, default the first."""
    study = as_kind(frames.study, RunGrid)
    if len(amplitudes) and study.run_dims[-2] != "amplitude":
        hint = "--kind orbit and measures draw all those of a frame, --kind phase single ones"
        raise style.PlotError(f"--amplitude {amplitudes[0]:g}: no sweep along omega: {hint}")
    return frames.gather([*frames], [style.frame_at(study, omega, amplitudes)])


def coordinate_panels(structure, floors: Sequence[int | str], label: str = ""):
    """Make a figure of floors and other `coordinates`, the last one uppermost.

    The horizontal axis is that of the amplitude, unless it has another `label`.

    Returns
    -------
    figure, dict of Coordinate to axis
        Downwards.
    """
    shown = coordinates(structure, floors)[::-1]
    height = PANEL * len(shown) if len(shown) > 1 else SINGLE
    figure, axes = style.new_figure(len(shown), 1.2 + min(height, PAGE))
    for coordinate, axis in zip(shown, axes, strict=True):
        at = "" if height > PAGE else "(jT)"
        axis.set_ylabel(labels.displacement(structure, coordinate.symbol, at))
        axis.margins(y=0.08)
    axes[-1].set_xlabel(label or labels.parameter(structure, "amplitude"))
    return figure, dict(zip(shown, axes, strict=True))


def orbit_area(frame) -> float:
    """Return the area of the points of orbits (points^2): the smaller, the more runs."""
    return float(np.clip(14000 / max(frame["outcome"].shape[-1], 1), 0.4, 7.0))


def scatter(axis, frame, runs: np.ndarray, coordinate: Coordinate, **looks) -> None:
    """Draw the stroboscopic points of some runs of a frame, an array of bool."""
    counts = frame["n_points"].values[runs]
    if counts.size:
        along = frame[frame["outcome"].dims[-1]].broadcast_like(frame["n_points"])
        along = along.transpose(*frame["n_points"].dims).values[runs]
        points = coordinate.of(frame["poincare"].values[runs])
        there = np.arange(points.shape[-1]) < counts[:, None]
        axis.scatter(np.repeat(along, counts), points[there], rasterized=True, **looks)


def scatter_motions(
    axis, frame, index: np.ndarray, coordinate: Coordinate, fine: float, orbit: float
) -> None:
    """Draw the points of all runs in the colours of their motions: of orbits above, of other area.

    Parameters
    ----------
    index : ndarray of int
        Of each run, in `palette.MOTIONS`.
    coordinate : Coordinate
    fine, orbit : float
        Areas of the points of motions that do not repeat, and of orbits (points^2).
    """
    orbits = frame["orbit_period"].values > 0
    for place, colour in enumerate(palette.MOTION_COLOURS):
        for repeats, area in ((False, fine), (True, orbit)):
            runs = (index == place) & (orbits == repeats)
            looks = {"s": area, "color": colour, "linewidths": 0, "zorder": 3 if repeats else 2}
            scatter(axis, frame, runs, coordinate, **looks)


def motion_keys(structure, index: np.ndarray, marker: str, size: float) -> list:
    """Return legend keys of the motions that occur in `index`."""
    return [
        labels.dot(name, colour, marker, size)
        for place, (name, colour) in enumerate(palette.motions_of(structure))
        if (index == place).any()
    ]


def mark_stops(axis, structures: Sequence, coordinate: Coordinate, along=()) -> None:
    """Draw the stops of a coordinate, of one structure or of each `along` the axis.

    Those beyond the axis are left out, but of a play, with stops on both sides, that is not wide.
    """
    low, high = limits = axis.get_ylim()
    sides = coordinate.stops(structures[0])
    if len(structures) == 1 and all(sides):
        near = [stop for stop in np.concatenate(sides) if 2 * low - high < stop < 2 * high - low]
        margin = 0.05 * np.ptp([*near, low, high])
        ends = [(stop - margin, stop + margin) for stop in near] + [limits]
        limits = min(ends)[0], max(end for _, end in ends)
    looks = {"color": palette.STOP, "linewidth": 0.8, "linestyle": (0, (5, 3)), "zorder": 1}
    places = np.array([np.concatenate(coordinate.stops(each)) for each in structures])
    for stop in places.T:
        if len(stop) == 1 and limits[0] < stop[0] < limits[1]:
            axis.axhline(stop[0], **looks)
        elif len(stop) > 1:
            axis.plot(along, stop, **looks)
    axis.set_ylim(limits)


def load_some(reader, **_options):
    """Read the frames to draw."""
    return reader.gather([*reader], choose(reader.study.frames).tolist())


@figure_of("frames", "motions", load_some, DIRECTION, FLOORS, ROWS)
def frames(results, direction: str | None = None, floors: Sequence[int | str] = ()):
    """Small orbit diagrams of all frames, or of 12 of them, of one floor (default: the top).

    Parameters
    ----------
    results : xarray.Dataset
    direction : {"up", "down"}, optional
        Default the first.
    floors : sequence of int or str, optional
        The one floor, from 1, or other coordinate that is drawn; default the top one.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    style.need(results, "poincare")
    study = style.study_of(results, RunGrid)
    style.need_amplitudes(study)
    structure, name = study.structure, study.run_dims[-2]
    if len(floors) > 1:
        raise style.PlotError(f"--floor {floors[1]}: --kind frames shows one floor")
    coordinate = coordinates(structure, floors)[-1]
    chosen = choose(results[name].values)
    swept = [style.direction_index(results["direction"].values, direction)]
    results = results.isel({name: chosen, "direction": swept})
    classes = style.classes_of(results)
    motions = palette.motion_index(classes[0], results["orbit_period"].values[0])
    figure, axes = panels(len(chosen), ONE, (2.4, 1.75), (0.0, 1.0), sharey=False)
    for place, axis in enumerate(axes):
        _panel(axis, results.isel({name: place, "direction": 0}), motions[place], coordinate)
        words = {"omega": r"$\Omega$ = {:.4g}", "amplitude": "$A$ = {:.4g}"}.get(name, "")
        axis.set_title(words.format(float(results[name][place])), fontsize=8.5, pad=3)
    figure.supylabel(labels.displacement(structure, coordinate.symbol, "(jT)"), fontsize=10)
    for axis in axes[-COLUMNS:]:
        axis.set_xlabel(re.sub("^forcing (amplitude|frequency) ", "", labels.along(study)))
        axis.tick_params(labelbottom=True)
    _legend(figure, results, classes, motions)
    caption = style.caption(results, more=labels.path_words(study, results))
    return style.head(figure, f"{caption},  {style.words_of(results)}", fontsize=8.5)


def choose(omegas: np.ndarray) -> np.ndarray:
    """Return frames spread evenly over frequency, in order, at most `MAX_FRAMES`."""
    count = min(omegas.size, MAX_FRAMES)
    return np.argsort(omegas, kind="stable")[
        np.linspace(0, omegas.size - 1, count).round().astype(int)
    ]


def _panel(axis, frame, motions, coordinate: Coordinate) -> None:
    along = frame[frame["outcome"].dims[-1]].values
    size = float(np.clip(300 / max(along.size, 1), 0.5, 4.0))
    done = np.where(frame["outcome"].values == Outcome.COMPLETE, motions, -1)
    scatter_motions(axis, frame, done, coordinate, size, ORBIT * size)
    style.draw_lattice(axis)
    axis.tick_params(labelsize=8)
    style.limit_amplitudes(axis, along)


def _legend(figure, results, classes, motions) -> None:
    structure, failed = style.structure_of(results), classes[0] == MotionClass.FAILED
    handles = motion_keys(structure, np.where(failed, -1, motions), "o", 4)
    if failed.any():
        handles.append(labels.dot("failed: blank", "none"))
    style.foot(figure, handles, results, classes, min(len(handles), MAX_COLUMNS))
