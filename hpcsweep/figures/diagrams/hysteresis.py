"""Hysteresis loops: the force of each slider against its elongation, of one record at one scale."""

import math

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.studies.ground_motion.records import Records

NAME = "hysteresis"
DRAWS = "responses"
HELP = """\
force of each slider against its elongation, of one record at one intensity; needs the record"""
OPTIONS = (responses.RECORD, responses.SCALE, responses.PLACE)
IN_A_ROW = 4
"""Panels."""


def load(frames, **_options):
    """Read the facts about the records of one structure."""
    return frames.gather(["outcome"])


def draw(results, record: str | None = None, scale: float | None = None, place: str | None = None):
    """Draw the loops of all sliders, or of one."""
    from hpcsweep.solvers.response import history

    study = style.study_of(results, Records)
    structure, names = study.structure, study.structure.slider_names
    if not names:
        raise style.PlotError("--kind hysteresis: the structure has no sliders, nothing yields")
    if place is not None and place not in names:
        raise style.PlotError(f"--place {place}: must be a slider, of {', '.join(names)}")
    i, at = responses.record_index(results, record), responses.scale_index(results, scale)
    samples = responses.samples_of(study, i)
    seen = history(structure, samples, float(study.factor[i, at]), study.tail)
    shown = [names.index(place)] if place else range(len(names))
    columns = min(len(shown), IN_A_ROW)
    rows = math.ceil(len(shown) / columns)
    size = 1.0 + 2.6 * columns, 0.6 + 2.3 * rows
    figure, axes = style.new_grid(rows, columns, size, sharex=True, sharey=True)
    elongation = seen.displacement @ structure.slider_directions.T
    for axis, j in zip(axes.flat, shown, strict=False):
        yields = structure.sliders[j].strength / structure.sliders[j].stiffness
        ductility = np.abs(elongation[:, j]).max() / yields
        axis.plot(elongation[:, j], seen.slider_force[:, j], color=palette.series_colour(0), lw=0.7)
        axis.set_title(f"{names[j]}, ductility {ductility:.2g}", fontsize=9)
        axis.grid(True, color="0.92", linewidth=0.6)
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel("force" + labels.unit(structure, "force"), fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("elongation" + labels.unit(structure, "length"), fontsize=8)
    return style.head(figure, f"{samples.name},  {responses.at_scale(study, at)}", fontsize=9)
