"""Drift and mean modal norms of one frame against the amplitude, with those without a stop."""

from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.benefit import free_drift
from hpcsweep.figures.diagrams.figure import load_frame, open_frame
from hpcsweep.figures.options import OMEGA
from hpcsweep.studies.sweep.amplitude_sweep import DOWN

NAME = "metrics"
DRAWS = "motions"
HELP = "drift and mean modal norms against the amplitude, one frame"
OPTIONS = (OMEGA,)
load = load_frame
DASHES = ((0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1, 2)), (0, (1, 1)), (0, (8, 2, 1, 2, 1, 2)))


def draw(results, omega: float | None = None):
    """Draw the frame nearest to `omega`, default the first.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    one = open_frame(results, omega, "drift", "modal_norm")
    frame, structure = one.runs, one.structure
    figure, axes = style.new_figure(2, 6.6)
    _drift(axes[0], frame, one.classes, free_drift(structure, one.omega))
    _norms(axes[1], frame, free_modal_norms(structure, one.omega))
    axes[1].set_xlabel(labels.amplitude(structure))
    span = frame["amplitude"].values
    axes[1].set_xlim(span[0], span[-1] if span.size > 1 else span[0] + 1e-9)
    style.letter(axes)
    axes[0].legend(fontsize=8, markerscale=1.5)
    handles = axes[1].get_legend_handles_labels()[0]
    # a column for each direction and one without stop: legends are filled column by column
    n_columns = frame.sizes["direction"] + 1
    handles = [handle for k in range(n_columns) for handle in handles[k::n_columns]]
    style.foot(figure, handles, one.results, one.classes, n_columns)
    return style.head(figure, style.caption(one.results, one.omega))


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


def _drift(axis, frame, classes, free: float) -> None:
    amplitude = frame["amplitude"].values
    for d, direction in enumerate(frame["direction"].values):
        name = str(direction)
        chaos = classes[d] == MotionClass.CHAOTIC
        for chosen, colour, label in (
            (~chaos, palette.DIRECTIONS[name], name),
            (
                chaos,
                palette.MOTION_COLOURS[palette.motion_place(MotionClass.CHAOTIC, 0)],
                f"{name}, chaotic",
            ),
        ):
            if not chosen.any():
                continue
            axis.plot(
                amplitude[chosen],
                frame["drift"].values[d][chosen],
                label=label,
                **_looks(style.MARKERS[name], colour, name),
            )
    axis.axhline(free, color="black", linewidth=1.1, linestyle=DASHES[0], label="without stop")
    axis.set_ylabel(r"normalised drift $\delta$  [$A/\Omega^2$]")


def _looks(marker: str, colour: str, direction: str) -> dict[str, Any]:
    """Return the style of points, hollow on the way down."""
    face = "none" if direction == DOWN else colour
    size = {"markersize": 2.4, "markeredgewidth": 0.5}
    return {"ls": "none", "marker": marker, "color": colour, "markerfacecolor": face, **size}


def _norms(axis, frame, free: np.ndarray) -> None:
    amplitude = frame["amplitude"].values
    shown = min(frame.sizes["mode"], labels.MAX_MODES)
    for mode in range(shown):
        colour = palette.mode_colour(mode, shown)
        for d, direction in enumerate(frame["direction"].values):
            axis.plot(
                amplitude,
                frame["modal_norm"].values[d, :, mode],
                label=f"mode {mode + 1}, {direction}",
                **_looks("os^D<>pX*h"[mode % 10], colour, str(direction)),
            )
        axis.axhline(
            free[mode],
            color=colour,
            linewidth=1.1,
            linestyle=DASHES[mode % len(DASHES)],
            label=f"mode {mode + 1}, without stop",
        )
    axis.set_ylabel(r"mean modal norm $\eta_j$ free of contact")
    if shown < frame.sizes["mode"]:
        title = f"the lowest {shown} of {frame.sizes['mode']} modes"
        axis.set_title(title, loc="right", fontsize=9)
