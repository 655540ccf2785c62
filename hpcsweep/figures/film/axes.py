"""Draw the constant parts of a film once, by matplotlib: axes, labels, scale and legends."""

import numpy as np

from hpcsweep.figures.film.scene import STABLE, UNSTABLE, WIDTH, Page, Scene

LETTER, SWATCH, LEGEND = 7.2, 44, WIDTH - 180
"""Widths of a letter and of a swatch with its gaps in a legend, and of all of it."""
LOW_PANEL = 110
"""Height of a panel (pixels at `WIDTH`) up to which its label is short."""


def draw_axes(scene: Scene, page: Page) -> np.ndarray:
    """Draw the constant parts.

    Returns
    -------
    ndarray of uint32, shape (height, width)
        Packed colours, see `pixels`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    dpi = 100 * page.scale
    figure = Figure(figsize=(page.width / dpi, page.height / dpi), dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    for panel in range(scene.n_panels):
        _panel(figure, scene, page, panel)
    _label(figure, page, page.left, int(22 * page.scale), scene.title, fontsize=10)
    for direction, (top, bottom) in zip(scene.directions, page.bands, strict=False):
        text = f"contact, {direction}"
        y = (top + bottom) / 2
        _label(figure, page, page.left - 6, y, text, fontsize=7.5, ha="right")
    _omega_scale(figure, scene, page)
    _legends(figure, scene, page)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[: page.height, : page.width]
    return np.ascontiguousarray(picture).view("<u4").reshape(page.height, page.width).copy()


def _panel(figure, scene: Scene, page: Page, panel: int) -> None:
    top, bottom, left, right = page.panels[panel]
    scale = page.scale
    axis = figure.add_axes(
        (
            left / page.width,
            1 - bottom / page.height,
            (right - left) / page.width,
            (bottom - top) / page.height,
        )
    )
    axis.set_xlim(*page.span)
    axis.set_ylim(*page.limits(panel))
    axis.grid(True, color="0.92", linewidth=0.7)
    axis.set_axisbelow(True)
    axis.tick_params(labelsize=9, labelbottom=panel == 0)
    axis.locator_params(axis="y", nbins=max(2, int((bottom - top) / (42 * scale))))
    low = bottom - top <= LOW_PANEL * scale
    axis.set_ylabel(scene.label(panel, low))
    if panel == 0:
        axis.set_xlabel(scene.axes[0])


def _omega_scale(figure, scene: Scene, page: Page) -> None:
    from matplotlib.lines import Line2D

    left, right, y = page.omega_scale()
    low, high = scene.omega
    s = page.scale

    def line(x, rows, **style):
        xs, ys = np.array(x) / page.width, 1 - np.array(rows) / page.height
        figure.add_artist(Line2D(xs, ys, **style))

    line((left, right), (y, y), color="0.6", linewidth=2)
    for value, name in ((low, f"{low:.4g}"), (high, f"{high:.4g}"), *scene.marks):
        x = left + (value - low) / (high - low or 1.0) * (right - left)
        line((x, x), (y - 7 * s, y + 7 * s), color="0.4", linewidth=1)
        where = y - 15 * s if name.startswith("$") else y + 17 * s
        _label(figure, page, x, where, name, fontsize=8.5, ha="center")


def _legends(figure, scene: Scene, page: Page) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    points = [
        Line2D([], [], linestyle="none", marker="o", markersize=5, color=colour, label=label)
        for colour, label in scene.point_legend()
    ]
    if scene.branches:
        for (colour, width), word in ((STABLE, "stable branch"), (UNSTABLE, "unstable")):
            points.append(Line2D([], [], color=colour, linewidth=0.7 * width, label=word))
    bands = [Patch(color=colour, label=label) for colour, label in scene.contact_legend()]
    rows: dict[str, list] = {"points": points, "contact bands": bands}
    for row, (title, handles) in enumerate(rows.items()):
        fitting = _that_fit(handles)
        if not fitting:
            continue
        y = page.bottom + (66 + 28 * row) * page.scale
        _label(figure, page, page.left - 70 * page.scale, y, title, fontsize=9)
        figure.legend(
            handles=fitting,
            loc="center left",
            bbox_to_anchor=(
                (page.left + 46 * page.scale) / page.width,
                1 - y / page.height,
            ),
            ncols=len(fitting),
            fontsize=9,
            frameon=False,
            handletextpad=0.3,
            columnspacing=1.1,
            borderpad=0,
        )


def _that_fit(handles: list) -> list:
    """Return the first entries of a legend that fit on one line."""
    widths = np.cumsum([LETTER * len(handle.get_label()) + SWATCH for handle in handles])
    return [handle for handle, end in zip(handles, widths, strict=True) if end < LEGEND]


def _label(figure, page: Page, x: float, y: float, text: str, **style) -> None:
    figure.text(x / page.width, 1 - y / page.height, text, va="center", **style)
