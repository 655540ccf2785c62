"""Drift and mean modal norms along the path of one frame, with those without a stop."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.benefit import free_drift
from hpcsweep.figures.diagrams.figure import Frame, load_frame, open_frame
from hpcsweep.figures.measures import RUN_LABELS
from hpcsweep.figures.options import AMPLITUDES, OMEGA
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.sweep.amplitude_sweep import DOWN

NAME = "metrics"
DRAWS = "motions"
OPTIONS = (OMEGA, AMPLITUDES)
load = load_frame
DASHES = ((0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1, 2)), (0, (1, 1)), (0, (8, 2, 1, 2, 1, 2)))


def draw(results, omega: float | None = None, amplitudes: Sequence[float] = ()):
    """Draw the frame nearest to `omega`, along that to an amplitude, default the first.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    frame = open_frame(results, omega, "drift", "modal_norm", amplitudes=amplitudes)
    runs, span = frame.runs, frame.along
    figure, axes = style.new_figure(2, 6.6)
    _drift(axes[0], frame, _along_path(frame, free_drift))
    _norms(axes[1], frame, _along_path(frame, free_modal_norms))
    axes[1].set_xlabel(labels.along(frame.study))
    axes[1].set_xlim(span[0], span[-1] if span.size > 1 else span[0] + 1e-9)
    style.letter(axes)
    axes[0].legend(fontsize=8, markerscale=1.5)
    handles = axes[1].get_legend_handles_labels()[0]
    # a column for each direction and one without stop: legends are filled column by column
    n_columns = runs.sizes["direction"] + 1
    handles = [handle for k in range(n_columns) for handle in handles[k::n_columns]]
    style.foot(figure, handles, frame.results, frame.classes, n_columns)
    return style.head(figure, frame.caption)


def _along_path(frame: Frame, of: Callable) -> np.ndarray:
    """Return what a structure has at a frequency without its stops, at each place of a path."""
    omegas = np.broadcast_to(frame.runs["omega"].values, frame.along.shape).tolist()
    kept = lru_cache(of)
    return np.array([kept(frame.study.structure_at(at), omega) for at, omega in enumerate(omegas)])


def free_modal_norms(structure, omega: float) -> np.ndarray:
    """Return the mean modal norms (17) of the steady state without stop, shape (n,).

    They do not depend on the amplitude; NaN at an undamped resonance.
    """
    # imports scipy.linalg, which no other figure needs
    from hpcsweep.solvers.linear import LinearOrbit

    orbit = LinearOrbit(structure.without_contacts(), omega)
    try:
        structure.steady_harmonics(omega)
    except ZeroDivisionError:
        return np.full(structure.n_floors, np.nan)
    small = 1e-3 * structure.length_unit * structure.frequency_unit**2
    seen = orbit.window(small)
    return np.full(structure.n_floors, np.nan) if seen is None else seen.modal_norm


def _without(frame: Frame) -> str:
    return "elastic, " * (not LINEAR.of(frame.structure)) + "without stop"


def _drift(axis, frame: Frame, free: np.ndarray) -> None:
    chaotic = dict(palette.MOTIONS)[CLASS_NAMES[MotionClass.CHAOTIC]]
    names, drifts = frame.runs["direction"].values.tolist(), frame.runs["drift"].values
    for direction, drift, row in zip(names, drifts, frame.classes, strict=True):
        chaos, marker = row == MotionClass.CHAOTIC, style.MARKERS[direction]
        for chosen, colour, label in (
            (~chaos, palette.DIRECTIONS[direction], direction),
            (chaos, chaotic, f"{direction}, chaotic"),
        ):
            if chosen.any():
                _plot(axis, frame.along[chosen], drift[chosen], marker, colour, direction, label)
    looks = {"color": "black", "linewidth": 1.1, "linestyle": DASHES[0]}
    _free(axis, frame.along, free, label=_without(frame), **looks)
    axis.set_ylabel(RUN_LABELS["drift"])


def _plot(axis, x, y, marker: str, colour: str, direction: str, label: str) -> None:
    """Draw points, hollow on the way down."""
    face = "none" if direction == DOWN else colour
    looks = {"color": colour, "markerfacecolor": face, "markersize": 2.4, "markeredgewidth": 0.5}
    axis.plot(x, y, marker, label=label, **looks)


def _free(axis, along: np.ndarray, values: np.ndarray, **looks) -> None:
    """Draw what is without stop, right across where it does not change along the path."""
    constant = labels.common(values)
    if constant is None:
        axis.plot(along, values, **looks)
    else:
        axis.axhline(constant, **looks)


def _norms(axis, frame: Frame, free: np.ndarray) -> None:
    runs, names = frame.runs, frame.runs["direction"].values.tolist()
    shown = min(runs.sizes["mode"], labels.MAX_MODES)
    for mode in range(shown):
        colour, marker = palette.mode_colour(mode, shown), "os^D<>pX*h"[mode % 10]
        for direction, norm in zip(names, runs["modal_norm"].values, strict=True):
            label = f"mode {mode + 1}, {direction}"
            _plot(axis, frame.along, norm[:, mode], marker, colour, direction, label)
        looks = {"color": colour, "linewidth": 1.1, "linestyle": DASHES[mode % len(DASHES)]}
        label = f"mode {mode + 1}, {_without(frame)}"
        _free(axis, frame.along, free[:, mode], label=label, **looks)
    axis.set_ylabel(RUN_LABELS["modal_norm"])
    if shown < runs.sizes["mode"]:
        title = f"the lowest {shown} of {runs.sizes['mode']} modes"
        axis.set_title(title, loc="right", fontsize=9)
