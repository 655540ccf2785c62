"""Response of all structures at one intensity, a point a structure, over a key that the job varies.

Median and 16 to 84 % of the records.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.diagrams.vary_map import WIDE
from hpcsweep.figures.fitting import area, dot, legend_below
from hpcsweep.figures.options import Option
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion.keys import longest_period
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import RESPONSES, stripes_of
from hpcsweep.studies.study import as_kind

PERIOD = "period"
NAME = "portfolio"
DRAWS = "responses"
AGAINST = Option(
    "--against",
    "column of vary.rows, or key, on the horizontal axis, or period, the longest of each structure "
    "(default: period, or the first key where that is the same of all)",
    metavar="KEY",
)
COLOUR = Option("--colour", "such a key that the colours tell (default: none)", metavar="KEY")
OPTIONS = (responses.RESPONSE, responses.PLACE, responses.SCALE, AGAINST, COLOUR)
EDGE = 1.05
"""Height of structures whose median collapses, over the largest fractile."""


class Portfolio(NamedTuple):
    """16 %, median, 84 % of all structures, shape (3, structures); values, labels of two keys."""

    bands: np.ndarray
    over: tuple[np.ndarray, str]
    hue: tuple[np.ndarray, str] | None
    label: str
    title: str


def load(frames, response="drift", place=None, scale=None, against=None, colour=None):
    """Read one response of all structures, a `Portfolio`.

    Raises
    ------
    PlotError
    """
    varied = {key.name: key for axis in frames.whole.study.axes for key in axis.keys}
    if not varied:
        raise style.PlotError(f"--kind {NAME} shows structures that a job varies")
    names = [RESPONSES[response].name, "outcome", "collapsed"]
    bands, keys, tell = [], [], counted("reading structure")
    for at in frames.parts():
        results, study = frames.gather(names), as_kind(frames.study, Records)
        stripes = stripes_of(results, study, response, place)
        number = responses.scale_index(results, scale)
        bands.append(median_band(stripes.values[:, number]))
        keys.append({PERIOD: longest_period(study.structure), **at})
        tell(len(bands), frames.whole.study.n_parts)
    if np.isnan(bands).all():
        raise style.PlotError("no run is complete yet")
    columns = {name: np.array([key.get(name, "") for key in keys]) for name in (PERIOD, *varied)}
    numbers = {name: column for name, column in columns.items() if column.dtype.kind in "if"}
    if against is None:
        differ = (name for name, column in numbers.items() if np.unique(column).size > 1)
        against = next(differ, PERIOD)

    def values(flag: str, asked: str) -> tuple[np.ndarray, str]:
        """Return the values of a key, and its label."""
        name = next((key.name for key in varied.values() if asked in (key.name, key.key)), asked)
        if name not in numbers:
            raise style.PlotError(f"{flag} {asked}: must be of numbers, {', '.join(numbers)}")
        words = (
            (varied[name].key, varied[name].units) if name in varied else ("longest period", "time")
        )
        return numbers[name], words[0] + labels.unit(study.structure, words[1])

    hue = values("--colour", colour) if colour else None
    many = f"{len(keys)} structures, {len(stripes.records)} records"
    title = f"{frames.whole.name}:  {responses.at_scale(study, number)},  {many}"
    return Portfolio(np.array(bands).T, values("--against", against), hue, stripes.label, title)


def draw(results: Portfolio, **_options):
    """Draw what `load` returned; the options are those of `load`."""
    figure, (axis,) = style.new_figure(1, 4.4)
    (low, median, high), (over, label), hue = results[:3]
    top = EDGE * results.bands[np.isfinite(results.bands)].max(initial=0.0)
    axis.vlines(over, np.minimum(low, top), np.minimum(high, top), color="0.75", lw=0.8, zorder=1)
    keys = [area("16 to 84 % of the records", "0.75")]
    looks: dict = {"color": palette.series_colour(0)}
    if hue is not None:
        ends = dict(zip(("vmin", "vmax"), np.quantile(hue[0], (0, 1)).tolist(), strict=True))
        looks = {"cmap": palette.NUMBERS, "norm": _scale(hue[0]), **ends}
    fallen = np.isinf(median)
    for chosen, marker, words in ((~fallen, "o", "median"), (fallen, "^", "median collapses")):
        if chosen.any():
            hues = {} if hue is None else {"c": hue[0][chosen]}
            at = over[chosen], np.minimum(median[chosen], top)
            points = axis.scatter(*at, s=18, marker=marker, zorder=2, **looks, **hues)
            keys.append(dot(words, looks.get("color", "0.4"), marker))
    if hue is not None:
        figure.colorbar(points, ax=axis, label=hue[1])
    axis.set(xlabel=label, ylabel=results.label, xscale=_scale(over), ylim=(0, None))
    legend_below(figure, keys, "")
    return style.head(figure, results.title, fontsize=9)


def _scale(values: np.ndarray) -> str:
    return "log" if values.min() > 0 and values.max() >= WIDE * values.min() else "linear"
