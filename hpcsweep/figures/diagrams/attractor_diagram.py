"""Stroboscopic displacement of each floor on all attractors of one frame.

Against the forcing amplitude, or what they are continued along.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import orbits
from hpcsweep.figures.diagrams.figure import Frame, lay_branches, load_frame, open_frame
from hpcsweep.figures.fitting import dot, legend_below
from hpcsweep.figures.options import AMPLITUDES, BRANCHES, FLOORS, OMEGA
from hpcsweep.studies.attractors.attractors import AttractorGrid
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.report import starting_range

NAME = "attractors"
DRAWS = "attractors"
OPTIONS = (OMEGA, AMPLITUDES, FLOORS, BRANCHES)
load = load_frame
MAX_RANGES = 2
"""Ranges of the starts that are written out."""
MAX_COLUMNS = 6
"""Columns of the legend."""


def draw(
    results,
    omega: float | None = None,
    floors: Sequence[int | str] = (),
    amplitudes: Sequence[float] = (),
    branches: Path | None = None,
):
    """Draw one frame; colours show the motion.

    Parameters
    ----------
    results : xarray.Dataset
    omega : float, optional
        The frame nearest to this frequency; default the first.
    floors : sequence of int or str, optional
        Shown, see `labels.choose_floors`.
    amplitudes : sequence of float, optional
        One, in place of `omega` for attractors along that.
    branches : Path, optional
        Results file of branches along the same path, drawn beneath.

    Raises
    ------
    PlotError
        If there is nothing to draw.
    """
    frame, runs, index = opened(results, omega, amplitudes)
    figure, axes = orbits.floor_panels(frame.structure, floors, labels.along(frame.study))
    keys, size = lay_branches(axes, frame, branches), orbits.orbit_area(runs)
    for floor, axis in axes.items():
        orbits.scatter_motions(axis, runs, index, floor, orbits.FINE * size, size)
        orbits.mark_stops(axis, frame.study.structures, floor, frame.along)
    style.limit_amplitudes(axis, frame.along)
    legend(figure, runs, index, starts_text(runs), MAX_COLUMNS, keys)
    return style.head(figure, frame.caption)


def opened(results, omega: float | None, amplitudes: Sequence[float] = ()):
    """Choose a frame of attractors, see `open_frame`.

    Returns
    -------
    one : Frame
    runs : xarray.Dataset
        Without the only direction.
    index : ndarray of int, shape (n_along, n_attractors)
        In `palette.MOTIONS` of each attractor, -1 where there is none.
    """
    frame: Frame = open_frame(results, omega, amplitudes=amplitudes)
    runs = frame.runs.isel(direction=0)
    return frame, runs, palette.motion_index(frame.classes[0], runs["orbit_period"].values)


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


def legend(figure, runs, index: np.ndarray, title: str, columns: int, further=()) -> None:
    """Put the motions, further keys, and a title, below the panels."""
    handles = orbits.motion_keys(style.structure_of(runs), index, "s", 5)
    if (runs["orbit_period"].values[index >= 0] == 0).any():
        handles.append(dot("no orbit", "0.3", ".", orbits.FINE_KEY))
    legend_below(figure, [*handles, *further], title, columns)
