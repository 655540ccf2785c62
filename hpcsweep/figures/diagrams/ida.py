"""Incremental dynamic analysis: the response of each record at each intensity, and fractiles."""

from pathlib import Path

import numpy as np

from hpcsweep.earthquakes.stripes import PARTS, fractiles
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.palette import STOP, series_colour
from hpcsweep.figures.style import head, new_figure, save

NAME = "ida"
DRAWS = "responses"
HELP = """\
response of each record against the intensity, with the 16, 50 and 84 % fractiles,
and the median without contacts"""
OPTIONS = (responses.RESPONSE, responses.PLACE)
MAX_GREY = 200
"""Records that are drawn one by one."""
load = responses.load


def draw(results, path: Path, response: str | None = None, place: str | None = None) -> None:
    """Draw the curves of all records, intensity upwards, and write them to `path`."""
    stripes = responses.opened(results, response, place)
    figure, (axis,) = new_figure(1, 5.0)
    intensity = np.append(0.0, stripes.intensity)

    def curve(values, *style, **looks) -> None:
        axis.plot(np.append(0.0, values), intensity, *style, **looks)

    for values in stripes.values[:MAX_GREY]:
        curve(values, color="0.75", linewidth=0.6)
    parts = fractiles(stripes.values, PARTS)
    for part, style, values in zip(PARTS, ("--", "-", "-."), parts, strict=True):
        curve(
            values, style, color=series_colour(0), linewidth=2.0, label=f"{100 * part:g} % fractile"
        )
    if responses.touches(stripes):
        (median,) = fractiles(stripes.alone, (0.5,))
        curve(median, ":", color=STOP, linewidth=2.0, label="50 %, no contact")
    axis.set_xlabel(stripes.label)
    axis.set_ylabel(stripes.measure)
    axis.set_xlim(left=0)
    axis.set_ylim(0, intensity[-1])
    axis.legend(
        frameon=False,
        fontsize=8,
        handlelength=3.5,
        title=f"{len(stripes.records)} records",
        title_fontsize=8,
    )
    head(figure, responses.title(results), fontsize=9)
    save(figure, path)
