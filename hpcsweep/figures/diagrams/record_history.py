"""One record at one scale: displacements of the floors at a contact, and its force, over time.

The force is the largest between two samples: contacts may be shorter.
"""

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.studies.ground_motion.describe import elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records

NAME = "history"
DRAWS = "responses"
HELP = """\
ground, displacements of two facing floors with and without contacts, and the peak force
between them in each sample interval, of one record at one intensity; needs the record"""
OPTIONS = (responses.RECORD, responses.SCALE, responses.PLACE)


def load(frames, **_options):
    """Read the facts about the records of one structure, and the forces."""
    return frames.gather(["contact_force", "storey_drift", "outcome", *responses.COLLAPSE_NAMES])


def draw(results, record: str | None = None, scale: float | None = None, place: str | None = None):
    """Draw the history of a contact, that of the largest force."""
    from hpcsweep.solvers.history import history

    i, at = responses.record_index(results, record), responses.scale_index(results, scale)
    study = style.study_of(results, Records)
    samples = responses.samples_of(study, i)
    structure, factor = study.structure, float(study.factor[i, at])
    seen = history(structure, samples, factor, study.tail)
    free = history(structure.without_contacts(), samples, factor, study.tail)
    names = list(structure.contact_names.values())
    if place is not None and place not in names:
        raise style.PlotError(
            f"--place {place}: must be a contact, of {', '.join(names) or 'none'}"
        )
    floors = structure.floor_names
    figure, axes = style.new_figure(3 if names else 2, 6.2, 7.6)
    ground, moving = axes[:2]
    ground.plot(samples.times, factor * samples.acceleration / study.gravity, color="0.3", lw=0.6)
    ground.set_ylabel("ground  [g]", fontsize=8)
    if names:
        k = names.index(place) if place else int(seen.peak_force.max(axis=0).argmax())
        shown = np.flatnonzero(structure.directions[k]).tolist()
        looks = {"color": palette.series_colour(2), "linewidth": 0.8, "drawstyle": "steps-pre"}
        axes[2].plot(seen.time, seen.peak_force[:, k], **looks)
        axes[2].set_ylabel(f"peak force {names[k]}{labels.unit(structure, 'force')}", fontsize=8)
        for time in seen.time[seen.peak_force[:, k] > 0]:
            moving.axvline(
                time, color=palette.series_colour(2), alpha=0.15, linewidth=0.5, zorder=0
            )
    else:
        shown = [structure.n_floors - 1]
    for series, floor in enumerate(shown):
        colour, name = palette.series_colour(series), floors[floor]
        moving.plot(seen.time, seen.displacement[:, floor], color=colour, lw=0.9, label=name)
        looks = {"color": colour, "linewidth": 0.7, "linestyle": ":"}
        if names:
            moving.plot(free.time, free.displacement[:, floor], **looks)
    if names:
        moving.plot([], [], ":", color=palette.STOP, label="no contact")
    moving.set_ylabel("displacement" + labels.unit(structure, "length"), fontsize=8)
    moving.legend(frameon=False, fontsize=7, ncols=4, loc="upper right")
    axes[-1].set(xlabel="time" + labels.unit(structure, "time"), xlim=(0, seen.time[-1]))
    note = elastic_words(elastic_drift(results.isel(record=[i], scale=[at]), structure))
    return style.head(figure, responses.run_title(results, study, i, at), note, fontsize=9)
