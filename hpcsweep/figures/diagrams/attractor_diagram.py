"""Orbit diagram of all attractors of one frequency: displacement against forcing amplitude."""

from collections.abc import Sequence

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.attractors import attractor_classes
from hpcsweep.figures.diagrams import orbits
from hpcsweep.figures.diagrams.figure import load_frame
from hpcsweep.figures.fitting import dot, legend_below
from hpcsweep.figures.options import FLOORS, OMEGA
from hpcsweep.studies.attractors.attractors import AttractorGrid
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.report import starting_range

NAME = "attractors"
DRAWS = "attractors"
HELP = """\
stroboscopic displacement of each floor on all attractors against the forcing
amplitude, one frame"""
OPTIONS = (OMEGA, FLOORS)
load = load_frame
MAX_RANGES = 2
"""Ranges of the starts that are written out."""
MAX_COLUMNS = 6
"""Columns of the legend."""


def draw(results, omega: float | None = None, floors: Sequence[int | str] = ()):
    """Draw one frame; colours show the motion.

    Parameters
    ----------
    results : xarray.Dataset
    omega : float, optional
        The frame nearest to this frequency; default the first.
    floors : sequence of int or str, optional
        Shown, see `labels.choose_floors`.

    Raises
    ------
    PlotError
        If there is nothing to draw.
    """
    frame, index, structure = opened(results, omega)
    figure, axes = orbits.floor_panels(structure, floors)
    size = orbits.orbit_area(frame)
    for floor, axis in axes.items():
        orbits.scatter_motions(axis, frame, index, floor, orbits.FINE * size, size)
        orbits.mark_stops(axis, [structure], floor)
    style.limit_amplitudes(axis, frame["amplitude"].values)
    legend(figure, frame, index, starts_text(frame), MAX_COLUMNS)
    return style.head(figure, style.caption(results, float(frame["omega"])))


def opened(results, omega: float | None):
    """Return the frame nearest to a frequency; refuse it if nothing is computed.

    Returns
    -------
    frame, `motions_of` it, Structure

    Raises
    ------
    PlotError
    """
    style.need_amplitudes(style.job_of(results).study)
    place = style.nearest_frame(results["omega"].values, omega)
    frame = results.isel(direction=0, omega=place)
    if not (frame["outcome"].values > 0).any():
        raise style.PlotError("no point of this frame is computed yet")
    return frame, motions_of(frame), style.structure_of(results)


def motions_of(frame) -> np.ndarray:
    """Return the index in `palette.MOTIONS` of each attractor, -1 where there is none.

    Returns
    -------
    ndarray of int, shape (n_amplitudes, n_attractors)
    """
    return palette.motion_index(attractor_classes(frame), frame["orbit_period"].values)


def starts_words(study: AttractorGrid) -> str:
    """Format the number of starts of a point, and where they lie."""
    box = [line.replace("omega_0", labels.WORD) for line in starting_range(study)]
    where = " and ".join(box) if len(box) <= MAX_RANGES else "a box, each floor its own range"
    return f"{study.starts:,} starts a point: {where}"


def starts_text(results) -> str:
    """Format the starts, and the shares of them that reached no attractor of the file."""
    study = style.study_of(results, AttractorGrid)
    done = max(int((results["outcome"].values > 0).sum()), 1) * study.starts
    parts = []
    for name in UNSTORED:
        count = int(results[f"n_{name}"].values.sum())
        if count or name == "undecided":
            parts.append(f"{name} {style.percent(count / done)}")
    return f"{starts_words(study)}; {', '.join(parts)}"


def legend(figure, frame, index: np.ndarray, title: str, columns: int, further=()) -> None:
    """Put the motions, further keys, and a title, below the panels."""
    handles = orbits.motion_keys(index, "s", 5)
    if (frame["orbit_period"].values[index >= 0] == 0).any():
        handles.append(dot("no orbit", "0.3", ".", orbits.FINE_KEY))
    legend_below(figure, [*handles, *further], title, columns)
