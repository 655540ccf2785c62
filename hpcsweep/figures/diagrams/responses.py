"""Common parts of the figures of responses to records: options and data."""

from collections.abc import Callable
from typing import Any

import numpy as np

from hpcsweep.earthquakes.stripes import PARTS, fractiles
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.options import Option, positive
from hpcsweep.model.isolation import SLAB
from hpcsweep.studies.ground_motion.describe import elastic_drift, elastic_words
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.ground_motion.stripes import RESPONSES, Stripes, StripesError, stripes_of

RESPONSE = Option("--response", "what is drawn (default: drift)", choices=tuple(RESPONSES))
PLACE = Option(
    "--place",
    "storey, floor or contact, or a building, of which it is (default: the largest of all)",
    metavar="NAME",
)
SCALE = Option(
    "--scale", "intensity; the nearest there is (default: the middle one)", type=positive
)
RECORD = Option("--record", "record drawn, by name (default: the first)")
THRESHOLD = Option(
    "--threshold", "response that is a failure, in the unit of the figure; needed", type=float
)
COLLAPSES = Option("--collapse", "collapse is the failure", action="store_true", default=None)
MAX_GREY = 200
"""Records that are drawn one by one."""
MIN_LENGTH = 1e-12
"""Share of the largest response below which two are the same."""


def load(frames, **_options):
    """Read all responses of one structure."""
    return frames.gather([*frames])


def opened(results, response: str, place: str | None) -> Stripes:
    """Return the stripes that are to be drawn.

    Raises
    ------
    PlotError
    """
    try:
        found = stripes_of(results, style.study_of(results, Records), response, place)
    except StripesError as error:
        raise style.PlotError(str(error)) from None
    if np.isnan(found.values).all():
        raise style.PlotError("no run is complete yet")
    return found


def draw_suite(plot: Callable[..., Any], curves: np.ndarray) -> None:
    """Draw the curves of the records one by one, as far as they are few, and their fractiles.

    Parameters
    ----------
    plot : callable
        Draw one curve, from its values and the arguments of `Axes.plot`.
    curves : ndarray, shape (n_records, k)
    """
    for values in curves[:MAX_GREY]:
        plot(values, color="0.75", linewidth=0.6)
    looks = {"color": palette.series_colour(0), "linewidth": 2.0}
    for part, dashes, values in zip(PARTS, ("--", "-", "-."), fractiles(curves), strict=True):
        plot(values, dashes, label=f"{100 * part:g} % fractile", **looks)


def legend(axis, title: str | None = None, **looks) -> None:
    """Put the legend of a panel where there is room."""
    axis.legend(frameon=False, fontsize=8, title=title, title_fontsize=8, **looks)


def title(results) -> str:
    """Write the name of the job, the part that is drawn, and whether it is elastic too long."""
    part, name = results.attrs.get("part"), str(results.attrs["name"])
    elastic = elastic_words(elastic_drift(results, style.structure_of(results)))
    return (f"{name}:  {part}" if part else name) + f"\n{elastic}" * bool(elastic)


def alone(results) -> str:
    """Return the words for the motion without contacts, in which no slider slips."""
    return "elastic, no contact" if style.structure_of(results).sliders else "no contact"


def touches(stripes: Stripes) -> bool:
    """Return whether contacts change any of the responses, as far as the file shows."""
    if stripes.alone is None:
        return False
    known = np.isfinite(stripes.values)
    apart = np.nan_to_num(np.abs(stripes.values - stripes.alone))[known].max(initial=0.0)
    return bool(apart > MIN_LENGTH * stripes.values[known].max(initial=0.0))


def scale_index(results, scale: float | None) -> int:
    """Return the place of the scale nearest to one, the middle one if none is requested."""
    scales = results["scale"].values
    return scales.size // 2 if scale is None else int(np.argmin(np.abs(scales - scale)))


def record_index(results, record: str | None) -> int:
    """Return the place of a record, the first if none is requested.

    Raises
    ------
    PlotError
    """
    names = [str(name) for name in results["record"].values]
    if record is None:
        return 0
    if record not in names:
        shown = ", ".join(names[:10]) + (", ..." if len(names) > 10 else "")
        raise style.PlotError(f"--record {record}: must be one of {shown}")
    return names.index(record)


def samples_of(study: Records, i: int):
    """Return the samples of a record of a study.

    Raises
    ------
    PlotError
        If it is not at hand.
    """
    try:
        return study.record(i)
    except (ValueError, OSError) as error:
        raise style.PlotError(f"the record is needed: {error}") from None


def buildings(names) -> dict[str, list[int]]:
    """Return the places of each building's storeys or floors: numbers, and the slab on bearings."""
    found: dict[str, list[int]] = {}
    for i, name in enumerate(map(str, names)):
        found.setdefault(name.removesuffix(SLAB).rstrip(" 0123456789"), []).append(i)
    return found


COLLAPSE_NAMES = "collapsed", "collapse_time"
"""Variables that `run_title` tells, where a file holds them."""


def run_title(results, study: Records, i: int, at: int) -> str:
    """Write which run is drawn, and when it collapses."""
    one = results.isel(record=i, scale=at)
    told = [results.attrs.get("part"), samples_of(study, i).name, at_scale(study, at)]
    if one.get("collapsed"):
        unit = labels.unit(study.structure, "time").strip(" []")
        told.append(f"collapses at {float(one['collapse_time']):.4g} {unit}".strip())
    return ",  ".join(filter(None, told))


def at_scale(study: Records, place: int) -> str:
    """Write the intensity at one place of the scales."""
    quantity = study.measure.quantity
    named = labels.unit(study.structure, quantity).strip(" []") if quantity != "1" else ""
    measure = study.measure.named(study.structure.unit_names.time)
    return f"{measure} = {study.scale[place]:.4g} {named}".strip()
