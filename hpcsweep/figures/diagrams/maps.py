"""Maps over amplitude and frequency: motions, numbers of each run, numbers of attractors."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MOTION
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.attractors import IDENTITY, dominant, identities, missed_attractors
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.diagrams.attractors import starts_text
from hpcsweep.figures.inferred import drawn_classes, filled, gather, inferred, is_by_period, note_of
from hpcsweep.figures.options import BRANCHES, CELLS, DIRECTION, SWEEP, Option, figure_of
from hpcsweep.figures.overlay import with_specials
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

VALUES = ("period", "drift", "contact", "modal_norm", "lyapunov", "ductility")
OF_ATTRACTORS = ("share", "number", IDENTITY)
VALUE = Option(
    "--value",
    "what the colours show (default: period, the motion classes); share, number and identity "
    "go with attractors",
    choices=(*VALUES, *OF_ATTRACTORS),
)
MAX_SETS = 14
"""Contact sets the legend names: the commonest."""
MAX_PANELS = 9
"""Modes shown, the lowest."""
Kinds = tuple[np.ndarray, Sequence[str], list]
"""Indices of the cells, their colours, and keys of a legend."""
MOST = 5
"""Number from which on the colour is the same."""
MISSED = "missed"
"""Variable of the attractors that the sweep misses."""
VARIABLES = ("n_attractors", "attractor_id", "motion", "share", *map("n_{}".format, UNSTORED))
"""Variables of maps of attractors, beside those of motions."""


def load_attractors(
    frames, sweep: Path | None = None, cells: bool | None = None, value: str | None = "number"
):
    """Read the attractors for a value of a map, or numbers, and count those that a sweep misses."""
    mesh.need_map(frames.study.run_dims, frames.study.amplitude.size)
    each = () if value == "number" else (*mesh.VARIABLES, *([value] if value else []))
    results = gather(frames, (*VARIABLES, "outcome", *each), cells)
    if sweep is None:
        return results
    return results.assign({MISSED: (frames.study.run_dims[-2:], missed_attractors(frames, sweep))})


def load_map(
    frames,
    direction: str | None = None,
    value: str | None = None,
    cells: bool | None = None,
    branches: Path | None = None,
):
    """Read the map of one direction, and special points of branches."""
    if frames.study.content == "attractors":
        results = load_attractors(frames, cells=cells, value=value)
        if value == IDENTITY:
            results[IDENTITY] = results["attractor_id"].dims, identities(frames)[None]
    elif value in OF_ATTRACTORS:
        raise style.PlotError(f"--value {value}: holds no attractors")
    else:
        results = mesh.open_map(frames, value, direction, cells)
    if branches is not None:
        results = with_specials(results, branches, as_kind(frames.study, RunGrid))
    return results


@figure_of("map", "motions attractors", load_map, DIRECTION, VALUE, CELLS, BRANCHES)
def motion_map(results, value: str = "period", cells: bool | None = None, **_options):
    """Motion classes over amplitude and frequency, or --value of each run.

    Of attractors it is that of the one with the largest share.

    Parameters
    ----------
    results : xarray.Dataset
    value : str
        Meaning of the colours, one of `VALUES`, or of attractors `OF_ATTRACTORS`; period: the
        motion classes.
    cells : bool, optional
        Whether the cells of a refined map are outlined.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    note, words = note_of(results), ""
    if "attractor_id" in results:
        if value == "number":
            return number.draw(results, cells)
        note, words = starts_text(results), "attractor of the largest share"
        results = dominant(results)
    if value != "period":
        style.need(results, value)
    results = mesh.by_frequency(results)
    panels = min(results.sizes["mode"], MAX_PANELS) if value == "modal_norm" else 1
    size = 7.2, mesh.map_height(results, 5.2)
    figure, axes = mesh.panels(panels, size, (3.6, 3.6), (0.0, 0.6))
    kinds: dict = {"period": _classes, "contact": _contact_sets, IDENTITY: _identities}
    if value in kinds:
        index, colours, keys = kinds[value](results)
        mesh.grid_of(results).fill(axes[0], index, colours)
        of_points = "attractor_id" in results or bool(inferred(results).any())
        mesh.legend_of_shares(figure, keys, of_points)
    else:
        _numbers(figure, axes, results, value)
    if value != "period":
        style.foot(figure, mesh.map_keys(results), results, style.classes_of(results))
    mesh.finish(axes, results, cells)
    title = f"{style.caption(results)},  {words or style.words_of(results)}"
    return style.head(figure, title, note)


def _classes(results) -> Kinds:
    index = palette.motion_index(*(values[0] for values in drawn_classes(results)))
    keys = mesh.motion_keys(index, style.structure_of(results), is_by_period(results))
    return index, palette.MOTION_COLOURS, [*keys, *mesh.map_keys(results)]


def _contact_sets(results) -> Kinds:
    contact = filled(results, "contact")[0]
    from_cells = inferred(results, "contact")[0]
    done = (results["outcome"].values[0] == Outcome.COMPLETE) | from_cells
    if "attractor_id" in results:
        done &= results["attractor_id"].values[0] > 0
    numbers = style.structure_of(results).contact_labels
    commonest = style.commonest_sets(contact[done], numbers, MAX_SETS)
    commonest.sort(key=lambda each: not each[2])  # the rarer ones last
    index = np.full(done.shape, -1)
    if commonest:
        sets = np.array([c for c, _, _ in commonest], contact.dtype)
        order = np.argsort(sets)
        index[done] = order[np.searchsorted(sets, contact[done], sorter=order)]
    colours = [colour for _, colour, _ in commonest] or [palette.NO_CONTACT]
    entries = [(name, colour) for _, colour, name in commonest if name]
    if len(entries) < len(commonest):
        entries.append((style.rarer_sets(len(commonest) - len(entries)), "none"))
    shown = np.minimum(index, len(entries) - 1)
    return index, colours, mesh.share_keys(shown, entries, "failed or not computed")


def _identities(results) -> Kinds:
    """Return the identities that most points have, each named by the motion that it mostly is."""
    number = results[IDENTITY].values[0]
    motion = palette.motion_index(results[MOTION].values[0], results["orbit_period"].values[0])
    there, counts = (part.tolist() for part in np.unique(number[number > 0], return_counts=True))
    named = sorted(sorted(range(len(there)), key=lambda k: -counts[k])[: len(palette.SERIES)])
    index = np.where(number > 0, len(named), -1)
    entries, names = [], palette.motions_of(style.structure_of(results))
    for place, k in enumerate(named):
        cells = number == there[k]
        index[cells] = place
        name = names[int(np.bincount(motion[cells]).argmax())][0]
        entries.append((f"{there[k]}, {name}", palette.series_colour(place)))
    entries.append((f"{len(there) - len(named)} rarer", palette.OTHER_MOTION))
    keys = mesh.share_keys(index, entries, "none, or not computed")
    return index, [colour for _, colour in entries], keys


def _numbers(figure, axes, results, value: str) -> None:
    """Draw numbers of the runs, those of modes on a panel each."""
    from matplotlib.colors import LogNorm, Normalize, TwoSlopeNorm
    from matplotlib.ticker import LogFormatter

    numbers = np.ma.masked_invalid(results[value].values[0])
    inside = numbers.compressed()
    norm, unit, looks = Normalize(0, 1), "", {"extend": "neither", "aspect": 30}
    if value == "share":
        numbers = np.ma.masked_where(results["attractor_id"].values[0] == 0, numbers)
    elif value == "drift":
        norm = Normalize(0, np.percentile(inside, 99) if inside.size else 1.0)
        looks = {"extend": "max"}
    elif value == "ductility":
        numbers = np.ma.masked_less_equal(numbers.max(axis=-1), 0.0)
        norm, looks = LogNorm(), {"format": LogFormatter()}
    elif value == "lyapunov":
        low, high = np.percentile(inside, [1, 99.8]) if inside.size else (-1, 1)
        norm = TwoSlopeNorm(0.0, min(float(low), -1e-6), max(float(high), 1e-6))
        unit, looks = labels.unit(style.structure_of(results), "rate"), {"extend": "both"}
    layers = np.moveaxis(np.ma.atleast_3d(numbers), -1, 0)[: len(axes)]
    looks["label"] = labels.RUN_LABELS[value] + unit
    for axis, layer in zip(axes, layers, strict=True):
        cells = mesh.grid_of(results).draw(axis, layer, cmap=palette.NUMBERS, norm=norm)
    bar = figure.colorbar(cells, ax=axes, **looks)
    for mode, axis in enumerate(axes if value == "modal_norm" else (), 1):
        axis.set_title(f"mode {mode}", fontsize=9)
    if value == "ductility":
        bar.ax.yaxis.set_minor_formatter(LogFormatter())


@figure_of("number", "attractors", load_attractors, SWEEP, CELLS)
def number(results, cells: bool | None = None, **_options):
    """Number of attractors over amplitude and frequency.

    With --sweep also the number of those that no run of a sweep over the same points ends on.

    Raises
    ------
    PlotError
        If the points do not form a map.
    """
    results = mesh.by_frequency(results)
    done = results["outcome"].values[0] > 0
    counted = done | inferred(results, "n_attractors")[0]
    held = np.where(counted, filled(results, "n_attractors")[0], -1)
    held = np.where(held == 0, -1, held)
    counts = [("number of attractors", held, 1)]
    if MISSED in results:
        missed = results[MISSED].transpose("omega", "amplitude")
        counts.append(("attractors that no sweep ends on", missed.values, 0))
    height = mesh.map_height(results, 5.2)
    figure, axes = mesh.panels(len(counts), (7.2, height), (5.3, height))
    for axis, (name, values, least) in zip(axes, counts, strict=True):
        _count_panel(axis, results, name, values, least)
    mesh.finish(axes, results, cells)
    return style.head(figure, style.caption(results), starts_text(results), note_of(results))


def _count_panel(axis, results, name: str, values: np.ndarray, least: int) -> None:
    """Draw one map, with the share of the points by number below it."""
    top = least + MOST - 1
    colours = [
        palette.OTHER_MOTION,
        *(palette.count_colour(place, MOST - 1) for place in range(MOST - 1)),
    ]
    index = np.where(values < 0, -1, np.clip(values, least, top) - least)
    mesh.grid_of(results).fill(axis, index, colours)
    names = [*map(str, range(least, top)), f"{top} or more"]
    entries = [*zip(names, colours, strict=True)]
    handles = mesh.share_keys(index, entries, "none, or not computed")
    handles += mesh.map_keys(results)
    axis.set_title(name, fontsize=9)
    where = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 3}
    axis.legend(handles=handles, **where, **labels.LEGEND)
