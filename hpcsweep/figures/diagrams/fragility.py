"""Fragility: the share of records that reach a threshold at each intensity, and its curve."""

from pathlib import Path

import numpy as np

from hpcsweep.campaign.stripes import fit
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.palette import STOP, series_colour
from hpcsweep.figures.style import PlotError, head, new_figure, save

NAME = "fragility"
DRAWS = "responses"
HELP = """\
share of records whose response reaches a threshold, against the intensity, with the
lognormal curve of largest likelihood and its 95 % band; the same without contacts"""
OPTIONS = (responses.THRESHOLD, responses.RESPONSE, responses.PLACE)
POINTS = 400
load = responses.load


def draw(
    results,
    path: Path,
    threshold: float | None = None,
    response: str | None = None,
    place: str | None = None,
) -> None:
    """Draw shares and curves, and write them to `path`.

    Raises
    ------
    PlotError
        If there is no threshold, or none that some stripes reach and others do not.
    """
    if threshold is None:
        raise PlotError("--threshold is missing: the response that is a failure")
    stripes = responses.opened(results, response, place)
    figure, (axis,) = new_figure(1, 4.2)
    cases = [("with contacts" if responses.touches(stripes) else "", stripes.values)]
    if responses.touches(stripes):
        cases.append(("without", np.asarray(stripes.alone)))
    fine = np.linspace(stripes.intensity[0] / 10, stripes.intensity[-1], POINTS)
    for name, values in cases:
        own = values is stripes.values
        colour = series_colour(0) if own else STOP
        shares = (values >= threshold).mean(axis=0)
        axis.plot(stripes.intensity, shares, "o", color=colour, markersize=3)
        try:
            found = fit(stripes._replace(values=values), threshold)
        except ValueError as error:
            if own:
                raise PlotError(f"--threshold {threshold:g}: {error}") from None
            continue
        low, high = found.band(fine)
        axis.fill_between(fine, low, high, color=colour, alpha=0.2, linewidth=0)
        label = rf"{name}  median {found.median:.4g}, $\beta$ = {found.dispersion:.3f}".strip()
        axis.plot(fine, found.probability(fine), color=colour, label=label)
    axis.set_xlabel(stripes.measure)
    axis.set_ylabel(f"share of records that reach {threshold:g} {stripes.unit}".rstrip())
    axis.set_xlim(0, stripes.intensity[-1])
    axis.set_ylim(0, 1.02)
    axis.legend(frameon=False, fontsize=8, title=stripes.label, title_fontsize=8)
    head(figure, responses.title(results), fontsize=9)
    save(figure, path)
