"""Fragility: the share of records that reach a threshold at each intensity, and its curve."""

import numpy as np

from hpcsweep.earthquakes.stripes import Capacity, fractiles
from hpcsweep.figures import palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.studies.ground_motion.stripes import COLLAPSE, StripesError, capacities, fit

NAME = "fragility"
DRAWS = "responses"
HELP = """\
share of records whose response reaches a threshold, against the intensity, counted by their
capacities, with the lognormal curve of largest likelihood and its 95 % band; without contacts
the counted curve, which is exact"""
OPTIONS = (responses.THRESHOLD, responses.COLLAPSES, responses.RESPONSE, responses.PLACE)
POINTS = 400
load = responses.load


def draw(
    results,
    threshold: float | None = None,
    response: str = "drift",
    place: str | None = None,
    collapse: bool = False,
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
    stripes = responses.opened(results, response, place)
    try:
        own, found = capacities(stripes, threshold), fit(stripes, threshold)
    except StripesError as error:
        given = "--collapse" if collapse else f"--threshold {threshold:g}"
        raise style.PlotError(f"{given}: {error}") from None
    figure, (axis,) = style.new_figure(1, 4.2)
    touches = responses.touches(stripes)
    colour = palette.series_colour(0)
    known = (~np.isnan(stripes.values)).sum(axis=0)
    shares = (stripes.values >= threshold).sum(axis=0) / np.maximum(known, 1)
    axis.plot(stripes.intensity, shares, "o", color=colour, markersize=3)
    fine = np.linspace(stripes.intensity[0] / 10, stripes.intensity[-1], POINTS)
    low, high = found.band(fine)
    axis.fill_between(fine, low, high, color=colour, alpha=0.2, linewidth=0)
    label = rf"median {found.median:.4g}, $\beta$ = {found.dispersion:.3f}"
    axis.plot(fine, found.probability(fine), color=colour, label=label)
    _count(axis, own, fine[-1], color=colour, linewidth=0.6)
    if touches:
        free = capacities(stripes, threshold, alone=True)
        (median,) = fractiles(free.scale, (0.5,))
        name = f"{responses.alone(results)}, counted  median {median:.4g}"
        _count(axis, free, fine[-1], color=palette.STOP, label=name)
    reach = f"share of records that reach {threshold:g} {stripes.unit}".rstrip()
    reach = "share of records that collapse" if collapse else reach
    axis.set(xlabel=stripes.measure, ylabel=reach)
    axis.set(xlim=(0, stripes.intensity[-1]), ylim=(0, 1.02))
    responses.legend(axis, stripes.label)
    return style.head(figure, responses.title(results), found.caution or "", fontsize=9)


def _count(axis, found: Capacity, highest: float, **looks) -> None:
    """Draw the share of records whose capacity is at most the intensity."""
    scale = found.scale[~np.isnan(found.scale)]
    at = np.sort(scale[scale <= highest])
    shares = np.arange(at.size + 1) / scale.size
    axis.step([0.0, *at, highest], [*shares, shares[-1]], where="post", **looks)
