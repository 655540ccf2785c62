"""Peak drift of each storey, displacement and acceleration of each floor, against the amplitude.

Also force and impacts of each contact; one frame.
"""

from collections.abc import Sequence

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.figure import load_frame, open_frame
from hpcsweep.figures.measures import held_measures, measure_of
from hpcsweep.figures.options import AMPLITUDES, DIRECTION, OMEGA
from hpcsweep.model.reduction import physical
from hpcsweep.studies.quantities import MEASURES

NAME = "measures"
DRAWS = "motions"
OPTIONS = (OMEGA, AMPLITUDES, DIRECTION)
MAX_LINES = 10
"""Storeys, floors or contacts that are drawn, the first."""
load = load_frame


def draw(
    results,
    omega: float | None = None,
    direction: str | None = None,
    amplitudes: Sequence[float] = (),
):
    """Draw the frame nearest to `omega`, along that to an amplitude, default the first.

    Raises
    ------
    PlotError
        If the file holds none of them.
    """
    shown = held_measures(results)
    if not shown:
        asked = ", ".join(f"output.{name}" for name in MEASURES)
        raise style.PlotError(f"the file holds none of them: set one of {asked} to true in the job")
    swept = [style.direction_index(results, direction)]
    frame = open_frame(results.isel(direction=swept), omega, amplitudes=amplitudes)
    structure, runs, done = frame.structure, frame.runs.isel(direction=0), frame.done[0]
    over_amplitude = frame.study.run_dims[-2:] == ("omega", "amplitude")
    graze = style.grazing_amplitude(structure, frame.omega) if over_amplitude else np.inf
    grazes = frame.along[0] <= graze <= frame.along[-1]
    figure, axes = style.new_figure(len(shown), 1.2 + 2.3 * len(shown))
    for axis, name in zip(axes, shown, strict=True):
        measure = measure_of(results, structure, name)
        for place in physical(results[measure.dim].values.tolist())[:MAX_LINES]:
            values = runs[name].isel({measure.dim: place}).where(done) * measure.factor[place]
            looks = {"markersize": 3, "linewidth": 0.8, "color": palette.series_colour(place)}
            axis.plot(frame.along, values, ".-", label=measure.places[place], **looks)
        axis.set_ylabel(measure.label + measure.unit)
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=7, frameon=False, ncols=2)
        if grazes:
            axis.axvline(graze, color=palette.STOP, linewidth=0.8, linestyle="--")
    axes[-1].set_xlabel(labels.along(frame.study) + ",  dashed: grazing" * bool(grazes))
    return style.head(figure, f"{frame.caption},  {style.words_of(frame.results)}", fontsize=9)
