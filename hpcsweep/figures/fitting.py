"""Keys of legends; legends and the words above them, kept within the width of a figure."""

import re
from collections.abc import Callable, Sequence
from typing import Any

WIDEST = 0.98
"""Share of a figure's width that its head or its legend may take."""
MAGNIFIED = 8
SMALL, SMALLER = 8, 7.5
"""Sizes of the entries of a legend, and of the words above them (points)."""
BETWEEN = r"(?<=,)  |(?<=;) (?![^(]*\))"
"""Two blanks after a comma, or one after a semicolon that is not in brackets."""
LEGEND: dict[str, Any] = {"fontsize": SMALL, "frameon": False}
"""Style of legends."""


def broken(text: str, fits: Callable[[str], bool], between: str = BETWEEN) -> str:
    """Break lines between their parts wherever they do not fit.

    Parameters
    ----------
    text : str
        Lines.
    fits : callable
        Return whether a line fits.
    between : str
        Regular expression of what stands between two parts.

    Returns
    -------
    str
    """
    lines: list[str] = []
    for line in text.split("\n"):
        parts, gaps = re.split(between, line), [match[0] for match in re.finditer(between, line)]
        lines.append(parts[0])
        for gap, part in zip(gaps, parts[1:], strict=True):
            joined = f"{lines[-1]}{gap}{part}"
            if fits(joined):
                lines[-1] = joined
            else:
                lines.append(part)
    return "\n".join(lines)


def fitter(figure, fontsize: float, edges: float = 0.0) -> Callable[[str], bool]:
    """Return whether a line of a size is no wider than a figure without `edges` (pixels)."""
    renderer = figure.canvas.get_renderer()

    def fits(line: str) -> bool:
        # magnified, since letters are rounded to pixels, and the picture has others
        probe = figure.text(0, 0, line, fontsize=MAGNIFIED * fontsize)
        width = probe.get_window_extent(renderer).width / MAGNIFIED
        probe.remove()
        return bool(width <= WIDEST * figure.bbox.width - edges)

    return fits


def key(label: str = "", **looks):
    """Return the key of lines, or of points, that look so."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **looks)


def dot(label: str, colour: str, marker: str = "o", size: float = 5.0, face: str | None = None):
    """Return the key of points; `face`: inside another colour, or none."""
    looks = {"ls": "none", "marker": marker, "ms": size, "color": colour}
    return key(label, mfc=face or colour, **looks)


def area(label: str, colour: str):
    """Return the key of an area of a colour."""
    from matplotlib.patches import Patch

    return Patch(facecolor=colour, edgecolor="0.3", linewidth=0.5, label=label)


def blank(label: str):
    """Return the key of a hatched area, where nothing is drawn."""
    from matplotlib.patches import Patch

    return Patch(facecolor="white", edgecolor="0.55", hatch="xxxx", linewidth=0.5, label=label)


def legend_below(figure, handles: Sequence, title: str, most_columns: int | None = None):
    """Put a legend with a title below the panels, no wider than the figure.

    Parameters
    ----------
    figure
    handles : sequence
        Entries, in the order of the legend.
    title : str
        Lines; one that is too long is broken between words.
    most_columns : int, optional
        Default: as many as there are entries.

    Returns
    -------
    matplotlib.legend.Legend
    """
    edges = 2 * SMALL * figure.dpi / 72  # of the legend around its title
    fits = fitter(figure, SMALLER, edges)
    title = broken(broken(title, fits, "(?<=;) "), fits, " ")
    looks = {"loc": "outside lower center", "title_fontsize": SMALLER, **LEGEND}
    for columns in range(max(min(len(handles), most_columns or len(handles)), 1), 0, -1):
        legend = figure.legend(handles=handles, ncols=columns, title=title, **looks)
        if columns == 1 or legend.get_window_extent().width <= WIDEST * figure.bbox.width:
            return legend
        legend.remove()
    raise AssertionError("a legend of one column is always drawn")
