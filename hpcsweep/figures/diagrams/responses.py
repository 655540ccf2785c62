"""Common parts of the figures of responses to records: options and data."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from hpcsweep.earthquakes.stripes import PARTS, fractiles
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.options import Option, positive
from hpcsweep.model.isolation import SLAB
from hpcsweep.model.unit_names import is_level
from hpcsweep.studies.ground_motion.describe import alone_words, elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import RESPONSES, Stripes, stripes_of

RESPONSE = Option("--response", "of which response (default: drift)", choices=tuple(RESPONSES))
PLACE = Option(
    "--place",
    "storey, floor or contact, or a building, of which it is (default: the largest of all)",
    metavar="NAME",
)
SCALE = Option(
    "--scale", "intensity; the nearest there is (default: the middle one)", type=positive
)
RECORD = Option("--record", "record drawn, by name (default: the first)")
TIME = Option(
    "--time",
    "part of the motion that is drawn, from and to, since the first sample (default: all)",
    nargs=2,
    type=float,
    metavar=("FROM", "TO"),
)
THRESHOLD = Option(
    "--threshold", "response that is a failure, in its unit in figures", type=float, metavar="X"
)
COLLAPSES = Option("--collapse", "collapse is the failure", action="store_true", default=None)
MAX_GREY = 200
"""Records that are drawn one by one."""
INSTANTS = 4000
"""Least number of instants of a motion, so that what is between two is less than a line ..."""
MOST_PARTS = 50
"""... unless so many are in a sample interval."""
FENCE = 3.0
"""Distances between quartiles beyond the upper one, from which on a curve is an outlier (Tukey)."""
EDGE = 1.2
"""Of an axis, over the largest response, where something collapses."""
MIN_LENGTH = 1e-12
"""Share of the largest response below which two are the same."""


def loading(*names: str) -> Callable:
    """Return a function that reads variables of one structure that are there; default all."""
    return lambda frames, **_options: frames.gather(names or [*frames])


RUN = "outcome", "collapsed", "collapse_time"
"""Variables that `run_title` tells, where a file holds them."""
load, load_run = loading(), loading(*RUN)


def check_place(place: str | None, names: Iterable[str], what: str) -> None:
    """Refuse a place that is none of some names; `what` they are is said in the error.

    Raises
    ------
    PlotError
    """
    if place is not None and place not in names:
        raise style.PlotError(f"--place {place}: must be {what} {', '.join(names) or 'none'}")


def opened(results, response: str, place: str | None, units: str | None = None) -> Stripes:
    """Return the stripes that are to be drawn.

    Raises
    ------
    PlotError
    """
    stripes = stripes_of(results, style.study_of(results, Records), response, place, units)
    if np.isnan(stripes.values).all():
        raise style.PlotError("no run is complete yet")
    return stripes


def draw_suite(plot: Callable[..., Any], curves: np.ndarray, counted=fractiles) -> None:
    """Draw the curves of the records one by one, as far as they are few, and their fractiles.

    Parameters
    ----------
    plot : callable
        Draw one curve, from its values and the arguments of ``Axes.plot``.
    curves : ndarray, shape (n_records, k)
    counted : callable
        Return the fractiles.
    """
    for values in curves[:MAX_GREY]:
        plot(values, color="0.75", linewidth=0.6)
    looks = {"color": palette.series_colour(0), "linewidth": 2.0}
    for part, dashes, values in zip(PARTS, ("--", "-", "-."), counted(curves), strict=True):
        plot(values, dashes, label=f"{100 * part:g} % fractile", **looks)


def legend(axis, title: str | None = None, **looks) -> None:
    """Put the legend of a panel where there is room."""
    axis.legend(frameon=False, fontsize=8, title=title, title_fontsize=8, **looks)


def title(results) -> str:
    """Write the name of the job, the part that is drawn, and whether it is elastic too long."""
    part, name = part_words(results), str(results.attrs["name"])
    elastic = elastic_words(elastic_drift(results, style.structure_of(results)))
    return (f"{name}:  {part}" if part else name) + f"\n{elastic}" * bool(elastic)


def part_words(results) -> str:
    """Return the keys of the part that is drawn, of buildings by their names."""
    names = [name.removeprefix("building") for name in style.structure_of(results).building_names]
    part = str(results.attrs.get("part") or "")
    part = re.sub(r"building_(\d+)_", lambda found: f"{names[int(found[1])]} ".lstrip(), part)
    return part.replace("_", " ")


def alone(results) -> str:
    """Return the words for the motion beside, see `alone_words`."""
    return alone_words(style.structure_of(results))


def edge_of(*drawn: np.ndarray) -> float | None:
    """Return where an axis ends on which infinite values, of collapses, lie; None without any."""
    every = np.concatenate([np.ravel(values) for values in drawn])
    if not np.isinf(every).any():
        return None
    return EDGE * float(np.max(every, initial=0.0, where=np.isfinite(every))) or 1.0


def counted(stripes: Stripes) -> str:
    """Write the number of records, and of runs of which nothing is known."""
    unknown = int(np.isnan(stripes.values).sum())
    words = f"{len(stripes.records)} records"
    return words + f", {unknown} of {stripes.values.size} runs not known" * bool(unknown)


def touches(stripes: Stripes) -> bool:
    """Return whether contacts change any of the responses, as far as the file shows."""
    if stripes.alone is None:
        return False
    finite = np.isfinite(stripes.values)
    apart = np.nan_to_num(np.abs(stripes.values[finite] - stripes.alone[finite])).max(initial=0.0)
    return bool(apart > MIN_LENGTH * stripes.values[finite].max(initial=0.0))


def scale_index(scales: np.ndarray, scale: float | None) -> int:
    """Return the place of the intensity nearest to one, the middle one if none is requested."""
    return scales.size // 2 if scale is None else int(np.argmin(np.abs(scales - scale)))


def run_of(results, record: str | None, scale: float | None) -> tuple[Records, int, int]:
    """Return the study of results, and the places of a record, by default the first, and scale.

    Raises
    ------
    PlotError
    """
    study = style.study_of(results, Records)
    names = [str(name) for name in results["record"].values]
    record = names[0] if record is None else record
    if record not in names:
        shown = ", ".join(names[:10]) + (", ..." if len(names) > 10 else "")
        raise style.PlotError(f"--record {record}: must be one of {shown}")
    scales, _ = study.intensities(results["scale"].values)
    return study, names.index(record), scale_index(scales, scale)


def history_of(study: Records, run: tuple[int, int], time, structure=None):
    """Return the history of a run, or of another structure in its place, in steps to be drawn.

    Parameters
    ----------
    study : Records
    run : tuple of int
        Places of the record and of the scale.
    time : pair of float, optional
        Return the instants between these two.
    structure : Structure, optional

    Raises
    ------
    PlotError
        If nothing lies between the two times.
    """
    from hpcsweep.solvers.history import history

    samples = samples_of(study, run[0])
    longest = float(samples.times[-1]) + study.tail
    start, end = (0.0, longest) if time is None else time
    if not 0.0 <= start < end <= longest * (1.0 + 1e-9):
        raise style.PlotError(f"--time {start:g} {end:g}: must ascend, from 0 to {longest:g}")
    parts = min(max(int(np.ceil(samples.dt * INSTANTS / (end - start))), 1), MOST_PARTS)
    motion = structure or study.structure, samples, float(study.factor[run]), study.tail
    seen = history(*motion, samples.dt / parts, start=start, end=min(end, longest))
    if seen.time.size < 2:
        raise style.PlotError(f"--time {start:g} {end:g}: the motion has collapsed before")
    return seen


def within(curves: np.ndarray, *inside: np.ndarray) -> tuple[float | None, str]:
    """Return where an axis ends so that outliers do not squeeze the others, and words that tell.

    Parameters
    ----------
    curves : ndarray, shape (n_records, k)
    *inside : ndarray
        What is never beyond the edge, where it is finite: fractiles.

    Returns
    -------
    float or None
        None: without an outlier.
    str
    """
    sizes = np.max(curves, axis=1, initial=0.0, where=np.isfinite(curves))
    least = max((np.max(x, initial=0.0, where=np.isfinite(x)) for x in inside), default=0.0)
    low, high = np.quantile(sizes, (0.25, 0.75))
    beyond = sizes > max(high + FENCE * (high - low), least)
    if not beyond.any() or beyond.all() or high == low:
        return None, ""
    count = int(beyond.sum())
    words = f"{count} outlier{'s' * (count > 1)} beyond the edge, up to {sizes.max():.3g}"
    return 1.1 * float(max(sizes[~beyond].max(), least)), words


def samples_of(study: Records, i: int):
    """Return the samples of a record of a study.

    Raises
    ------
    PlotError
        If it is not at hand.
    """
    try:
        return study.record(i)
    except ValueError as error:
        raise style.PlotError(f"the record is needed: {error}") from None


def buildings(names) -> dict[str, list[int]]:
    """Return the places of each building's storeys or floors: numbers, and the slab on bearings."""
    places: dict[str, list[int]] = {}
    for i, name in enumerate(map(str, names)):
        places.setdefault(name.removesuffix(SLAB).rstrip(" 0123456789"), []).append(i)
    return places


def heights(names: Sequence[str]) -> list[tuple[str, list[int], list[int]]]:
    """Return each building, the places of its storeys or floors, and their levels.

    Points of columns are left out; the slab on bearings has the level 0.
    """
    kept = [i for i, name in enumerate(names) if is_level(name)]
    rows = []
    for building, members in buildings(names[i] for i in kept).items():
        places = [kept[k] for k in members]
        lowest = int(not names[places[0]].endswith(SLAB))
        rows.append((building, places, [*range(lowest, lowest + len(places))]))
    return rows


def run_title(results, study: Records, i: int, at: int) -> str:
    """Write which run is drawn, and when it collapses."""
    run = results.isel(record=i, scale=at)
    words = [part_words(results), samples_of(study, i).name, at_scale(study, at)]
    if run.get("collapsed"):
        unit = labels.named(study.structure, "time")
        words.append(f"collapses at {float(run['collapse_time']):.4g}{unit}")
    return ",  ".join(filter(None, words))


def at_scale(study: Records, place: int) -> str:
    """Write the intensity at one place of the scales."""
    measure = study.measure.named(study.structure.unit_names.time)
    scales, unit = study.intensities(study.scale)
    unit = " g" if unit == "g" else labels.named(study.structure, study.measure.quantity)
    return f"{measure} = {scales[place]:.4g}{unit}"
