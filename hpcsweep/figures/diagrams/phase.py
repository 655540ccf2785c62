"""Phase portraits of the floors, with stroboscopic points and their stops."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.figure import load_frame
from hpcsweep.figures.options import DIRECTION, FLOORS, OMEGA, Option
from hpcsweep.model.description import stops
from hpcsweep.solvers.outcome import Outcome


def _period(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, is {text}")
    return value


NAME = "phase"
DRAWS = "motions"
HELP = "phase portraits of the floors at --amplitude A ... or of orbit --period P ..."
OPTIONS = (
    OMEGA,
    Option(
        "--amplitude", "amplitudes drawn", dest="amplitudes", type=float, nargs="+", metavar="A"
    ),
    Option(
        "--period",
        "orbit periods; an example of each is found in the sweep",
        dest="periods",
        type=_period,
        nargs="+",
        metavar="P",
    ),
    DIRECTION,
    FLOORS,
)
load = load_frame
WIDTH, MIN_WIDTH, LETTERS = 2.4, 4.8, 13
"""Width of a panel, the least of the figure (inches), and letters of its title on an inch."""
NEAR_STOP = 10
"""A stop is shown where it is not farther from the motion than so many of its widths."""
MAX_CYCLES = 60
"""Forcing periods drawn of a motion that does not repeat: more would fill the panel."""


@dataclass(frozen=True)
class Motion:
    """A run to draw: its index in the frame."""

    direction: int
    amplitude: int


def draw(
    results,
    omega: float | None = None,
    amplitudes: Sequence[float] = (),
    periods: Sequence[int] = (),
    direction: str | None = None,
    floors: Sequence[int] = (),
):
    """Draw motions of one frame, one a row.

    Parameters
    ----------
    results : xarray.Dataset
    omega : float, optional
        The frame nearest to this frequency; default the first.
    amplitudes : sequence of float
        The nearest amplitudes of the sweep are drawn.
    periods : sequence of int
        Orbit periods, for each of which a motion is drawn; see `find_period`.
    direction : {"up", "down"}, optional
        For amplitudes default the first; for periods default any.
    floors : sequence of int, optional
        Shown, from 1; see `labels.choose_floors`.

    Raises
    ------
    PlotError
        If there is no such motion, or the file does not hold the variables to draw.
    """
    style.need(results, "poincare")
    style.need_amplitudes(style.job_of(results).study)
    if not len(amplitudes) and not len(periods):
        raise style.PlotError("--kind phase needs --amplitude or --period")
    results = results.isel(omega=[style.nearest_frame(results["omega"].values, omega)])
    frame = results.isel(omega=0)
    classes = style.classes_of(results)[:, 0]
    motions = [_at_amplitude(frame, value, direction) for value in amplitudes]
    motions += [find_period(frame, classes, period, direction) for period in periods]
    motions = sorted(dict.fromkeys(motions), key=lambda m: (m.amplitude, m.direction))
    structure = style.structure_of(results)
    shown = labels.choose_floors(structure.n_floors, floors)
    columns = len(shown)
    size = max(WIDTH * columns, MIN_WIDTH), 1.5 * len(motions) + 1.0 + 0.3 * (columns < 3)
    figure, axes = style.new_grid(len(motions), columns, size, sharex="col")
    for row, motion in enumerate(motions):
        _row(dict(zip(shown, axes[row], strict=True)), frame, motion, classes, structure, row)
    for row_axes in axes:
        for floor, axis in zip(shown, row_axes, strict=True):
            _stops(axis, structure, floor)
    for floor, axis in zip(shown, axes[-1], strict=True):
        axis.set_xlabel(labels.displacement(structure, floor), fontsize=9)
    _legend(figure, results, classes, {_motion(frame, m, classes) for m in motions})
    title = style.parameters(structure, float(frame["omega"]), int(LETTERS * size[0]))
    return style.head(figure, title, fontsize=9)


def find_period(frame, classes: np.ndarray, period: int, direction: str | None = None) -> Motion:
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
    found = frame["orbit_period"].values
    kinds = (MotionClass.PERIODIC, MotionClass.NO_CONTACT)
    usable = np.isin(classes, kinds) & (found > 0)
    if direction is not None:
        own = np.zeros_like(usable)
        own[style.direction_index(frame, direction)] = True
        usable &= own
    for kind in kinds:
        best, length = None, 0
        for d in range(found.shape[0]):
            here = usable[d] & (classes[d] == kind) & (found[d] == period)
            starts, ends = _stretches(here)
            for start, end in zip(starts, ends, strict=True):
                if end - start > length:
                    best, length = Motion(d, int(start + end - 1) // 2), end - start
        if best is not None:
            return best
    occur = ", ".join(str(p) for p in np.unique(found[usable])) or "none"
    swept = f"the sweep {direction}" if direction else "the sweeps"
    raise style.PlotError(
        f"--period {period}: not in {swept} of this frame; periods that occur: {occur}"
    )


def _stretches(flags: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first and last-plus-one index of every stretch of true flags."""
    change = np.diff(np.concatenate(([0], flags.astype(int), [0])))
    return np.flatnonzero(change == 1), np.flatnonzero(change == -1)


def _at_amplitude(frame, value: float, direction: str | None) -> Motion:
    amplitude = frame["amplitude"].values
    step = float(np.diff(amplitude).max()) if amplitude.size > 1 else 0.0
    if not amplitude[0] - step <= value <= amplitude[-1] + step:
        raise style.PlotError(
            f"--amplitude {value:g}: the sweep goes from {amplitude[0]:g} to {amplitude[-1]:g}"
        )
    motion = Motion(
        style.direction_index(frame, direction), int(np.argmin(np.abs(amplitude - value)))
    )
    if frame["outcome"].values[motion.direction, motion.amplitude] != Outcome.COMPLETE:
        raise style.PlotError(f"--amplitude {value:g}: that run is not complete")
    return motion


def orbit_curves(frame, motion: Motion, structure) -> tuple[np.ndarray, np.ndarray]:
    """Integrate a motion again from each of its stroboscopic points.

    Restarting from every point keeps a chaotic curve on the computed motion.

    Returns
    -------
    points : ndarray, shape (k, 2n)
    curves : ndarray, shape (k, n_samples, 2n)
        Curve j goes from point j to point j + 1; after the last point to its successor.
    """
    at = motion.direction, motion.amplitude
    count = min(int(frame["n_points"].values[at]), MAX_CYCLES)
    from hpcsweep.solvers.trajectory import trajectory  # imports the compiler

    points = frame["poincare"].values[at][:count]
    amplitude, omega = float(frame["amplitude"].values[at[1]]), float(frame["omega"])
    curves = np.array([trajectory(structure, amplitude, omega, point) for point in points])
    return points, curves


def _row(axes, frame, motion: Motion, classes, structure, row: int) -> None:
    points, curves = orbit_curves(frame, motion, structure)
    n = structure.n_floors
    colour = palette.MOTIONS[_motion(frame, motion, classes)][1]
    many = len(points) > 16
    for floor, axis in axes.items():
        for curve in curves:
            axis.plot(
                curve[:, floor],
                curve[:, n + floor],
                color=colour,
                linewidth=0.25 if many else 0.9,
                alpha=0.6 if many else 1.0,
                rasterized=many,
            )
        axis.plot(
            points[:, floor],
            points[:, n + floor],
            linestyle="none",
            marker="o",
            markersize=2.2 if many else 4,
            markerfacecolor="white",
            markeredgecolor="black",
            markeredgewidth=0.4 if many else 0.8,
            zorder=4,
        )
        axis.grid(True, color="0.92", linewidth=0.6)
        axis.set_axisbelow(True)
        axis.tick_params(labelsize=8)
        axis.set_ylabel(labels.velocity(structure, floor), fontsize=8)
    next(iter(axes.values())).annotate(
        _label(frame, motion, classes, structure.contact_labels, row),
        (0, 1),
        xycoords="axes fraction",
        xytext=(-48, 4),
        textcoords="offset points",
        fontsize=8,
        va="bottom",
        ha="left",
        annotation_clip=False,
    )


def _stops(axis, structure, floor: int) -> None:
    """Draw the nearest stops of one floor, hatched beyond."""
    low, high = axis.get_xlim()
    width = high - low
    for side, places in zip((1, -1), stops(structure, floor), strict=True):
        if not places:
            continue
        place = min(places, key=lambda x: side * x)
        if not max(place - high, low - place) <= NEAR_STOP * max(width, abs(place)):
            continue
        axis.axvline(place, color="black", linewidth=1.2, zorder=3)
        room = place + side * max(0.04 * width, 0.08 * abs(place))
        low, high = min(low, room), max(high, room)
        beyond = place + side * 10 * (high - low)
        ends = sorted((place, beyond))
        axis.axvspan(*ends, facecolor="0.88", edgecolor="0.5", hatch="////", zorder=0)
    axis.set_xlim(low, high)


def _motion(frame, motion: Motion, classes) -> int:
    """Return the index of a run's motion in `MOTIONS`."""
    at = motion.direction, motion.amplitude
    return palette.motion_place(
        MotionClass(int(classes[at])), int(frame["orbit_period"].values[at])
    )


def _label(frame, motion: Motion, classes, labels, row: int) -> str:
    at = motion.direction, motion.amplitude
    kind = MotionClass(int(classes[at]))
    period = int(frame["orbit_period"].values[at])
    name = f"P{period}" if period else CLASS_NAMES[kind]
    if "contact" in frame:
        sets = style.contact_name(int(frame["contact"].values[at]), labels, style.LEGEND_ROOM)
        name += ", no contact" if sets == "none" else f", {sets}"
    direction = str(frame["direction"].values[at[0]])
    amplitude = float(frame["amplitude"].values[at[1]])
    letter = chr(ord("a") + row) if row < 26 else str(row + 1)
    return f"({letter}) A = {amplitude:.5g}, {direction}: {name}"


def _legend(figure, results, classes, drawn: set[int]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    style.foot(
        figure,
        [
            *(
                Line2D([], [], color=colour, label=name)
                for place, (name, colour) in enumerate(palette.MOTIONS)
                if place in drawn
            ),
            Line2D(
                [],
                [],
                linestyle="none",
                marker="o",
                markersize=5,
                markerfacecolor="white",
                markeredgecolor="black",
                label="stroboscopic points",
            ),
            Patch(facecolor="0.88", edgecolor="0.5", hatch="////", label="beyond the stop"),
        ],
        results,
        classes,
    )
