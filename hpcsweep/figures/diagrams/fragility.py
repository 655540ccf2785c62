"""Share of records whose response reaches a threshold, against the intensity.

Counted by their capacities, with the lognormal curve of largest likelihood and its 95 % band,
dashed beyond the stripes; without contacts (elastic, where something yields) the counted curve,
which is exact at any intensity, and the intensity that half of the records reach.
"""

import numpy as np

from hpcsweep.earthquakes.stripes import Capacity, fractiles
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.options import UNITS
from hpcsweep.studies.ground_motion.stripes import COLLAPSE, capacities, fit

NAME = "fragility"
DRAWS = "responses"
OPTIONS = (
    *(responses.THRESHOLD, responses.COLLAPSES, responses.RESPONSE, responses.PLACE),
    UNITS,
)
POINTS = 400
BEYOND, FARTHEST = 1.1, 3.0
"""Of the axis over the largest median, or exact capacity, beyond the stripes; over these at most,
unless all is exact."""
load = responses.load


def draw(
    results,
    threshold: float | None = None,
    response: str = "drift",
    place: str | None = None,
    collapse: bool = False,
    units: str | None = None,
):
    """Draw shares and curves.

    Raises
    ------
    PlotError
        If there is no threshold, or none that some stripes reach and others do not.
    """
    if collapse:
        threshold, response = 1.0, COLLAPSE
    if threshold is None:
        raise style.PlotError("--threshold is missing: the response that is a failure")
    stripes = responses.opened(results, response, place, units)
    reached, fitted = capacities(stripes, threshold), fit(stripes, threshold)
    figure, (axis,) = style.new_figure(1, 4.2)
    touches = responses.touches(stripes)
    colour = palette.series_colour(0)
    n_runs = (~np.isnan(stripes.values)).sum(axis=0)
    shares = (stripes.values >= threshold).sum(axis=0) / np.maximum(n_runs, 1)
    axis.plot(stripes.intensity, shares, "o", color=colour, markersize=3)
    last, exact = stripes.intensity[-1], stripes.alone is stripes.values
    middles = [fitted.median]
    if touches:
        free = capacities(stripes, threshold, alone=True)
        middles.append(fractiles(free.scale, (0.5,)).item())
    farthest = min(BEYOND * max(middles), FARTHEST * last)
    if exact:
        farthest = BEYOND * reached.scale[np.isfinite(reached.scale)].max()
    edge = max(last, farthest)
    fine = np.linspace(stripes.intensity[0] / 10, edge, POINTS)
    low, high = fitted.band(fine)
    axis.fill_between(fine, low, high, color=colour, alpha=0.2, linewidth=0)
    label = rf"median {fitted.median:.4g}, $\beta$ = {fitted.dispersion:.3f}"
    curve, inside = fitted.probability(fine), (fine <= last) | exact
    axis.plot(fine[inside], curve[inside], color=colour, label=label)
    axis.plot(fine[~inside], curve[~inside], "--", color=colour)
    _count(axis, reached, edge if exact else last, color=colour, linewidth=0.6)
    if touches:
        name = f"{responses.alone(results)}, counted, 50 % at {middles[-1]:.4g}"
        _count(axis, free, edge, color=palette.STOP, label=name)
    reach = f"share of records that reach {threshold:g} {stripes.unit}".rstrip()
    reach = "share of records that collapse" if collapse else reach
    axis.set(xlabel=stripes.measure, ylabel=reach)
    axis.set(xlim=(0, edge), ylim=(0, 1.02))
    never = int(np.isinf(reached.scale).sum())
    words = responses.counted(stripes) + f", {never} above the last stripe" * bool(never)
    responses.legend(axis, f"{stripes.label}\n{words}")
    return style.head(figure, responses.title(results), fitted.caution or "", fontsize=9)


def _count(axis, capacity: Capacity, highest: float, **looks) -> None:
    """Draw the share of records whose capacity is at most the intensity."""
    scale = capacity.scale[~np.isnan(capacity.scale)]
    at = np.sort(scale[scale <= highest])
    shares = np.arange(at.size + 1) / scale.size
    axis.step([0.0, *at, highest], [*shares, shares[-1]], where="post", **looks)
