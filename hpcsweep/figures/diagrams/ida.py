"""Incremental dynamic analysis: the response of each record at each intensity, and fractiles."""

import numpy as np

from hpcsweep.earthquakes.stripes import fractiles
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses

NAME = "ida"
DRAWS = "responses"
HELP = """\
response of each record against the intensity, with the 16, 50 and 84 % fractiles,
and the median without contacts"""
OPTIONS = (responses.RESPONSE, responses.PLACE)
load = responses.load


def draw(results, response: str = "drift", place: str | None = None):
    """Draw the curves of all records, intensity upwards."""
    stripes = responses.opened(results, response, place)
    figure, (axis,) = style.new_figure(1, 5.0)
    intensity = np.append(0.0, stripes.intensity)

    def curve(values, *dashes, **looks) -> None:
        axis.plot(np.append(0.0, values), intensity, *dashes, **looks)

    responses.draw_suite(curve, stripes.values)
    if responses.touches(stripes):
        (median,) = fractiles(stripes.alone, (0.5,))
        label = f"50 %, {responses.alone(results)}"
        curve(median, ":", color=palette.STOP, linewidth=2.0, label=label)
    axis.set(xlabel=stripes.label, ylabel=stripes.measure, xlim=(0, None), ylim=(0, intensity[-1]))
    responses.legend(axis, f"{len(stripes.records)} records", handlelength=3.5)
    return style.head(figure, responses.title(results), fontsize=9)
