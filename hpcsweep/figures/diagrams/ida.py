"""Incremental dynamic analysis: the response of each record at each intensity, and fractiles."""

from pathlib import Path

import numpy as np

from hpcsweep.campaign.stripes import RESPONSES, Stripes, StripesError, stripes_of
from hpcsweep.earthquakes.stripes import PARTS, fractiles
from hpcsweep.figures.options import Option
from hpcsweep.figures.palette import STOP, series_colour
from hpcsweep.figures.style import PlotError, caption, head, new_figure, save, structure_of

NAME = "ida"
DRAWS = "responses"
HELP = """\
response of each record against the intensity, with the 16, 50 and 84 % fractiles,
and the median without contacts"""
RESPONSE = Option(
    "--response",
    "what is drawn (default: drift)",
    "response",
    {"choices": tuple(RESPONSES)},
)
PLACE = Option(
    "--place",
    "storey, floor or contact, or a building, of which it is (default: the largest of all)",
    "place",
    {"metavar": "NAME"},
)
OPTIONS = (RESPONSE, PLACE)
MOST_GREY = 200
"""Records that are drawn one by one."""


def load(frames, **_options):
    """Read all responses of one structure."""
    return frames.gather([*frames])


def opened(results, response: str | None, place: str | None) -> Stripes:
    """Return the stripes that are to be drawn."""
    try:
        found = stripes_of(results, structure_of(results), response or "drift", place)
    except StripesError as error:
        raise PlotError(f"--{error}" if "response" in str(error)[:9] else str(error)) from None
    if not np.isfinite(found.values).any():
        raise PlotError("no run is complete yet")
    return found


def draw(results, path: Path, response: str | None = None, place: str | None = None) -> None:
    """Draw the curves of all records, intensity upwards, and write them to `path`."""
    stripes = opened(results, response, place)
    figure, (axis,) = new_figure(1, 5.0)
    for values in stripes.values[:MOST_GREY]:
        axis.plot(values, stripes.intensity, color="0.75", linewidth=0.6)
    for part, style, curve in zip(
        PARTS, ("--", "-", "--"), fractiles(stripes.values, PARTS), strict=True
    ):
        axis.plot(
            curve,
            stripes.intensity,
            style,
            color=series_colour(0),
            linewidth=2.0,
            label=f"{100 * part:g} %",
        )
    if stripes.alone is not None and not np.array_equal(stripes.alone, stripes.values):
        (median,) = fractiles(stripes.alone, (0.5,))
        axis.plot(
            median, stripes.intensity, ":", color=STOP, linewidth=2.0, label="50 %, no contact"
        )
    axis.set_xlabel(stripes.label)
    axis.set_ylabel(stripes.measure)
    axis.set_xlim(left=0)
    axis.set_ylim(0, stripes.intensity[-1])
    axis.legend(frameon=False, fontsize=8, title=f"of {len(stripes.records)} records")
    head(figure, caption(results), fontsize=9)
    save(figure, path)
