"""Phase portraits of motions of a sweep."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass, shakedown_name
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.coordinates import coordinates
from hpcsweep.figures.diagrams.sweep import Frame, load_frame, open_frame
from hpcsweep.figures.options import COORDINATES, PERIOD, RUN, figure_of

WIDTH, MIN_WIDTH = 2.4, 4.8
"""Width of a panel, and the least of the figure (inches)."""
NEAR_STOP = 10
"""A stop is shown where it is not farther from the motion than so many of its widths."""
BEYOND: dict[str, Any] = {"facecolor": "0.88", "edgecolor": "0.5", "hatch": "////"}
"""What is behind a stop."""
MAX_CYCLES = 60
"""Forcing periods drawn of a motion that does not repeat: more would fill the panel."""


class DrawnRun(NamedTuple):
    """A run to draw: its index in the frame."""

    direction: int
    along: int


def load(frames, omega: float | None = None, amplitudes: Sequence[float] = (), **_options):
    """Read a frame; amplitudes are those of its runs, or of sweeps along another parameter it."""
    of_frame = () if frames.study.run_dims[-1] == "amplitude" else amplitudes
    return load_frame(frames, omega, of_frame)


@figure_of("phase", "motions", load, *RUN, PERIOD, *COORDINATES)
def phase(
    results,
    amplitudes: Sequence[float] = (),
    periods: Sequence[int] = (),
    direction: str | None = None,
    floors: Sequence[int | str] = (),
    along: Sequence[float] = (),
    **_options,
):
    """Phase portraits of the floors at --amplitude A, at --along X, or of an orbit of --period P.

    Parameters
    ----------
    results : xarray.Dataset
        The first frame is drawn.
    amplitudes : sequence of float
        The nearest amplitudes of the sweep are drawn.
    periods : sequence of int
        Orbit periods, for each of which a motion is drawn; see `find_period`.
    direction : {"up", "down"}, optional
        For amplitudes default the first; for periods default any.
    floors : sequence of int or str, optional
        Shown, see `coordinates.coordinates`.
    along : sequence of float
        Of a sweep along another parameter than the amplitude, its values.

    Raises
    ------
    PlotError
        If there is no such motion, or the file does not hold the variables to draw.
    """
    of_amplitude = results["outcome"].dims[-1] == "amplitude"
    chosen, flag = (amplitudes, "amplitude") if of_amplitude else (along, "along")
    if not len(chosen) and not len(periods):
        raise style.PlotError(f"--kind phase needs --{flag} or --period")
    if of_amplitude and len(along):
        raise style.PlotError(f"--along {along[0]:g}: the sweep is along amplitude: --amplitude")
    frame = open_frame(results, "poincare")
    runs, classes, structure = frame.runs, frame.classes, frame.structure
    index = palette.motion_index(classes, runs["orbit_period"].values)
    motions = [run_at(frame, value, direction, flag) for value in chosen]
    motions += [find_period(runs, classes, period, direction) for period in periods]
    motions = sorted(dict.fromkeys(motions), key=lambda m: (m.along, m.direction))
    shown = coordinates(structure, floors)
    columns = len(shown)
    size = max(WIDTH * columns, MIN_WIDTH), 1.5 * len(motions) + 1.0 + 0.3 * (columns < 3)
    figure, axes = style.new_grid(len(motions), columns, size, sharex="col")
    for row, motion in enumerate(motions):
        label, colour = _label(frame, motion, row), palette.MOTION_COLOURS[index[motion]]
        _row(dict(zip(shown, axes[row], strict=True)), frame, motion, label, colour)
    for motion, row in zip(motions, axes, strict=True):
        for coordinate, axis in zip(shown, row, strict=True):
            _stops(axis, coordinate.stops(frame.study.structure_at(motion.along)))
    for coordinate, axis in zip(shown, axes[-1], strict=True):
        axis.set_xlabel(labels.displacement(structure, coordinate.symbol), fontsize=9)
    _legend(figure, frame, {index[motion] for motion in motions})
    return style.head(figure, frame.caption, fontsize=9)


def find_period(frame, classes: np.ndarray, period: int, direction: str | None = None) -> DrawnRun:
    """Return a motion of an orbit period: the middle of its longest stretch of amplitudes.

    Motions with impact are preferred; of equal stretches, the first direction's.

    Parameters
    ----------
    frame : xarray.Dataset
        One frame.
    classes : ndarray of int, shape (n_directions, n_amplitudes)
        `MotionClass` of its runs.
    period : int
    direction : {"up", "down"}, optional
        Default any.

    Raises
    ------
    PlotError
        If there is none; the message lists the periods that occur.
    """
    periods = frame["orbit_period"].values
    kinds = (MotionClass.PERIODIC, MotionClass.NO_CONTACT)
    usable = np.isin(classes, kinds) & (periods > 0)
    if direction is not None:
        place = style.direction_index(frame["direction"].values, direction)
        usable &= (np.arange(len(periods)) == place)[:, None]
    for kind in kinds:
        here = usable & (classes == kind) & (periods == period)
        stretches = [
            (end - start, d, start)
            for d, row in enumerate(here)
            for start, end in style.stretches(row)
            if row[start]
        ]
        if stretches:
            length, d, start = max(stretches, key=lambda stretch: stretch[0])
            return DrawnRun(d, start + (length - 1) // 2)
    occur = ", ".join(str(p) for p in np.unique(periods[usable])) or "none"
    swept = f"the sweep {direction}" if direction else "the sweeps"
    raise style.PlotError(
        f"--period {period}: not in {swept} of this frame; periods that occur: {occur}"
    )


def run_at(frame: Frame, value: float, direction: str | None, flag: str) -> DrawnRun:
    """Return the run of a frame nearest to a value along its path."""
    along = frame.along
    step = float(np.diff(along).max()) if along.size > 1 else 0.0
    if not along[0] - step <= value <= along[-1] + step:
        raise style.PlotError(
            f"--{flag} {value:g}: the sweep goes from {along[0]:g} to {along[-1]:g}"
        )
    place = int(np.argmin(np.abs(along - value)))
    motion = DrawnRun(style.direction_index(frame.runs["direction"].values, direction), place)
    if not frame.done[motion]:
        raise style.PlotError(f"--{flag} {value:g}: that run is not complete")
    return motion


def orbit_curves(frame, motion: DrawnRun, structure) -> tuple[np.ndarray, np.ndarray]:
    """Integrate a motion again from each of its stroboscopic points.

    Restarting from every point keeps a chaotic curve on the computed motion.

    Returns
    -------
    points : ndarray, shape (k, 2n)
    curves : ndarray, shape (k, n_samples, 2n)
        Curve j goes from point j to point j + 1; after the last point to its successor.
    """
    count = min(int(frame["n_points"].values[motion]), MAX_CYCLES)
    from hpcsweep.solvers.trajectory import trajectory  # imports the compiler

    points = frame["poincare"].values[motion][:count]
    run = frame.isel({frame["outcome"].dims[-1]: motion.along})
    amplitude, omega = float(run["amplitude"]), float(run["omega"])
    curves = np.array([trajectory(structure, amplitude, omega, point) for point in points])
    return points, curves


def _row(axes, frame: Frame, motion: DrawnRun, label: str, colour: str) -> None:
    """Draw one motion on the axes of its floors."""
    points, curves = orbit_curves(frame.runs, motion, frame.study.structure_at(motion.along))
    many = len(points) > 16
    width, alpha = (0.25, 0.6) if many else (0.9, 1.0)
    looks = {"color": colour, "linewidth": width, "alpha": alpha, "rasterized": many}
    dots = {"mfc": "white", "mec": "black", "ms": 2.2 if many else 4, "mew": 0.4 if many else 0.8}
    for coordinate, axis in axes.items():
        for curve in curves:
            axis.plot(coordinate.of(curve), coordinate.of(curve, True), **looks)
        axis.plot(coordinate.of(points), coordinate.of(points, True), "o", zorder=4, **dots)
        style.draw_lattice(axis)
        axis.tick_params(labelsize=8)
        axis.set_ylabel(labels.velocity(frame.structure, coordinate.symbol), fontsize=8)
    where = {"xycoords": "axes fraction", "textcoords": "offset points", "annotation_clip": False}
    first = next(iter(axes.values()))
    first.annotate(label, (0, 1), (-48, 4), fontsize=8, va="bottom", ha="left", **where)


def _stops(axis, stops: tuple[list[float], list[float]]) -> None:
    """Draw the nearest stops on the right and on the left, hatched beyond."""
    low, high = axis.get_xlim()
    width = high - low
    for side, places in zip((1, -1), stops, strict=True):
        if not places:
            continue
        place = min(places, key=lambda x: side * x)
        if not max(place - high, low - place) <= NEAR_STOP * max(width, abs(place)):
            continue
        axis.axvline(place, color="black", linewidth=1.2, zorder=3)
        room = place + side * max(0.04 * width, 0.08 * abs(place))
        low, high = min(low, room), max(high, room)
        beyond = place + side * 10 * (high - low)
        axis.axvspan(*sorted((place, beyond)), zorder=0, **BEYOND)
    axis.set_xlim(low, high)


def words_of_run(frame: Frame, motion: DrawnRun) -> str:
    """Return where a run is, and what its motion is."""
    runs, period = frame.runs, int(frame.runs["orbit_period"].values[motion])
    name = f"P{period}" if period else CLASS_NAMES[MotionClass(int(frame.classes[motion]))]
    if "contact" in runs and frame.structure.contacts:
        contact = int(runs["contact"].values[motion])
        name += f", {style.set_name(contact, frame.structure.contact_labels)}"
    if "shakedown" in runs and (slides := int(runs["shakedown"].values[motion])):
        name += f",{shakedown_name(slides)}"
    direction = str(runs["direction"].values[motion.direction])
    dim = frame.study.run_dims[-1]
    where = f"{labels.typeset(dim)} = {float(frame.along[motion.along]):.5g}"
    return f"{where}, {direction}: {name}"


def _label(frame: Frame, motion: DrawnRun, row: int) -> str:
    letter = chr(ord("a") + row) if row < 26 else str(row + 1)
    return f"({letter}) {words_of_run(frame, motion)}"


def _legend(figure, frame: Frame, drawn: set[int]) -> None:
    from matplotlib.patches import Patch

    motions = palette.motions_of(frame.structure)
    handles = [
        *(labels.key(motions[place][0], color=motions[place][1]) for place in sorted(drawn)),
        labels.dot("stroboscopic points", "black", face="white"),
    ]
    if frame.structure.contacts:
        handles.append(Patch(label="beyond the stop", **BEYOND))
    style.foot(figure, handles, frame.results, frame.classes)
