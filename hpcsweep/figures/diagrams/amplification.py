"""Largest response of each building over that without contacts, against the intensity.

Median, and 16 to 84 %.
"""

import numpy as np

from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.solvers.offers import LINEAR
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import stripes_of

NAME = "pounding"
DRAWS = "responses"
OPTIONS = (responses.RESPONSE,)
load = responses.load


def draw(results, response: str = "drift"):
    """Draw a band for each building."""
    whole = responses.opened(results, response, None)
    structure = style.structure_of(results)
    if not structure.contacts:
        raise style.PlotError("--kind pounding: the structure has no contacts")
    if not LINEAR.of(structure):
        raise style.PlotError(
            "--kind pounding: without contacts the file knows the elastic motion alone, no measure "
            "of what yields: vary pounding.gap up to one that is never reached, and compare both"
        )
    if whole.alone is None:
        raise style.PlotError(
            "the file holds no responses without contacts: set output.alone = true"
        )
    study = style.study_of(results, Records)
    dim = "storey" if response == "drift" else "floor"
    figure, (axis,) = style.new_figure(1, 4.2)
    axis.axhline(1.0, color="0.4", linewidth=0.8)
    ratios = {}
    for building in responses.buildings(results[dim].values):
        stripes = stripes_of(results, study, response, building or None)
        ratios[building] = median_band(stripes.values / np.asarray(stripes.alone))
    edge = responses.edge_of(*ratios.values())
    for series, (building, (low, median, high)) in enumerate(ratios.items()):
        ends = [np.minimum(part, edge or np.inf) for part in (low, high)]
        looks = {"color": palette.series_colour(series)}
        axis.fill_between(whole.intensity, *ends, alpha=0.2, linewidth=0, **looks)
        axis.plot(whole.intensity, median, label=f"building {building}".strip(), **looks)
    label = whole.label.partition("  [")[0]
    axis.set_ylabel(f"{label}, over that: {responses.alone(results)}", fontsize=8)
    axis.set(xlabel=whole.measure, xlim=(0, whole.intensity[-1]), ylim=(0, edge))
    beyond = ", beyond the edge where records collapse" * bool(edge)
    responses.legend(axis, f"{len(whole.records)} records, 16 to 84 %{beyond}")
    return style.head(figure, responses.title(results), fontsize=9)
