"""Figures of the storeys, and of the structures, of a study of records at one intensity."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.stripes import median_band
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import responses
from hpcsweep.figures.diagrams.vary_map import WIDE
from hpcsweep.figures.options import Option, figure_of
from hpcsweep.parallel.counted import counted
from hpcsweep.store import Frames
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import (
    RESPONSES,
    Stripes,
    places_of,
    responses_of,
    stripes_of,
)
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
BESIDE = Option(
    "--beside",
    "further files of responses, whose structures may have other numbers of storeys",
    nargs="+",
    type=Path,
    metavar="FILE",
)
OUTLIER, MOST_NAMES = 1.5, 12
"""Distances between quartiles beyond the upper one, from which on a structure is named (Tukey)."""
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
    study = style.study_of(results, Records)
    whole = responses.opened(results, response, None)
    at = responses.scale_index(whole.intensity, scale)
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


class OfStructure(NamedTuple):
    """A response of a structure at one intensity."""

    job: str
    name: str
    """Keys that the job varies, in words; that of a row by itself; empty if none."""
    keys: dict[str, Any]
    """Their values, behind `PERIOD`, the longest period."""
    storeys: int
    band: np.ndarray
    """16 %, median, 84 % of the records."""
    touching: float
    """Share of the records in which something touches; NaN without contacts."""
    worst: str
    """Place where the median is largest."""
    stripes: Stripes


def structures_of(frames, response="drift", place=None, scale=None, beside=()) -> list[OfStructure]:
    """Return all structures of a file, and of others beside it, whose units must be the same.

    Raises
    ------
    PlotError
    """
    held = [RESPONSES[response].name, "outcome", "collapsed", "impacts"]
    found: list[OfStructure] = []
    for file in (frames, *beside):
        for at in counted(file.parts(), file.whole.study.n_parts, "reading structure"):
            results, study = file.gather(held), as_kind(file.study, Records)
            each = responses_of(results, study, response)
            stripes = stripes_of(results, study, response, place, known=each)
            number = responses.scale_index(stripes.intensity, scale)
            chosen = places_of([*each.names], place)
            middle = median_band(each.values[:, number, chosen])[1]
            touching = math.nan
            if "impacts" in results:
                touching = float((results["impacts"][:, number].values > 0).any(axis=-1).mean())
            found.append(
                OfStructure(
                    job=str(results.attrs["name"]),
                    name=str(at.get("structure", responses.part_words(results))),
                    keys={PERIOD: study.structure.longest_period, **at},
                    storeys=len(study.structure.drift_rows),
                    band=median_band(stripes.values[:, number]),
                    touching=touching,
                    worst=each.names[chosen[int(np.argmax(middle))]],
                    stripes=stripes,
                )
            )
            first = found[0].stripes
            for ours, of_first in ((stripes.label, first.label), (stripes.measure, first.measure)):
                if ours != of_first:
                    raise style.PlotError(f"--beside {file.path}: has {ours}, not {of_first}")
    return found


class Portfolio(NamedTuple):
    """16 %, median, 84 % of all structures, shape (3, structures); values, labels of two keys."""

    bands: np.ndarray
    over: tuple[np.ndarray, str]
    hue: tuple[np.ndarray, str] | None
    label: str
    title: str
    structures: list[OfStructure]


@contextlib.contextmanager
def opened(paths: Sequence[Path]) -> Iterator[list[Frames]]:
    """Open further files of responses."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(contextlib.closing(Frames(path, "responses"))) for path in paths]


def load_portfolio(
    frames, response="drift", place=None, scale=None, against=None, colour=None, beside=()
):
    """Read one response of all structures, a `Portfolio`.

    Raises
    ------
    PlotError
    """
    varied = {key.name: key for axis in frames.whole.study.axes for key in axis.keys}
    if not varied and not beside:
        raise style.PlotError("--kind portfolio shows structures that a job varies, or --beside")
    with opened(beside) as others:
        structures = structures_of(frames, response, place, scale, others)
    stripes, study = structures[0].stripes, as_kind(frames.study, Records)
    bands, keys = [each.band for each in structures], [each.keys for each in structures]
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
    number = responses.scale_index(stripes.intensity, scale)
    jobs = ", ".join(dict.fromkeys(each.job for each in structures))
    title = f"{jobs}:  {responses.at_scale(study, number)},  {many}"
    over = values("--against", against)
    return Portfolio(np.array(bands).T, over, hue, stripes.label, title, structures)


@figure_of("portfolio", "responses", load_portfolio, *WHICH, AGAINST, COLOUR, BESIDE)
def portfolio(results: Portfolio, **_options):
    """Response of all structures at one intensity, a point each, over a key that the job varies.

    Median and 16 to 84 % of the records, with the names of outliers; of several jobs each has its
    colour.
    """
    figure, (axis,) = style.new_figure(1, 4.4)
    (low, median, high), (over, label), hue = results[:3]
    top = EDGE * results.bands[np.isfinite(results.bands)].max(initial=0.0)
    axis.vlines(over, np.minimum(low, top), np.minimum(high, top), color="0.75", lw=0.8, zorder=1)
    keys = [labels.area("16 to 84 % of the records", "0.75")]
    jobs = list(dict.fromkeys(each.job for each in results.structures))
    looks: dict = {"color": palette.series_colour(0) if len(jobs) == 1 else "0.4"}
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
    for series, job in enumerate(jobs if hue is None and len(jobs) > 1 else ()):
        of_job = np.array([each.job == job for each in results.structures])
        colour = palette.series_colour(series)
        axis.scatter(over[of_job], np.minimum(median, top)[of_job], s=18, color=colour, zorder=3)
        keys.append(labels.dot(job, colour))
    lower, upper = np.nanquantile(np.minimum(median, top), (0.25, 0.75))
    far = np.flatnonzero(median > upper + OUTLIER * (upper - lower))
    for k in sorted(far, key=lambda k: -median[k])[:MOST_NAMES]:
        each = results.structures[k]
        name = each.name if len(jobs) == 1 else ", ".join(filter(None, (each.job, each.name)))
        side = 1 if over[k] <= over.mean() else -1
        where = {"xytext": (4 * side, 2), "textcoords": "offset points", "fontsize": 7}
        where["ha"] = "left" if side > 0 else "right"
        axis.annotate(name, (over[k], min(median[k], top)), **where)
    if hue is not None:
        figure.colorbar(points, ax=axis, label=hue[1])
    axis.set(xlabel=label, ylabel=results.label, xscale=_scale(over), ylim=(0, None))
    labels.legend_below(figure, keys, "")
    labels.suit(figure)
    return style.head(figure, results.title, fontsize=9)


def _scale(values: np.ndarray) -> str:
    return "log" if values.min() > 0 and values.max() >= WIDE * values.min() else "linear"
