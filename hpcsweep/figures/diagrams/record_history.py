"""One record at one intensity over time: the ground and two facing floors; needs the record.

Displacements with and without contacts, the gap and the force between them (the largest since the
instant before: contacts may be shorter), and absolute accelerations.
"""

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.model.reduction import physical
from hpcsweep.studies.ground_motion.describe import elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records

NAME = "history"
DRAWS = "responses"
OPTIONS = (responses.RECORD, responses.SCALE, responses.PLACE, responses.TIME)


def load(frames, **_options):
    """Read the facts about the records of one structure, and the forces."""
    return frames.gather(["contact_force", "storey_drift", "outcome", *responses.COLLAPSE_NAMES])


def draw(
    results,
    record: str | None = None,
    scale: float | None = None,
    place: str | None = None,
    time: tuple[float, float] | None = None,
):
    """Draw the history of a contact, that of the largest force."""
    i, at = responses.record_index(results, record), responses.scale_index(results, scale)
    study = style.study_of(results, Records)
    samples = responses.samples_of(study, i)
    structure, factor = study.structure, float(study.factor[i, at])
    names = list(structure.contact_names.values())
    responses.check_place(place, names, "a contact, of")
    seen = responses.history_of(study, (i, at), time)
    shown, k = physical(structure.floor_names)[-1:], names.index(place) if place else 0
    if names:
        if place is None:
            k = int(seen.peak_force.max(axis=0).argmax())
        moved = np.flatnonzero(structure.directions[k]).tolist()
        shown = [i for i in physical(structure.floor_names) if i in moved] or moved
    figure, axes = style.new_figure(5 if names else 3, 8.8 if names else 6.2, 7.6)

    def panel(axis, label: str, columns, quantity: str = "1", **looks) -> float:
        """Draw columns, one a line, in a unit that suits them; return how much of it is one."""
        unit, size = labels.sized(structure, quantity, columns)
        for series, column in enumerate(columns.T):
            colour = {"color": palette.series_colour(series), "lw": 0.8}
            axis.plot(seen.time, column / size, **colour | looks)
        axis.set_ylabel(label + unit, fontsize=8)
        return size

    ground = factor / study.gravity * np.interp(seen.time, samples.times, samples.acceleration)
    ground[seen.time > samples.times[-1]] = 0.0
    panel(axes[0], "ground  [g]", ground[:, None], color="0.3", lw=0.6)
    panel(axes[-1], "absolute\nacceleration  [g]", seen.acceleration[:, shown] / study.gravity)
    size = panel(axes[1], "displacement", seen.displacement[:, shown], "length")
    for line, floor in zip(axes[1].lines, shown, strict=True):
        line.set_label(structure.floor_names[floor])
    if names:
        free = responses.history_of(study, (i, at), time, structure.without_contacts())
        for line, column in zip(axes[1].lines[:], free.displacement[:, shown].T, strict=True):
            axes[1].plot(free.time, column / size, ":", color=line.get_color(), lw=0.7)
        axes[1].plot([], [], ":", color=palette.STOP, label="no contact")
        gap, force = structure.contacts[k].gap - seen.approach[:, [k]], seen.peak_force[:, [k]]
        touch = palette.series_colour(2)
        panel(axes[2], f"gap {names[k]}", gap, "length", color="0.3")
        axes[2].axhline(0.0, color=touch, lw=0.8)
        panel(axes[3], f"force {names[k]}", force, "force", color=touch, drawstyle="steps-pre")
        pushes = {"where": force[:, 0] > 0.0, "color": touch, "alpha": 0.2, "linewidth": 0.6}
        for axis in axes[1:3]:
            axis.fill_between(seen.time, 0, 1, transform=axis.get_xaxis_transform(), **pushes)
    beside = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.0}
    axes[1].legend(frameon=False, fontsize=7, ncols=4, **beside)
    unit = labels.unit(structure, "time")
    axes[-1].set(xlabel="time" + unit, xlim=(seen.time[0], seen.time[-1]))
    note = elastic_words(elastic_drift(results.isel(record=[i], scale=[at]), structure))
    return style.head(figure, responses.run_title(results, study, i, at), note, fontsize=9)
