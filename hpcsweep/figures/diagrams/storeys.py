"""Figures of the storeys, and of the structures, of a study of records at one intensity."""

from typing import NamedTuple

import numpy as np

from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.diagrams.vary_map import WIDE
from hpcsweep.figures.options import Option, figure_of
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import RESPONSES, responses_of, stripes_of
from hpcsweep.studies.study import as_kind

ROOM = 0.2
"""Room of the legend above the storeys, over their height."""
PERIOD = "period"
AGAINST = Option(
    "--against",
    "column of vary.rows, or key, on the horizontal axis, or period, the longest of each structure "
    "(default: period, or the first key where that is the same of all)",
    metavar="KEY",
)
COLOUR = Option("--colour", "such a key that the colours tell (default: none)", metavar="KEY")
WHICH = responses.RESPONSE, responses.PLACE, responses.SCALE
EDGE = 1.05
"""Height of structures whose median collapses, over the largest fractile."""


@figure_of("profile", "responses", responses.load, responses.RESPONSE, responses.SCALE)
def profile(results, response: str = "drift", scale: float | None = None):
    """Peak drift, displacement or acceleration, ductility or residual drift over the storeys.

    Of each building at one intensity: median, 16 to 84 %, and the median without contacts (of what
    has none and yields that of the elastic motion).
    """
    if response in ("force", "impacts", "base_shear"):
        raise style.PlotError(f"--response {response}: has no profile over the height")
    at, study = responses.scale_index(results, scale), style.study_of(results, Records)
    whole = responses.opened(results, response, None)
    peaks = responses_of(results, study, response)
    if study.structure.reduction is not None:
        raise style.PlotError("a profile is for buildings: a finite element model has no storeys")
    panels = responses.heights(peaks.names)
    figure, axes = style.new_grid(1, len(panels), (1.2 + 2.6 * len(panels), 4.2), sharex=True)
    bands = median_band(peaks.values[:, at])
    beside = [np.asarray(peaks.alone)[:, at]] if responses.touches(whole) else []
    edge = responses.edge_of(bands, *beside)
    for axis, (building, places, level) in zip(axes[0], panels, strict=True):
        low, median, high = bands[:, places]
        band = [np.minimum(end, edge or np.inf) for end in (low, high)]
        colour = palette.series_colour(0)
        axis.fill_betweenx(level, *band, color=colour, alpha=0.2, linewidth=0, label="16 to 84 %")
        axis.plot(median, level, "o-", color=colour, markersize=3, label="median")
        if responses.touches(whole):
            free = median_band(np.asarray(peaks.alone)[:, at, places])[1]
            looks = {"color": palette.STOP, "markersize": 3, "label": responses.alone(results)}
            axis.plot(free, level, "s:", **looks)
        axis.set_title(f"building {building}" if building else "", fontsize=9)
        axis.set_yticks(level, ["slab" if at == 0 else at for at in level])
        axis.grid(True, color="0.92", linewidth=0.6)
        axis.set_xlabel(whole.label, fontsize=8)
    ends = [tick for axis in axes[0] for tick in axis.get_yticks()]
    room = ROOM * (max(ends) - min(ends) + 1.0)
    for axis in axes[0]:
        axis.set_ylim(min(ends) - 0.5, max(ends) + 0.5 + room)
    axes[0, 0].set(xlim=(0, edge), ylabel=peaks.dim)
    responses.legend(axes[0, 0])
    where = f"{responses.at_scale(study, at)}, {len(whole.records)} records"
    if fallen := int(np.isinf(whole.values[:, at]).sum()):
        where += f", {fallen} of which collapse, beyond the edge"
    labels.suit(figure)
    return style.head(figure, f"{where}\n{responses.title(results)}", fontsize=9)


class Portfolio(NamedTuple):
    """16 %, median, 84 % of all structures, shape (3, structures); values, labels of two keys."""

    bands: np.ndarray
    over: tuple[np.ndarray, str]
    hue: tuple[np.ndarray, str] | None
    label: str
    title: str


def load_portfolio(frames, response="drift", place=None, scale=None, against=None, colour=None):
    """Read one response of all structures, a `Portfolio`.

    Raises
    ------
    PlotError
    """
    varied = {key.name: key for axis in frames.whole.study.axes for key in axis.keys}
    if not varied:
        raise style.PlotError("--kind portfolio shows structures that a job varies")
    names = [RESPONSES[response].name, "outcome", "collapsed"]
    bands, keys = [], []
    for at in counted(frames.parts(), frames.whole.study.n_parts, "reading structure"):
        results, study = frames.gather(names), as_kind(frames.study, Records)
        stripes = stripes_of(results, study, response, place)
        number = responses.scale_index(results, scale)
        bands.append(median_band(stripes.values[:, number]))
        keys.append({PERIOD: study.structure.longest_period, **at})
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


@figure_of("portfolio", "responses", load_portfolio, *WHICH, AGAINST, COLOUR)
def portfolio(results: Portfolio, **_options):
    """Response of all structures at one intensity, a point each, over a key that the job varies.

    Median and 16 to 84 % of the records.
    """
    figure, (axis,) = style.new_figure(1, 4.4)
    (low, median, high), (over, label), hue = results[:3]
    top = EDGE * results.bands[np.isfinite(results.bands)].max(initial=0.0)
    axis.vlines(over, np.minimum(low, top), np.minimum(high, top), color="0.75", lw=0.8, zorder=1)
    keys = [labels.area("16 to 84 % of the records", "0.75")]
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
            keys.append(labels.dot(words, looks.get("color", "0.4"), marker))
    if hue is not None:
        figure.colorbar(points, ax=axis, label=hue[1])
    axis.set(xlabel=label, ylabel=results.label, xscale=_scale(over), ylim=(0, None))
    labels.legend_below(figure, keys, "")
    labels.suit(figure)
    return style.head(figure, results.title, fontsize=9)


def _scale(values: np.ndarray) -> str:
    return "log" if values.min() > 0 and values.max() >= WIDE * values.min() else "linear"
