"""Diagrams of branches of periodic orbits, whose special points are numbered and listed."""

import contextlib
import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import ranges
from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.diagrams import sweep
from hpcsweep.figures.options import FLOORS, ROWS, SWEEP, Option, figure_of, whole_number
from hpcsweep.figures.overlay import MARKS, Drawn, branches_of, line_beneath, not_beneath, run_of
from hpcsweep.model.coordinates import Coordinate
from hpcsweep.store import Frames
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

LINE = Option("--line", "line, from 0 (default: the first)", type=whole_number(0, 10**9))
COLUMNS = 5
MATH = {"amplitude": "$A$", "omega": r"$\Omega$"}
RUNS = "0.55"
STABLE, UNSTABLE, NOWHERE_STABLE = 1.8, 0.6, 0.2
"""Widths of lines, the last of a branch that is unstable all along."""
SIZE, LETTER, HEIGHT = 6.5, 0.68, 1.45
"""Size of numbers and of the list (points); width and height of a letter, in sizes."""
NEAR = 7.0
"""Points (1/72 inch) within which special points share a label."""
AROUND = [(side * away, up) for away in (5.0, 12.0) for up in (5.0, -14.0) for side in (1, -1)]
AROUND += [(side * 5.0, up) for up in (14.0, -23.0, 23.0) for side in (1, -1)]
"""Places of a label around its points, the best first (points)."""
FINELY = 64
"""Parts in which a piece of a line is divided to see whether it lies under a label."""
COLUMN_WIDTH = 2.4
"""Width of a column of the list (inches)."""
ROW, MAX_COLUMNS = 0.148, 3
"""Height of a row, and most columns."""


def load(frames, line: int = 0, sweep: Path | None = None, **_options) -> tuple:
    """Read a line as it is, its branches, the runs or attractors along its path, and the study."""
    study = as_kind(frames.study, Branches)
    if line >= study.n_frames:
        raise style.PlotError(f"--line {line}: there are {study.n_frames} lines, from 0")
    runs = None
    if sweep is not None:
        with contextlib.closing(Frames(sweep, ("motions", "attractors"))) as held:
            swept = as_kind(held.study, RunGrid)
            if problem := not_beneath(study, swept):
                raise style.PlotError(f"--sweep {sweep}: this file {problem}")
            lines = [line_beneath(study, swept, frame) for frame in range(swept.n_frames)]
            if line not in lines or "poincare" not in held:
                what = f"has no stroboscopic points along {study.describe_task(line)}"
                raise style.PlotError(f"--sweep {sweep}: {what}")
            runs = held.dataset(lines.index(line))
    dataset = frames.dataset(line)
    return dataset, [*branches_of(run_of(dataset), study, line)], runs, study


@figure_of("branches", "branches", load, FLOORS, ROWS, LINE, SWEEP)
def branches(results: tuple, floors: Sequence[int | str] = (), **_options):
    """Branches of periodic orbits along the parameter: stable full, unstable thin.

    Special points are numbered and listed; with --sweep the stroboscopic points of a sweep, or of
    attractors, lie beneath them.
    """
    line, every, runs, study = results
    run = run_of(line)
    if not every:
        raise style.PlotError("no branch of this line is computed")
    structure = study.structure
    figure, axes = sweep.coordinate_panels(structure, floors)
    low, high = view.visible("x", *study.span)
    marked = _marked(run, low, high)
    for coordinate, axis in axes.items():
        if runs is not None:
            _draw_runs(axis, runs, coordinate)
        _draw_branches(axis, every, coordinate)
        _draw_specials(axis, run, coordinate)
        axis.set_ylim(view.visible("y", *axis.get_ylim()))
    axis.set(xlabel=labels.parameter(structure, study.parameter), xlim=(low, high))
    fixed = float(line["omega"].values[0])
    omega = fixed if np.isfinite(fixed) else None
    labels.legend_below(figure, _handles(run, runs is not None), "", COLUMNS)
    if marked.size:
        _list(figure, run, marked, MATH.get(study.parameter, study.parameter))
    amplitude = float(line["forcing_amplitude"].values[0])
    words = style.parameters(structure, omega), f"$A$ = {amplitude:g}" * math.isfinite(amplitude)
    title = ",  ".join([*filter(None, words), *map(labels.typeset, study.ties)])
    style.head(figure, title, fontsize=10)
    figure.draw_without_rendering()  # the panels get their size
    for coordinate, axis in axes.items():
        number(axis, run["special_value"][marked], coordinate.of(run["special_point"][marked]))
    return figure


def _marked(run: dict, low: float, high: float) -> np.ndarray:
    """Return the special points that are drawn large, by the parameter, from `low` to `high`."""
    value = run["special_value"]
    held = _beside_stable(run) & (run["special_kind"] > 0) & (value >= low) & (value <= high)
    places = np.flatnonzero(held)
    return places[np.argsort(value[places], kind="stable")]


def _list(figure, run: dict, marked: np.ndarray, symbol: str) -> None:
    """List special points by their numbers: kind, period of the orbit and parameter."""
    period = dict(zip(run["branch_id"].tolist(), run["branch_period"].tolist(), strict=True))
    rows, handles = [], []
    for number, place in enumerate(marked.tolist(), 1):
        kind, branch = Kind(int(run["special_kind"][place])), int(run["special_branch"][place])
        name = f"P{period[branch]}"
        value = float(run["special_value"][place])
        rows.append(f"{number:>2} {MARKS[kind][0]:<15} {name:<3} {value:#.6g}")
        handles.append(labels.key(**_looks(kind, 4)))
    title = f"special points beside stable\norbits: kind, period, {symbol}"
    list_beside(figure, rows, handles, title)


def _draw_runs(axis, runs, coordinate: Coordinate) -> None:
    """Draw the stroboscopic points of all runs: under branches, those of orbits as their rims."""
    for repeats, size in ((False, 0.64), (True, 9.0)):
        chosen = (runs["orbit_period"].values > 0) == repeats
        sweep.scatter(axis, runs, chosen, coordinate, s=size, color=RUNS, linewidths=0, zorder=1.5)


def _draw_branches(axis, branches: list[Drawn], coordinate: Coordinate) -> None:
    """Draw each branch, cut where its stability changes."""
    for branch in branches:
        unstable = UNSTABLE if branch.stable.any() else NOWHERE_STABLE
        for piece, steady in branch.pieces():
            drawn = branch.value[piece], coordinate.of(branch.points[piece])
            width, colour = STABLE if steady else unstable, palette.period_colour(branch.period)
            axis.plot(*drawn, color=colour, lw=width, zorder=2)


def _draw_specials(axis, run: dict, coordinate: Coordinate) -> None:
    """Mark special points: finely where no stable part is near, there no grazings.

    None of a branch that is unstable all along.
    """
    held = _beside_stable(run)
    partly = np.isin(run["special_branch"], run["step_branch"][run["stable"] > 0])
    for kind, near in product(MARKS, (True, False)):
        if near or kind is not Kind.GRAZING:
            marked = (run["special_kind"] == kind) & (held == near) & partly
            size, edge, order = (3.5, 0.9, 4) if near else (1.2, 0.4, 3)
            looks = {**_looks(kind, size), "markeredgewidth": edge, "zorder": order}
            at = run["special_value"][marked], coordinate.of(run["special_point"][marked])
            axis.plot(*at, **looks)


def _beside_stable(run: dict) -> np.ndarray:
    """Return of each special point whether a stable point of its branch is next to it."""
    step, stable, branch = run["special_step"], run["stable"] > 0, run["step_branch"]
    beside = np.zeros(step.shape, bool)
    for away in (-1, 0, 1):
        at = np.clip(step + away, 0, branch.size - 1)
        beside |= stable[at] & (branch[at] == run["special_branch"])
    return beside


def _looks(kind: Kind, size: float) -> dict[str, Any]:
    """Return the style of special points of a kind; the bar of grazings has its own size."""
    _, marker, colour = MARKS[kind]
    size, face = (7, colour) if marker == "|" else (size, "white")
    return {"ls": "none", "marker": marker, "ms": size, "mfc": face, "mec": colour}


def _handles(run: dict, runs: bool) -> list:
    periods = run["branch_period"][run["branch_id"] > 0]
    lines = [
        *(palette.MOTIONS[k] for k in np.unique(np.minimum(periods, palette.LONGEST + 1))),
        ("stable", palette.DARK_INK),
        ("unstable", palette.DARK_INK),
    ]
    handles = [labels.key(name, color=colour, lw=STABLE) for name, colour in lines]
    handles[-1].set_linewidth(UNSTABLE)
    handles += [
        labels.key(word, **_looks(kind, 4))
        for kind, (word, _, _) in MARKS.items()
        if (run["special_kind"] == kind).any()
    ]
    return [*handles, labels.dot("runs", RUNS, "o", 3.0)] if runs else handles


def list_beside(figure, rows: Sequence[str], handles: Sequence, title: str) -> None:
    """List special points beside the panels, by their marks; the figure grows by it.

    Parameters
    ----------
    rows : sequence of str
    handles : sequence of matplotlib artists
        The mark of each.
    title : str
    """
    width, height = figure.get_size_inches()
    each = int(height / ROW) - 3
    columns = min(-(-len(rows) // each), MAX_COLUMNS)
    shown = columns * each
    if len(rows) > shown:
        title += f"\nthe first {shown} of {len(rows)}"
    figure.set_size_inches(width + COLUMN_WIDTH * columns, height)
    figure.legend(
        handles[:shown],
        rows[:shown],
        title=title,
        loc="outside right upper",
        ncols=columns,
        prop={"family": "monospace", "size": SIZE},
        title_fontsize=8,
        frameon=False,
        handlelength=0.8,
        handletextpad=0.6,
        labelspacing=0.35,
        columnspacing=1.2,
        alignment="left",
    )


def number(axis, x: np.ndarray, y: np.ndarray) -> None:
    """Write the numbers of points, from 1, beside them in a panel; near ones share a label.

    Labels keep clear of each other, of the points, of lines and of the frame where they can. The
    panel must have its limits and its size.
    """
    from matplotlib.patheffects import withStroke

    scale = 72 / axis.get_figure().dpi
    at = axis.transData.transform(np.column_stack((x, y))) * scale
    curves = [
        line.get_path().transformed(axis.transData).interpolated(FINELY).vertices * scale
        for line in axis.lines
        if line.get_linestyle() == "-"
    ]
    drawn = np.concatenate([at, *curves])
    drawn = drawn[np.isfinite(drawn).all(axis=1)]
    frame = np.array(axis.get_window_extent().extents) * scale
    taken: list[np.ndarray] = []

    def hidden(box: np.ndarray) -> float:
        inside = np.all((drawn >= box[:2]) & (drawn <= box[2:]), axis=1).sum()
        outside = np.prod(box[2:] - box[:2]) - _overlap(box, frame)
        return inside + 100 * (outside + sum(_overlap(box, other) for other in taken))

    halo = [withStroke(linewidth=1.5, foreground="white")]
    for members in together(at):
        text = ",".join(ranges([k + 1 for k in members], "–"))
        middle = at[members].mean(axis=0)
        box = min((_box(middle, offset, text) for offset in AROUND), key=hidden)
        taken.append(box)
        place = members[0]
        looks = {"fontsize": SIZE, "color": palette.DARK_INK, "path_effects": halo, "zorder": 6}
        where = {"textcoords": "offset points", "va": "bottom", **looks}
        axis.annotate(text, (x[place], y[place]), box[:2] - at[place], **where).set_in_layout(False)


def together(at: np.ndarray) -> list[list[int]]:
    """Return groups of points, each within `NEAR` of the first of its group, in their order."""
    groups: list[list[int]] = []
    for k, place in enumerate(at):
        for members in groups:
            if np.abs(at[members[0]] - place).max() <= NEAR:
                members.append(k)
                break
        else:
            groups.append([k])
    return groups


def _box(middle: np.ndarray, offset: tuple[float, float], text: str) -> np.ndarray:
    """Return the ends of a label beside a place, left, lower, right and upper (points)."""
    width, height = SIZE * LETTER * len(text), SIZE * HEIGHT
    left, low = middle + offset
    left -= width if offset[0] < 0 else 0.0
    return np.array([left, low, left + width, low + height])


def _overlap(box: np.ndarray, other: np.ndarray) -> float:
    sides = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
    return float(np.prod(np.clip(sides, 0.0, None)))
