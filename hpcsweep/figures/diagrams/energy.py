"""Work of the ground, and where it is, over time, of one record at one intensity; needs the record.

Taken by sliders, contacts and damping, kinetic and strain energy.
"""

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.solvers.history import SAME_STEP
from hpcsweep.studies.ground_motion.records import Records

NAME = "energy"
DRAWS = "responses"
OPTIONS = (responses.RECORD, responses.SCALE)
load = responses.load_run
PARTS = {"sliders": [5], "contacts": [4], "damping": [3], "kinetic and strain": [1, 2]}
"""Fields of an `Energy`, from below."""


def draw(results, record: str | None = None, scale: float | None = None):
    """Draw the parts over each other, and the work of the ground, which is their sum."""
    from hpcsweep.solvers.instants import InstantMap

    i, at = responses.record_index(results, record), responses.scale_index(results, scale)
    study = style.study_of(results, Records)
    structure, samples = study.structure, responses.samples_of(study, i)
    count = samples.n_samples - 1 + int(study.tail / samples.dt + SAME_STEP)
    try:
        solver = InstantMap(structure, samples.dt, energy=True)
    except ValueError as error:
        raise style.PlotError(f"--kind energy: {error}") from None
    steps = solver.energies(samples.acceleration.copy(), float(study.factor[i, at]), count)
    energies, time = np.array(steps), samples.dt * np.arange(len(steps))
    unit, size = labels.sized(structure, "energy", energies)
    parts = {name: energies[:, fields].sum(axis=1) / size for name, fields in PARTS.items()}
    parts = {name: values for name, values in parts.items() if values.any()}
    figure, (axis,) = style.new_figure(1, 4.2)
    colours = [palette.series_colour(series) for series in range(len(parts))]
    axis.stackplot(time, *parts.values(), labels=[*parts], colors=colours, alpha=0.6, linewidth=0)
    axis.plot(time, energies[:, 0] / size, color="0.1", lw=0.9, label="work of the ground")
    axis.set(xlabel="time" + labels.unit(structure, "time"), ylabel="energy" + unit)
    axis.set(xlim=(0, time[-1]), ylim=(0, None))
    responses.legend(axis, reverse=True)
    return style.head(figure, responses.run_title(results, study, i, at), fontsize=9)
