"""Force of each storey that yields against its drift, and of other sliders; needs the record.

Of one record at one intensity. Of a storey, and of bearings, that is the force of the slider and of
the elastic spring beside it, less what P-Delta takes; of another slider its own.
"""

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import mesh, responses
from hpcsweep.model.buildings import COLUMN
from hpcsweep.model.isolation import SLAB
from hpcsweep.model.structure import Structure
from hpcsweep.studies.ground_motion.records import Records

NAME = "hysteresis"
DRAWS = "responses"
OPTIONS = (responses.RECORD, responses.SCALE, responses.PLACE, responses.TIME)
load = responses.load_run
IN_A_ROW = 4
"""Panels."""
EACH, MORE = (2.6, 2.3), (1.0, 0.6)
"""Inches of a panel, and of what is beside all ..."""
ONE = EACH[0] + MORE[0], EACH[1] + MORE[1]
"""... of a figure of one."""


def springs(structure: Structure) -> np.ndarray:
    """Return the stiffness of the elastic spring beside each slider of a storey, or of bearings."""
    stiffness = structure.elastic_stiffness
    for i, name in enumerate(structure.floor_names):
        if COLUMN in name:
            column = stiffness[i] / np.sqrt(stiffness[i, i])
            stiffness = stiffness - np.outer(column, column)
    rows = dict(zip(structure.storey_names, structure.drift_rows.tolist(), strict=True))
    elastic = np.zeros(len(structure.sliders))
    for k, (name, slider) in enumerate(zip(structure.slider_names, structure.sliders, strict=True)):
        ends = np.flatnonzero(slider.direction)
        if rows.get(name) == list(slider.direction) or name.endswith(SLAB):
            # two floors, or one and the ground
            elastic[k] = -stiffness[ends[0], ends[1]] if ends.size > 1 else stiffness[ends[0]].sum()
    return elastic


def draw(
    results,
    record: str | None = None,
    scale: float | None = None,
    place: str | None = None,
    time: tuple[float, float] | None = None,
):
    """Draw the loops of all sliders, or of one."""
    study = style.study_of(results, Records)
    structure, names = study.structure, study.structure.slider_names
    if not names:
        raise style.PlotError("--kind hysteresis: the structure has no sliders, nothing yields")
    responses.check_place(place, names, "a slider, of")
    i, at = responses.record_index(results, record), responses.scale_index(results, scale)
    seen = responses.history_of(study, (i, at), time)
    shown = [names.index(place)] if place else range(len(names))
    figure, axes = mesh.panels(len(shown), ONE, EACH, MORE, columns=IN_A_ROW)
    elongation = seen.displacement @ structure.slider_directions.T
    forces = seen.slider_force + springs(structure) * elongation
    x_unit, length = labels.sized(structure, "length", elongation[:, shown])
    y_unit, force = labels.sized(structure, "force", forces[:, shown])
    for axis, j in zip(axes, shown, strict=True):
        ductility = np.abs(elongation[:, j]).max() / structure.sliders[j].limit
        loop = elongation[:, j] / length, forces[:, j] / force
        axis.plot(*loop, color=palette.series_colour(0), lw=0.7)
        name = f"storey {names[j]}" if names[j].isdigit() else names[j]
        axis.set_title(f"{name}, ductility {ductility:.1f}", fontsize=9)
        axis.grid(True, color="0.92", linewidth=0.6)
    for axis in axes[::IN_A_ROW]:
        axis.set_ylabel("force" + y_unit, fontsize=8)
    for axis in axes[(len(axes) - 1) // IN_A_ROW * IN_A_ROW :]:
        axis.set_xlabel("drift" + x_unit, fontsize=8)
    return style.head(figure, responses.run_title(results, study, i, at), fontsize=9)
