"""Where impact lowers and raises the drift, for chaos and for period 1."""

import numpy as np

from hpcsweep.dynamics.classify import MotionClass, tells_chaos
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.fitting import area
from hpcsweep.figures.options import DIRECTION
from hpcsweep.solvers.offers import LINEAR

NAME = "benefit"
DRAWS = "motions"
OPTIONS = (DIRECTION,)
LEVELS = (0.8, 1.0, 1.25)
"""Ratios of drift with impact to drift without at which the shade changes."""
SHADES = (
    ("other motion", palette.OTHER_MOTION),
    ("no contact", palette.NO_CONTACT),
    (r"beneficial, $r \leq$ 0.8", palette.RATIOS[0]),
    (r"beneficial, 0.8 < $r \leq$ 1", palette.RATIOS[1]),
    (r"adverse, 1 < $r \leq$ 1.25", palette.RATIOS[2]),
    (r"adverse, $r$ > 1.25", palette.RATIOS[3]),
)
"""(name, colour)."""


load = mesh.open_map


def draw(results, direction: str | None = None):
    """Draw the two maps of one direction.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    structure = style.structure_of(results)
    style.demand(LINEAR, structure, f"--kind {NAME}", "map")
    style.need(results, "drift", "contact")
    if not tells_chaos(results):
        style.need(results, "lyapunov")
    results = mesh.by_frequency(results, direction)
    classes = style.classes_of(results)
    ratio = drift_ratio(results)[0]
    period = results["orbit_period"].values[0]
    panels = (
        ("(a) chaotic impacting", classes[0] == MotionClass.CHAOTIC),
        ("(b) P1 impacting", (classes[0] == MotionClass.PERIODIC) & (period == 1)),
    )
    size = 3.6, min(4.3, mesh.map_height(results, 6.4))
    figure, axes = mesh.panels(len(panels), size, size)
    for axis, (name, chosen) in zip(axes, panels, strict=True):
        _panel(axis, results, classes[0], chosen, ratio, name)
    mesh.finish(axes, results)
    handles = [area(name, colour) for name, colour in (*SHADES[2:], *SHADES[:2])]
    style.foot(figure, handles + mesh.map_keys(results), results, classes, 4)
    title = f"{style.caption(results)},  {style.words_of(results)}"
    meaning = r"$r$ = drift with the stop / drift without it"
    return style.head(figure, title, meaning, fontsize=9)


def free_drift(structure, omega: float) -> float:
    """Return the normalised drift (18) of the steady state without stop, in A/Omega^2.

    Closed form, `Structure.steady_drift`; NaN at an undamped resonance.
    """
    try:
        return float(omega**2 * structure.steady_drift(omega))
    except ZeroDivisionError:
        return np.nan


def drift_ratio(results) -> np.ndarray:
    """Return the drift over the drift without stop at the same A and Omega, shape of the runs."""
    structure = style.structure_of(results)
    free = np.array([free_drift(structure, float(omega)) for omega in results["omega"].values])
    return results["drift"].values / free[None, :, None]


def _panel(axis, results, classes, chosen, ratio, name) -> None:
    index = np.zeros(classes.shape, int)
    index[classes == MotionClass.NO_CONTACT] = 1
    rated = chosen & np.isfinite(ratio)
    index[rated] = 2 + np.searchsorted(LEVELS, ratio[rated], side="left")
    index[np.isin(classes, (MotionClass.NOT_COMPUTED, MotionClass.FAILED))] = -1
    mesh.grid_of(results).fill(axis, index, [colour for _, colour in SHADES])
    count = int(rated.sum())
    note = "no such run"
    if count:
        share = style.percent(float((ratio[rated] <= 1).mean()))
        note = f"beneficial: {share} of {count} runs"
    axis.set_title(f"{name}\n{note}", fontsize=9)
