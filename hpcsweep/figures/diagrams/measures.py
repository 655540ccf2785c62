"""Measures of storeys, floors and contacts against the amplitude, one frame."""

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.figure import load_frame
from hpcsweep.figures.measures import LABELS, held_measures, measure_of
from hpcsweep.figures.options import DIRECTION, OMEGA
from hpcsweep.solvers.outcome import Outcome

NAME = "measures"
DRAWS = "motions"
HELP = """\
peak drift of each storey, displacement and acceleration of each floor, force and
impacts of each contact against the amplitude, one frame"""
OPTIONS = (OMEGA, DIRECTION)
MAX_LINES = 10
"""Storeys, floors or contacts that are drawn, the first."""
load = load_frame


def draw(results, omega: float | None = None, direction: str | None = None):
    """Draw the frame nearest to `omega`, default the first.

    Raises
    ------
    PlotError
        If the file holds none of them.
    """
    shown = held_measures(results)
    if not shown:
        asked = ", ".join(f"output.{name}" for name in LABELS)
        raise style.PlotError(f"the file holds none of them: set one of {asked} to true in the job")
    style.need_amplitudes(style.job_of(results).study)
    structure = style.structure_of(results)
    place = style.nearest_frame(results["omega"].values, omega)
    frame = results.isel(omega=place, direction=style.direction_index(results, direction))
    done = frame["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise style.PlotError("no run of this frame is complete yet")
    figure, axes = style.new_figure(len(shown), 1.2 + 2.3 * len(shown))
    for axis, name in zip(axes, shown, strict=True):
        measure = measure_of(results, structure, name)
        for place, words in enumerate(measure.places[:MAX_LINES]):
            values = frame[name].isel({measure.dim: place}).where(done)
            axis.plot(
                frame["amplitude"],
                values * measure.factor[place],
                ".-",
                markersize=3,
                linewidth=0.8,
                color=palette.series_colour(place),
                label=words,
            )
        axis.set_ylabel(measure.label + measure.unit)
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=7, frameon=False, ncols=2)
        graze = structure.grazing_amplitude(float(frame["omega"]))
        if frame["amplitude"].min() <= graze <= frame["amplitude"].max():
            axis.axvline(graze, color=palette.STOP, linewidth=0.8, linestyle="--")
    axes[-1].set_xlabel(labels.amplitude(structure) + ",  dashed: grazing")
    words = style.words_of(results, str(frame["direction"].item()))
    return style.head(
        figure, f"{style.caption(results, float(frame['omega']))},  {words}", fontsize=9
    )
