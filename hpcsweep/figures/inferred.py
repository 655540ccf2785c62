"""What figures show of points that are inferred from their cells, and how they say so."""

from collections.abc import Mapping

import numpy as np

from hpcsweep.dynamics.classify import MOTION
from hpcsweep.figures.style import PlotError, classes_of, percent
from hpcsweep.studies.refine.refinement import LABELS, Source, refinement_of
from hpcsweep.studies.refine.variables import CELL, SOURCE, inferred_name

VARIABLES = (SOURCE, CELL, *(inferred_name(v) for names in LABELS.values() for v in names))
"""Of results of refined maps, beside those of all runs."""
OUTLINE = "0.35"


def inferred(results, variable: str | None = None) -> np.ndarray:
    """Return where results hold an inferred value, of a variable or at all; shape of the runs."""
    shape = results["outcome"].shape
    if SOURCE not in results or (variable and inferred_name(variable) not in results):
        return np.zeros(shape, bool)
    return results[SOURCE].values == Source.INFERRED


def filled(results, variable: str, computed: np.ndarray | None = None) -> np.ndarray:
    """Return a variable with inferred values where they are known, beside the computed ones."""
    values = results[variable].values if computed is None else computed
    where = inferred(results, variable)
    return (
        np.where(where, results[inferred_name(variable)].values, values) if where.any() else values
    )


def filled_classes(results) -> tuple[np.ndarray, np.ndarray]:
    """Return motion classes and orbit periods of all runs, computed or inferred."""
    return filled(results, MOTION, classes_of(results)), filled(results, "orbit_period")


def note_of(results) -> str:
    """Say on a line how much of a map is inferred, and how much of that is wrong; '' if nothing."""
    where = inferred(results)
    if not where.any():
        return ""
    text = f"{percent(1 - float(where.mean()))} of the points computed, the others inferred"
    audit: Mapping | None = results.attrs.get("audit")
    if audit:
        text += f"; {percent(audit['low'])} to {percent(audit['high'])} of these wrong (95 %)"
    return text


def need_cells(frames) -> None:
    """Refuse a file of a map that is not refined.

    Raises
    ------
    PlotError
    """
    if refinement_of(frames.study) is None:
        raise PlotError(f"{frames.path}: --cells: has no cells: its job has no study.refine")


def draw_cells(axis, results) -> None:
    """Outline the cells from which points are inferred; none until the map is complete."""
    if not inferred(results).any():
        return
    from matplotlib.collections import PolyCollection

    levels, where = results[CELL].values[0], inferred(results)[0]
    row, column = np.nonzero(where)
    last = np.array(levels.shape) - 1
    size = 2 ** levels[where].astype(int)
    place = np.minimum(np.stack((row, column)), last[:, None] - 1) // size * size
    begin, size = np.split(np.unique(np.vstack((place, size)), axis=1), [2])
    end = np.minimum(begin + size, last[:, None])
    omega, amplitude = results["omega"].values, results["amplitude"].values
    low, high = (np.stack((amplitude[k[1]], omega[k[0]]), axis=1) for k in (begin, end))
    corners = np.stack(
        (low, np.stack((high[:, 0], low[:, 1]), 1), high, np.stack((low[:, 0], high[:, 1]), 1)), 1
    )
    limits = axis.get_xlim(), axis.get_ylim()
    cells = PolyCollection([*corners], facecolors="none", edgecolors=OUTLINE, linewidths=0.25)
    axis.add_collection(cells, autolim=False)
    axis.set(xlim=limits[0], ylim=limits[1])
