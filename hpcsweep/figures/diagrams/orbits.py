"""Panels of stroboscopic displacements over the parameter of a sweep, one a floor."""

from collections.abc import Sequence

import numpy as np

from hpcsweep.figures import fitting, labels, palette, style
from hpcsweep.model.description import stops

SINGLE, PANEL, PAGE = 3.4, 1.75, 8.75
"""Height of a panel alone, of one of several, and of all of them where there are many (inches)."""
FINE, FINE_KEY = 0.1, 3
"""Area of the points of a motion that does not repeat, in areas of an orbit's, and their size in
the legend."""


def floor_panels(structure, floors: Sequence[int | str], label: str = ""):
    """Make a figure of floors (see `labels.choose_floors`), the top one uppermost.

    The horizontal axis is that of the amplitude, unless it has another `label`.

    Returns
    -------
    figure, dict of int to axis
        By floor, from 0, downwards.
    """
    shown = labels.choose_floors(structure.floor_names, floors)[::-1]
    height = PANEL * len(shown) if len(shown) > 1 else SINGLE
    figure, axes = style.new_figure(len(shown), 1.2 + min(height, PAGE))
    for floor, axis in zip(shown, axes, strict=True):
        at = "" if height > PAGE else "(jT)"
        axis.set_ylabel(labels.displacement(structure, floor, at))
        axis.margins(y=0.08)
    axes[-1].set_xlabel(label or labels.parameter(structure, "amplitude"))
    return figure, dict(zip(shown, axes, strict=True))


def orbit_area(frame) -> float:
    """Return the area of the points of orbits (points^2): the smaller, the more runs."""
    return float(np.clip(14000 / max(frame["outcome"].shape[-1], 1), 0.4, 7.0))


def scatter(axis, frame, runs: np.ndarray, floor: int, **looks) -> None:
    """Draw the stroboscopic points of some runs of a frame, an array of bool, of a floor."""
    counts = frame["n_points"].values[runs]
    if counts.size:
        along = frame[frame["outcome"].dims[-1]].broadcast_like(frame["n_points"])
        along = along.transpose(*frame["n_points"].dims).values[runs]
        points = frame["poincare"].values[..., floor][runs]
        there = np.arange(points.shape[-1]) < counts[:, None]
        axis.scatter(np.repeat(along, counts), points[there], rasterized=True, **looks)


def scatter_motions(axis, frame, index: np.ndarray, floor: int, fine: float, orbit: float) -> None:
    """Draw the points of all runs in the colours of their motions: of orbits above, of other area.

    Parameters
    ----------
    index : ndarray of int
        Of each run, in `palette.MOTIONS`.
    floor : int
        From 0.
    fine, orbit : float
        Areas of the points of motions that do not repeat, and of orbits (points^2).
    """
    orbits = frame["orbit_period"].values > 0
    for place, colour in enumerate(palette.MOTION_COLOURS):
        for repeats, area in ((False, fine), (True, orbit)):
            runs = (index == place) & (orbits == repeats)
            looks = {"s": area, "color": colour, "linewidths": 0, "zorder": 3 if repeats else 2}
            scatter(axis, frame, runs, floor, **looks)


def motion_keys(structure, index: np.ndarray, marker: str, size: float) -> list:
    """Return legend keys of the motions that occur in `index`."""
    return [
        fitting.dot(name, colour, marker, size)
        for place, (name, colour) in enumerate(palette.motions_of(structure))
        if (index == place).any()
    ]


def mark_stops(axis, structures: Sequence, floor: int, along=()) -> None:
    """Draw the floor's stops within the panel, of one structure or of each `along` the axis."""
    limits = axis.get_ylim()
    looks = {"color": palette.STOP, "linewidth": 0.8, "linestyle": (0, (5, 3)), "zorder": 1}
    places = np.array([[*right, *left] for right, left in (stops(s, floor) for s in structures)])
    for stop in places.T:
        if len(stop) == 1 and limits[0] < stop[0] < limits[1]:
            axis.axhline(stop[0], **looks)
        elif len(stop) > 1:
            axis.plot(along, stop, **looks)
    axis.set_ylim(limits)
