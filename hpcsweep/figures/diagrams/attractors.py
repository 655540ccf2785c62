"""Attractors of one frame: their points along its path, and the shares of the starts."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import shakedown_name
from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.diagrams import sweep
from hpcsweep.figures.diagrams.mesh import edges_of
from hpcsweep.figures.options import AMPLITUDES, BRANCHES, FLOORS, OMEGA, ROWS, figure_of
from hpcsweep.studies.attractors.attractors import AttractorGrid
from hpcsweep.studies.attractors.search import UNSTORED
from hpcsweep.studies.report import starting_range

MAX_RANGES = 2
"""Ranges of the starts that are written out."""
MAX_COLUMNS, MORE_COLUMNS = 6, 7
"""Columns of the legends."""
MIN_WIDTH, MIN_HEIGHT = 0.05, 0.1
"""Parts of the panel that an identity must fill to be named in it."""
TALL = 0.75
"""Part of the largest height that the layer has around its name."""


@figure_of("attractors", "attractors", sweep.load_frame, OMEGA, AMPLITUDES, FLOORS, ROWS, BRANCHES)
def attractors(results, floors: Sequence[int | str] = (), branches: Path | None = None, **_options):
    """Stroboscopic displacement of each floor on all attractors of one frame.

    Against the forcing amplitude, or what they are continued along.

    Parameters
    ----------
    results : xarray.Dataset
        The first frame is drawn.
    floors : sequence of int or str, optional
        Shown, see `coordinates.coordinates`.
    branches : Path, optional
        Results file of branches along the same path, drawn beneath.

    Raises
    ------
    PlotError
        If there is nothing to draw.
    """
    frame, runs, index = opened(results)
    figure, axes = sweep.coordinate_panels(frame.structure, floors, labels.along(frame.study))
    keys, size = sweep.lay_branches(axes, frame, branches), sweep.orbit_area(runs)
    for coordinate, axis in axes.items():
        sweep.scatter_motions(axis, runs, index, coordinate, sweep.FINE * size, size)
        sweep.mark_stops(axis, frame.study.structures, coordinate, frame.along)
    style.limit_amplitudes(axis, frame.along)
    legend(figure, runs, index, starts_text(runs), MAX_COLUMNS, keys)
    return style.head(figure, frame.caption)


def opened(results):
    """Take the first frame of attractors, see `open_frame`.

    Returns
    -------
    one : sweep.Frame
    runs : xarray.Dataset
        Without the only direction.
    index : ndarray of int, shape (n_along, n_attractors)
        In `palette.MOTIONS` of each attractor, -1 where there is none.
    """
    frame: sweep.Frame = sweep.open_frame(results)
    runs = frame.runs.isel(direction=0)
    return frame, runs, palette.motion_index(frame.classes[0], runs["orbit_period"].values)


def starts_words(study: AttractorGrid) -> str:
    """Format the number of starts of a point, and where they lie."""
    box = [line.replace("omega_0", labels.WORD) for line in starting_range(study)]
    where = " and ".join(box) if len(box) <= MAX_RANGES else "a box, each floor its own range"
    return f"{study.starts:,} starts a point: {where}"


def starts_text(results) -> str:
    """Format the starts, and the shares of them that reached no attractor of the file."""
    study = style.study_of(results, AttractorGrid)
    done = max(int((results["outcome"].values > 0).sum()), 1) * study.starts
    parts = []
    for name in UNSTORED:
        count = int(results[f"n_{name}"].values.sum())
        if count or name == "undecided":
            parts.append(f"{name} {style.percent(count / done)}")
    return f"{starts_words(study)}; {', '.join(parts)}"


def legend(figure, runs, index: np.ndarray, title: str, columns: int, further=()) -> None:
    """Put the motions, further keys, and a title, below the panels."""
    handles = sweep.motion_keys(style.structure_of(runs), index, "s", 5)
    if (runs["orbit_period"].values[index >= 0] == 0).any():
        handles.append(labels.dot("no orbit", "0.3", ".", sweep.FINE_KEY))
    labels.legend_below(figure, [*handles, *further], title, columns)


@figure_of("shares", "attractors", sweep.load_frame, OMEGA, AMPLITUDES)
def shares(results, **_options):
    """Shares of the starts that go to each attractor, along the path of one frame.

    Stacked, and with their confidence intervals.

    Raises
    ------
    PlotError
        If there is nothing to draw.
    """
    frame, runs, index = opened(results)
    study = style.study_of(results, AttractorGrid)
    figure, axes = style.new_figure(2, 6.6)
    edges = edges_of(frame.along)
    if frame.along.size > 1:
        edges = np.clip(edges, *view.visible("x", frame.along[0], frame.along[-1]))
    layers = _layers(runs, study.starts)
    _stack(axes[0], edges, layers, index)
    _name(axes[0], edges, layers, index, runs, frame.structure.contact_labels)
    axes[0].set(ylim=(0, 1), ylabel="share of the starts, stacked")
    _intervals(axes[1], frame.along, runs, index, edges[0], edges[-1])
    axes[1].set(ylim=(-0.02, 1.02), ylabel=f"share, {100 * study.confidence:g} % interval")
    axes[1].set_xlabel(labels.along(frame.study))
    axes[1].set_xlim(edges[0], edges[-1])
    style.letter(axes)
    note = f"{starts_text(runs)}; named in (a): identity and contact set"
    legend(figure, runs, index, note, MORE_COLUMNS, [labels.blank("reached none of them")])
    return style.head(figure, frame.caption, fontsize=10)


def _layers(frame, starts: int) -> dict[int, np.ndarray]:
    """Stack the shares by identity, the oldest lowest.

    Returns
    -------
    dict of int to ndarray, shape (n_amplitudes, 3)
        Lower edge, upper edge and slot of each identity; slot -1 where it is absent.
    """
    ids, hits = frame["attractor_id"].values, frame["hits"].values
    layers = {}
    level = np.zeros(len(ids))
    for number in np.unique(ids[ids > 0]).tolist():
        there = ids == number
        slot = np.where(there.any(axis=1), there.argmax(axis=1), -1)
        share = np.where(there, hits, 0).sum(axis=1) / starts
        layers[number] = np.stack((level, level + share, slot), axis=1)
        level = level + share
    return layers


def _stack(axis, edges: np.ndarray, layers: dict, index: np.ndarray) -> None:
    """Draw a cell for each attractor, and a white line between identities."""
    from matplotlib.collections import PolyCollection

    axis.set_facecolor("white")
    axis.patch.set(hatch="xxxx", edgecolor="0.55")
    cells, colours = [], []
    for layer in layers.values():
        for k in np.flatnonzero(layer[:, 2] >= 0).tolist():
            low, high, slot = layer[k]
            left, right = edges[k], edges[k + 1]
            cells.append([(left, low), (right, low), (right, high), (left, high)])
            colours.append(palette.MOTION_COLOURS[index[k, int(slot)]])
    axis.add_collection(PolyCollection(cells, facecolors=colours, linewidths=0, rasterized=True))
    for layer in layers.values():
        top = np.where(layer[:, 2] >= 0, layer[:, 1], np.nan)
        axis.stairs(top, edges, baseline=None, color="white", linewidth=0.9)


def _name(axis, edges, layers: dict, index: np.ndarray, frame, labels) -> None:
    """Label the identity and its contact set within each motion, where it is tallest."""
    total = edges[-1] - edges[0]
    for number, layer in layers.items():
        slot = layer[:, 2].astype(int)
        there = slot >= 0
        rows = np.arange(len(slot))
        motion = np.where(there, index[rows, slot], -1)
        contact = np.zeros(len(slot), np.uint64)
        if "contact" in frame:
            contact = np.where(there, frame["contact"].values[rows, slot], 0)
        wide = there & (layer[:, 1] - layer[:, 0] > MIN_HEIGHT)
        for first, end in style.stretches(motion, contact, wide):
            if not wide[first] or edges[end] - edges[first] < MIN_WIDTH * total:
                continue
            height = layer[first:end, 1] - layer[first:end, 0]
            middle = first + int(np.argmax(height))
            tall = style.stretches(height >= TALL * height.max())
            first, end = next((first + a, first + b) for a, b in tall if first + b > middle)
            low, high = layer[first:end, 0].max(), layer[first:end, 1].min()
            at = 0.5 * (edges[first] + edges[end]), 0.5 * (low + high)
            text = str(number)
            if "contact" in frame:
                text += f"\n{style.set_name(int(contact[middle]), labels)}"
            if "shakedown" in frame:
                text += shakedown_name(int(frame["shakedown"].values[middle, slot[middle]]))
            ink = palette.ink(palette.MOTION_COLOURS[motion[middle]])
            axis.text(*at, text, ha="center", va="center", fontsize=7, color=ink)


def _intervals(axis, along, frame, index: np.ndarray, first: float, last: float) -> None:
    """Draw each share with its confidence interval, whole at the first and last place, too."""
    index = np.where((along >= first) & (along <= last), index.T, -1).T
    low, high = frame["share_low"].values, frame["share_high"].values
    share = frame["share"].values
    for place in np.unique(index[index >= 0]).tolist():
        row, slot = np.nonzero(index == place)
        at = along[row]
        looks = {"color": palette.MOTION_COLOURS[place], "clip_on": False, "zorder": 3}
        axis.vlines(at, low[row, slot], high[row, slot], linewidth=0.7, alpha=0.6, **looks)
        axis.plot(at, share[row, slot], linestyle="none", marker="o", markersize=1.8, **looks)
