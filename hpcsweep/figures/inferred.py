"""What figures show of points that are inferred from their cells, and how they say so."""

from collections.abc import Iterable, Mapping

import numpy as np

from hpcsweep.dynamics.classify import CLASS_NAMES, MOTION, MotionClass
from hpcsweep.figures import palette, style
from hpcsweep.studies.refine.audit import CELL, SOURCE, inferred_name
from hpcsweep.studies.refinement import LABELS, Source

VARIABLES = (SOURCE, CELL, *{inferred_name(v): 0 for names in LABELS.values() for v in names})
"""Of results of refined maps, beside those of all runs."""
APERIODIC = tuple(CLASS_NAMES[k] for k in (MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC))
OUTLINES = (("white", 0.55), ("0.25", 0.2))
"""Colours and widths (points) of an outline, the upper one last: it shows on light and dark."""


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


def filled_classes(results, computed=None) -> tuple[np.ndarray, np.ndarray]:
    """Return motion classes and orbit periods of all runs, computed or inferred.

    Where the period alone is inferred, a motion without one is undecided.

    Parameters
    ----------
    results : xarray.Dataset
    computed : ndarray of int, optional
        Classes of the computed runs; by default they are classified.
    """
    computed = style.classes_of(results) if computed is None else computed
    kinds, periods = filled(results, MOTION, computed), filled(results, "orbit_period")
    if is_by_period(results):
        classes = np.where(periods > 0, MotionClass.PERIODIC, MotionClass.UNDECIDED)
        if inferred_name("contact") in results:
            free = results[inferred_name("contact")].values == 0
            classes = np.where(free, MotionClass.NO_CONTACT, classes)
        kinds = np.where(inferred(results), classes, kinds)
    return kinds, periods


def is_by_period(results) -> bool:
    """Return whether a map is refined by the period, and not by the class of motion."""
    return inferred_name("orbit_period") in results and inferred_name(MOTION) not in results


def drawn_classes(results) -> tuple[np.ndarray, np.ndarray]:
    """Return `filled_classes` for a map; refined by the period, all without one are undecided."""
    kinds, periods = filled_classes(results)
    if is_by_period(results):
        without = (kinds >= MotionClass.LONG_PERIOD) & (kinds <= MotionClass.UNDECIDED)
        kinds = np.where(without, MotionClass.UNDECIDED, kinds)
    return kinds, periods


def drawn_motions(by_period: bool, structure) -> list[tuple[str, str]]:
    """Return `palette.motions_of` as `drawn_classes` calls them, '' where there are none."""
    undecided = CLASS_NAMES[MotionClass.UNDECIDED]
    words = {undecided: "no period found", **dict.fromkeys(APERIODIC, "")} if by_period else {}
    return [(words.get(name, name), colour) for name, colour in palette.motions_of(structure)]


def share_note(share: float) -> str:
    """Format what share of a map is inferred; '' if nothing is."""
    return (
        f"{style.percent(1 - share)} of the points computed, the others inferred" if share else ""
    )


def note_of(results) -> str:
    """Say on a line how much of a map is inferred, and how much of that is wrong; '' if nothing."""
    text = share_note(float(inferred(results).mean()))
    if not text:
        return ""
    audit: Mapping | None = results.attrs.get("audit")
    if audit:
        low, high = style.percent(audit["low"]), style.percent(audit["high"])
        text += f"; {low} to {high} of these wrong (95 %)"
    return text


def gather(frames, names: Iterable[str], cells: bool | None = None, **options):
    """Read variables, of a refined map also what is inferred, with its audit as an attribute.

    Parameters
    ----------
    frames : hpcsweep.store.Frames
    names : iterable of str
    cells : bool, optional
        Whether its cells will be outlined.
    **options
        Of `Frames.gather`.

    Raises
    ------
    PlotError
        If there are no cells to outline.
    """
    if cells and frames.study.refine is None:
        raise style.PlotError("--cells: has no cells: its job has no study.refine")
    return frames.gather((*names, *VARIABLES), **options).assign_attrs(frames.audit())


def draw_cells(axis, results, vertical: np.ndarray, horizontal: np.ndarray) -> None:
    """Outline the cells from which points are inferred; none until the map is complete.

    Parameters
    ----------
    vertical, horizontal : ndarray
        Values of the axes of the map.
    """
    if not inferred(results).any():
        return
    from matplotlib.collections import PolyCollection

    levels, where = results[CELL].values[0], inferred(results)[0]
    row, column = np.nonzero(where)
    last = np.array(levels.shape) - 1
    size = 2 ** np.abs(levels[where].astype(int))
    place = np.minimum(np.stack((row, column)), last[:, None] - 1) // size * size
    begin, size = np.split(np.unique(np.vstack((place, size)), axis=1), [2])
    end = np.minimum(begin + size, last[:, None])
    x, y = (at[np.stack((begin[k], end[k]))] for k, at in ((1, horizontal), (0, vertical)))
    corners = np.stack((x[[0, 1, 1, 0]], y[[0, 0, 1, 1]]), axis=2).swapaxes(0, 1)
    for colour, width in OUTLINES:
        cells = PolyCollection([*corners], facecolors="none", edgecolors=colour, linewidths=width)
        axis.add_collection(cells, autolim=False)
