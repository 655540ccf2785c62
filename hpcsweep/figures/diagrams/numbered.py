"""Number the special points of branches where they are drawn, and list them beside the panels."""

from collections.abc import Sequence

import numpy as np

from hpcsweep.dynamics.classify import ranges
from hpcsweep.figures import palette

SIZE, LETTER, LINE = 6.5, 0.68, 1.45
"""Size of numbers and of the list (points); width and height of a letter, in sizes."""
NEAR = 7.0
"""Points (1/72 inch) within which special points share a label."""
AROUND = [(side * away, up) for away in (5.0, 12.0) for up in (5.0, -14.0) for side in (1, -1)]
AROUND += [(side * 5.0, up) for up in (14.0, -23.0, 23.0) for side in (1, -1)]
"""Places of a label around its points, the best first (points)."""
FINELY = 64
"""Parts in which a piece of a line is divided to see whether it lies under a label."""
COLUMN = 2.4
"""Width of a column of the list (inches)."""
ROW, COLUMNS = 0.148, 3
"""Height of a row, and most columns."""


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
    columns = min(-(-len(rows) // each), COLUMNS)
    shown = columns * each
    if len(rows) > shown:
        title += f"\nthe first {shown} of {len(rows)}"
    figure.set_size_inches(width + COLUMN * columns, height)
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
    width, height = SIZE * LETTER * len(text), SIZE * LINE
    left, low = middle + offset
    left -= width if offset[0] < 0 else 0.0
    return np.array([left, low, left + width, low + height])


def _overlap(box: np.ndarray, other: np.ndarray) -> float:
    sides = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
    return float(np.prod(np.clip(sides, 0.0, None)))
