"""Response of each record against the intensity, with the 16, 50 and 84 % fractiles.

Also the 50 % of the motion without contacts (elastic, where something yields); flat lines to the
edge where a structure collapses.
"""

import numpy as np

from hpcsweep.earthquakes.stripes import response_fractiles
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.options import UNITS

NAME = "ida"
DRAWS = "responses"
OPTIONS = (responses.RESPONSE, responses.PLACE, UNITS)
load = responses.load


def draw(results, response: str = "drift", place: str | None = None, units: str | None = None):
    """Draw the curves of all records, intensity upwards."""
    stripes = responses.opened(results, response, place, units)
    figure, (axis,) = style.new_figure(1, 5.0)
    intensity = np.append(0.0, stripes.intensity)
    shown = [response_fractiles(stripes.values)]
    if responses.touches(stripes):
        shown.append(response_fractiles(stripes.alone, (0.5,)))
    edge, beyond = responses.within(stripes.values, *shown)
    edge = edge or responses.edge_of(stripes.values, *shown)

    def curve(values, *dashes, **looks) -> None:
        x, y = np.append(0.0, values), intensity
        if np.isinf(values).any():
            at = int(np.isinf(x).argmax())
            x = np.insert(x, at, np.array((x[at - 1], edge)))
            y = np.insert(y, at, (0.5 * (y[at - 1] + y[at]),) * 2)
        axis.plot(x, y, *dashes, **looks)

    responses.draw_suite(curve, stripes.values, response_fractiles)
    for (median,) in shown[1:]:
        label = f"50 %, {responses.alone(results)}"
        curve(median, ":", color=palette.STOP, linewidth=2.0, label=label)
    axis.set(xlabel=stripes.label, ylabel=stripes.measure, xlim=(0, edge), ylim=(0, intensity[-1]))
    responses.legend(axis, responses.counted(stripes), handlelength=3.5)
    return style.head(figure, responses.title(results), beyond, fontsize=9)
