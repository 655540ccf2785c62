"""Map over amplitude and frequency of the motion of each run, or of one of its numbers."""

from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.mesh import (
    by_frequency,
    draw_classes,
    draw_grazing,
    draw_mesh,
    grazing_keys,
    legend_of_shares,
    map_height,
    mark_strip,
    open_map,
)
from hpcsweep.figures.diagrams.special_curves import (
    draw_specials,
    special_keys,
    with_specials,
)
from hpcsweep.figures.inferred import (
    draw_cells,
    drawn_classes,
    drawn_names,
    filled,
    inferred,
    is_by_period,
    need_cells,
    note_of,
)
from hpcsweep.figures.options import BRANCHES, CELLS, DIRECTION, Option
from hpcsweep.solvers.outcome import Outcome

VALUES = ("period", "drift", "contact", "modal_norm", "lyapunov")
NAME = "map"
DRAWS = "motions"
HELP = "motion classes over amplitude and frequency, or --value of each run"
OPTIONS = (
    DIRECTION,
    Option(
        "--value", "what the colours show (default: period, the motion classes)", choices=VALUES
    ),
    CELLS,
    BRANCHES,
)
ALWAYS = ("no contact", "P1", "undecided", "quasi-periodic", "chaotic")
"""Motions whose share the legend states even if it is 0."""
MAX_SETS = 14
"""Contact sets the legend names: the commonest."""
MAX_COLUMNS = 3
MAX_PANELS = 9
"""Modes shown, the lowest."""


def load(
    frames,
    direction: str | None = None,
    value: str | None = None,
    cells: bool | None = None,
    branches: Path | None = None,
):
    """Read the map of one direction, and special points of branches."""
    if cells:
        need_cells(frames)
    results = open_map(frames, value, direction)
    if branches is not None:
        results = with_specials(results, branches, frames.study.structure)
    return results


def draw(
    results,
    value: str = "period",
    direction: str | None = None,
    cells: bool | None = None,
    branches: Path | None = None,
):
    """Draw the map of one direction.

    Parameters
    ----------
    results : xarray.Dataset
    value : {"period", "drift", "contact", "modal_norm", "lyapunov"}
        Meaning of the colours; period: the motion classes.
    direction : {"up", "down"}, optional
        Default the first.
    cells : bool, optional
        Whether the cells of a refined map are outlined.
    branches : Path, optional
        File of branches, whose special points `load` has read.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    del branches
    if value != "period":
        style.need(results, value)
    results = by_frequency(results)
    results = results.isel(direction=[style.direction_index(results, direction)])
    panels = min(results.sizes["mode"], MAX_PANELS) if value == "modal_norm" else 1
    columns = min(panels, MAX_COLUMNS)
    rows = -(-panels // columns)
    size = (7.2, map_height(results, 5.2)) if panels == 1 else (3.6 * columns, 3.6 * rows + 0.6)
    figure, axes = style.new_grid(rows, columns, size, sharex=True, sharey=True)
    {
        "period": _classes,
        "contact": _contact_sets,
        "drift": _drift,
        "lyapunov": _exponent,
        "modal_norm": _modal_norms,
    }[value](figure, axes, results)
    if value != "period":
        style.foot(
            figure,
            grazing_keys(results) + special_keys(results),
            results,
            style.classes_of(results),
        )
    for axis in axes.flat[:panels]:
        draw_grazing(axis, results, style.structure_of(results))
        mark_strip(axis, results)
        if "special_kind" in results:
            draw_specials(axis, results)
        if cells:
            draw_cells(axis, results)
        axis.label_outer()
    for axis in axes.flat[panels:]:
        axis.set_visible(False)
    notes = [f"{style.caption(results)},  {style.words_of(results)}", note_of(results)]
    return style.head(figure, "\n".join(filter(None, notes)), fontsize=10)


def _classes(figure, axes, results) -> None:
    classes, periods = (values[0] for values in drawn_classes(results))
    index = palette.motion_index(classes, periods)
    draw_classes(axes[0, 0], results, index, palette.MOTION_COLOURS)
    missing = classes == MotionClass.NOT_COMPUTED
    computed = max(int((~missing).sum()), 1)
    shown = {
        name: (colour, int((index == place).sum()) / computed)
        for place, (name, colour) in enumerate(palette.MOTIONS)
        if name in ALWAYS or (index == place).any()
    }
    named = drawn_names(shown, is_by_period(results))
    entries = [(name, *entry) for name, entry in named.items()]
    of = "points" if inferred(results).any() else "runs"
    keys = grazing_keys(results) + special_keys(results)
    legend_of_shares(figure, entries, float(missing.mean()), "not computed", keys, of)


def _contact_sets(figure, axes, results) -> None:
    contact = filled(results, "contact")[0]
    known_from_cells = inferred(results, "contact")[0]
    done = (results["outcome"].values[0] == Outcome.COMPLETE) | known_from_cells
    sets = np.union1d(contact[done], np.zeros(1, contact.dtype))
    labels = style.structure_of(results).contact_labels
    index = np.where(done, np.searchsorted(sets, contact), -1)
    counts = np.bincount(index[done], minlength=sets.size)
    colours = [palette.contact_colour(int(c), labels) for c in sets]
    draw_classes(axes[0, 0], results, index, colours)
    named = np.argsort(-counts, kind="stable")[:MAX_SETS]
    order = sorted(named, key=lambda k: (int(sets[k]).bit_count(), int(sets[k])))
    names = style.set_names([int(sets[k]) for k in order], labels)
    entries = [
        (name, colours[k], counts[k] / done.size)
        for k, name in zip(order, names, strict=True)
        if counts[k]
    ]
    rest = sets.size - named.size
    if rest:
        share = (counts.sum() - counts[named].sum()) / done.size
        entries.append((style.rarer_sets(rest), "none", float(share)))
    of = "points" if known_from_cells.any() else "runs"
    legend_of_shares(figure, entries, float((~done).mean()), "failed or not computed", of=of)


def _drift(figure, axes, results) -> None:
    drift = np.ma.masked_invalid(results["drift"].values[0])
    top = float(np.percentile(drift.compressed(), 99)) if drift.count() else 1.0
    mesh = draw_mesh(axes[0, 0], results, drift, cmap=palette.NUMBERS, vmin=0, vmax=top)
    figure.colorbar(mesh, ax=axes, extend="max", label=r"normalised drift $\delta$  [$A/\Omega^2$]")


def _exponent(figure, axes, results) -> None:
    from matplotlib.colors import TwoSlopeNorm

    exponent = np.ma.masked_invalid(results["lyapunov"].values[0])
    inside = exponent.compressed()
    low, high = np.percentile(inside, [1, 99.8]) if inside.size else (-1, 1)
    norm = TwoSlopeNorm(0.0, min(float(low), -1e-6), max(float(high), 1e-6))
    mesh = draw_mesh(axes[0, 0], results, exponent, cmap=palette.NUMBERS, norm=norm)
    label = labels.exponent(style.structure_of(results))
    figure.colorbar(mesh, ax=axes, extend="both", label=label)


def _modal_norms(figure, axes, results) -> None:
    norms = np.ma.masked_invalid(results["modal_norm"].values[0])
    for mode in range(min(results.sizes["mode"], MAX_PANELS)):
        axis = axes.flat[mode]
        mesh = draw_mesh(axis, results, norms[..., mode], cmap=palette.NUMBERS, vmin=0, vmax=1)
        axis.set_title(f"mode {mode + 1}", fontsize=9)
    figure.colorbar(mesh, ax=axes, label=r"mean modal norm $\eta_j$ free of contact", aspect=30)
