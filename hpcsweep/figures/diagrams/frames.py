"""Orbit diagrams of several frames of a sweep."""

import re
from collections.abc import Sequence

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import sweep
from hpcsweep.figures.diagrams.mesh import COLUMNS, panels
from hpcsweep.figures.fitting import dot
from hpcsweep.figures.options import DIRECTION, FLOORS, figure_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.grid import RunGrid

MAX_FRAMES = 12
ORBIT = 2.5
"""Area of the points of an orbit, in areas of those of a motion that does not repeat."""
ONE = 4.8, 2.75
"""Width and height (inches) of a figure of one panel, for its words."""
MAX_COLUMNS = 7
"""Columns of the legend."""


def load(reader, **_options):
    """Read the frames to draw."""
    return reader.gather([*reader], choose(reader.study.frames).tolist())


@figure_of("frames", "motions", load, DIRECTION, FLOORS)
def frames(results, direction: str | None = None, floors: Sequence[int | str] = ()):
    """Small orbit diagrams of all frames, or of 12 of them, of one floor (default: the top).

    Parameters
    ----------
    results : xarray.Dataset
    direction : {"up", "down"}, optional
        Default the first.
    floors : sequence of int or str, optional
        The one floor whose displacement is drawn, from 1; default the top one.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    style.need(results, "poincare")
    study = style.study_of(results, RunGrid)
    style.need_amplitudes(study)
    structure, name = study.structure, study.run_dims[-2]
    if len(floors) > 1:
        raise style.PlotError(f"--floor {floors[1]}: --kind frames shows one floor")
    floor = labels.choose_floors(structure.floor_names, floors)[-1] + 1
    chosen = choose(results[name].values)
    shown = {name: chosen, "direction": [style.direction_index(results, direction)]}
    results = results.isel(shown)
    classes = style.classes_of(results)
    motions = palette.motion_index(classes[0], results["orbit_period"].values[0])
    figure, axes = panels(len(chosen), ONE, (2.4, 1.75), (0.0, 1.0), sharey=False)
    for place, axis in enumerate(axes):
        _panel(axis, results.isel({name: place, "direction": 0}), motions[place], floor - 1)
        words = {"omega": r"$\Omega$ = {:.4g}", "amplitude": "$A$ = {:.4g}"}.get(name, "")
        axis.set_title(words.format(float(results[name][place])), fontsize=8.5, pad=3)
    figure.supylabel(labels.displacement(structure, floor - 1, "(jT)"), fontsize=10)
    for axis in axes[-COLUMNS:]:
        axis.set_xlabel(re.sub("^forcing (amplitude|frequency) ", "", labels.along(study)))
        axis.tick_params(labelbottom=True)
    _legend(figure, results, classes, motions)
    caption = style.caption(results, more=labels.path_words(study, results))
    title = f"{caption},  {style.words_of(results)}"
    return style.head(figure, title, fontsize=8.5)


def choose(omegas: np.ndarray) -> np.ndarray:
    """Return frames spread evenly over frequency, in order, at most `MAX_FRAMES`."""
    count = min(omegas.size, MAX_FRAMES)
    return np.argsort(omegas, kind="stable")[
        np.linspace(0, omegas.size - 1, count).round().astype(int)
    ]


def _panel(axis, frame, motions, floor: int) -> None:
    along = frame[frame["outcome"].dims[-1]].values
    size = float(np.clip(300 / max(along.size, 1), 0.5, 4.0))
    done = np.where(frame["outcome"].values == Outcome.COMPLETE, motions, -1)
    sweep.scatter_motions(axis, frame, done, floor, size, ORBIT * size)
    style.draw_lattice(axis)
    axis.tick_params(labelsize=8)
    style.limit_amplitudes(axis, along)


def _legend(figure, results, classes, motions) -> None:
    structure, failed = style.structure_of(results), classes[0] == MotionClass.FAILED
    handles = sweep.motion_keys(structure, np.where(failed, -1, motions), "o", 4)
    if failed.any():
        handles.append(dot("failed: blank", "none"))
    style.foot(figure, handles, results, classes, min(len(handles), MAX_COLUMNS))
