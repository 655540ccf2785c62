"""Pictures of a film: orbit diagrams painted as pixels over axes that are drawn once.

The axes, labels and legends are drawn by matplotlib; into a copy of that picture every frame sets
its points, its contact bands and its frequency. Positions are pixels from the top left.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hpcsweep.figures.film.pixels import (
    WHITE,
    blend,
    disc,
    fine_point,
    look_up,
    packed_colour,
    text_mask,
    tint,
)
from hpcsweep.figures.style import PALETTE, UNDECIDED, contact_name

WIDTH = 1280
"""Width (pixels) for which the sizes below are meant; other widths scale them."""
LEFT, RIGHT, HEADER, BAND, GAP, FOOTER = 92, 28, 92, 20, 12, 112
LETTER, SWATCH, LEGEND = 7.2, 44, WIDTH - 180
"""Widths of a letter and of a swatch with its gaps in a legend, and of all of it."""
OTHERS = "#333333"
"""Colour of classes beyond the palette."""
ALL_PANELS, LEAST_PANEL, MOST_PANEL = 720, 56, 240
"""Height of all panels together, and bounds of one."""
MARGIN = 0.06


@dataclass(frozen=True)
class Scene:
    """What all frames of a film have in common.

    Attributes
    ----------
    title : str
        Parameters of the structure.
    amplitude : ndarray, shape (n_amplitudes,)
    omega : tuple of float
        Smallest and largest frequency.
    marks : tuple of (float, str)
        Frequencies to be marked on the scale of frequencies, and their names.
    low, high : ndarray, shape (n_floors,)
        Range of every floor's points, in gaps.
    directions : tuple of str
        Sweeps that are drawn, in the order of the variables' first axis.
    color : {"direction", "contact", "period"}
        What the points' colours tell.
    periods : tuple of int
        Orbit periods that occur.
    contacts : tuple of int
        Contact sets that occur, commonest first; empty without contact bands.
    width : int
        Width of the pictures in pixels, even.
    """

    title: str
    amplitude: np.ndarray
    omega: tuple[float, float]
    marks: tuple[tuple[float, str], ...]
    low: np.ndarray
    high: np.ndarray
    directions: tuple[str, ...]
    color: str
    periods: tuple[int, ...]
    contacts: tuple[int, ...]
    width: int = WIDTH

    @property
    def n_floors(self) -> int:
        """Number of panels."""
        return len(self.low)


def period_class(period: int) -> tuple[str, str]:
    """Give colour and label of an orbit period, the same in every film."""
    if period == 0:
        return UNDECIDED, "no period found"
    if period > len(PALETTE):
        return OTHERS, f"P{len(PALETTE) + 1} and longer"
    return PALETTE[period - 1], f"P{period}"


def contact_colour(contacts: tuple[int, ...], contact: int) -> str:
    """Give the colour of a contact set: by its place among those that are not empty."""
    if contact == 0:
        return "#8c8c8c"
    place = [c for c in contacts if c].index(contact)
    return PALETTE[place] if place < len(PALETTE) else OTHERS


DIRECTION_COLOUR = {"up": PALETTE[0], "down": PALETTE[1]}


class Painter:
    """Paints the frames of one scene.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    height, width : int
        Size of the pictures in pixels, even.
    panels : list of (top, bottom, left, right)
        Insides of the axes, first floor first.
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self._scale = scene.width / WIDTH
        self.width = scene.width
        self._place()
        self._background = self._draw_axes()
        a = scene.amplitude
        span = a[-1] - a[0] if a.size > 1 else max(a[0], 1e-9)
        pad = 0.01 * span
        self._a_low, self._a_high = a[0] - pad, a[-1] + pad
        columns = np.arange(self._left, self._right)
        centre = self._a_low + (columns + 0.5 - self._left) / (self._right - self._left) * (
            self._a_high - self._a_low
        )
        self._nearest = np.searchsorted(0.5 * (a[1:] + a[:-1]), centre)
        outside = (centre < a[0] - pad / 2) | (centre > a[-1] + pad / 2)
        self._nearest[outside] = -1
        self._column = self.column(a)
        room = (self._right - self._left) / max(a.size, 1)
        self._radius = float(np.clip(0.3 * room, 1.0, 3.2 * max(self._scale, 0.6)))

    def column(self, amplitude: np.ndarray) -> np.ndarray:
        """Give the pixel columns of amplitudes."""
        share = (np.asarray(amplitude) - self._a_low) / (self._a_high - self._a_low)
        return (self._left + share * (self._right - self._left)).astype(np.int64)

    def row(self, floor: int, displacement: np.ndarray) -> np.ndarray:
        """Give the pixel rows of displacements (gaps) in the panel of a floor (from 0)."""
        top, bottom, _, _ = self.panels[floor]
        low, high = self._limits(floor)
        share = (np.asarray(displacement) - low) / (high - low)
        return np.floor(bottom - share * (bottom - top)).astype(np.int64)

    def paint(self, omega: float, frame: Mapping[str, np.ndarray]) -> np.ndarray:
        """Paint one frame.

        Parameters
        ----------
        omega : float
        frame : mapping
            ``poincare`` (direction, amplitude, point, state), NaN where there is no point;
            ``orbit_period`` and, for the bands, ``contact`` (direction, amplitude); ``outcome``.

        Returns
        -------
        ndarray of uint8, shape (height, width, 4)
            Red, green, blue, 255.
        """
        canvas = self._background.copy()
        self._paint_bands(canvas, frame)
        self._paint_points(canvas, frame)
        self._paint_omega(canvas, omega)
        return canvas.view(np.uint8).reshape(self.height, self.width, 4)

    def _place(self) -> None:
        """Choose the places of everything, in pixels."""
        s, scene = self._scale, self.scene
        n = scene.n_floors
        panel = int(np.clip(ALL_PANELS / n, LEAST_PANEL, MOST_PANEL) * s)
        gap = max(2, int(GAP * s))
        band = int(BAND * s)
        self._left, self._right = int(LEFT * s), self.width - int(RIGHT * s)
        top = int(HEADER * s)
        self.bands: list[tuple[int, int]] = []
        if scene.contacts:
            for _ in scene.directions:
                self.bands.append((top, top + band))
                top += band + 2
            top += gap // 2
        self.panels = []
        for _ in range(n):
            self.panels.append((top, top + panel, self._left, self._right))
            top += panel + gap
        self.panels.reverse()
        self._bottom = top - gap
        self.height = 2 * ((self._bottom + int(FOOTER * s) + 1) // 2)

    def _limits(self, floor: int) -> tuple[float, float]:
        low, high = float(self.scene.low[floor]), float(self.scene.high[floor])
        pad = max(MARGIN * (high - low), 1e-6)
        return low - pad, high + pad

    def _paint_points(self, canvas: np.ndarray, frame: Mapping[str, np.ndarray]) -> None:
        points = frame["poincare"][..., : self.scene.n_floors]
        colours = self._run_colours(frame)
        settled = frame["orbit_period"] > 0
        flat = canvas.reshape(-1)
        # points of chaos are fine, those of orbits are large; the first direction is on top
        for d in reversed(range(len(points))):
            there = np.isfinite(points[d, :, :, 0])
            for few, stamp in ((False, fine_point(self._radius)), (True, disc(self._radius))):
                run, point = np.nonzero(there & (settled[d] == few)[:, None])
                for floor in range(self.scene.n_floors if run.size else 0):
                    top, bottom, left, right = self.panels[floor]
                    rows = self.row(floor, points[d, run, point, floor])
                    columns, colour = self._column[run], colours[d, run]
                    for dy, dx in stamp:
                        y, x = rows + dy, columns + dx
                        inside = (y >= top) & (y < bottom) & (x >= left) & (x < right)
                        flat[(y * self.width + x)[inside]] = colour[inside]

    def _run_colours(self, frame: Mapping[str, np.ndarray]) -> np.ndarray:
        """Give the packed colour of every run's points, shape (direction, amplitude)."""
        scene = self.scene
        if scene.color == "direction":
            shape = frame["orbit_period"].shape
            own = [packed_colour(DIRECTION_COLOUR[name]) for name in scene.directions]
            return np.broadcast_to(np.array(own, np.uint32)[:, None], shape)
        if scene.color == "period":
            of = {p: packed_colour(period_class(p)[0]) for p in scene.periods}
            return look_up(frame["orbit_period"], of)
        of = {c: packed_colour(contact_colour(scene.contacts, c)) for c in scene.contacts}
        return look_up(frame["contact"], of)

    def _paint_bands(self, canvas: np.ndarray, frame: Mapping[str, np.ndarray]) -> None:
        """Paint which floors touch, a band for each direction, named where there is room."""
        if not self.bands:
            return
        scene = self.scene
        tints = {c: packed_colour(tint(contact_colour(scene.contacts, c))) for c in scene.contacts}
        colours = look_up(frame["contact"], tints)
        for d, (top, bottom) in enumerate(self.bands):
            done = frame["outcome"][d] == 1
            colours[d][~done] = WHITE
            chosen = np.append(colours[d], np.uint32(WHITE))[self._nearest]
            canvas[top:bottom, self._left : self._right] = chosen
            sets = np.where(done, frame["contact"][d].astype(np.int64), -1)
            at = np.append(sets, -1)[self._nearest]
            starts = np.flatnonzero(np.diff(at, prepend=at[0] - 1))
            for start, end in zip(starts, [*starts[1:], at.size], strict=True):
                if at[start] < 0:
                    continue
                name = contact_name(int(at[start]), scene.n_floors).replace("none", "no contact")
                mask = text_mask(name, max(9, round(13 * self._scale)))
                if mask.shape[1] + 6 <= end - start:
                    x = self._left + (start + end - mask.shape[1]) // 2
                    blend(canvas, mask, (top + bottom - mask.shape[0]) // 2, x)

    def _paint_omega(self, canvas: np.ndarray, omega: float) -> None:
        s = self._scale
        mask = text_mask(f"Ω = {omega:.4f}", max(12, round(30 * s)))
        blend(canvas, mask, int(46 * s), self._left)
        low, high = self.scene.omega
        share = (omega - low) / (high - low) if high > low else 0.5
        left, right, y = self._scale_of_omega()
        x = round(left + share * (right - left))
        for dy, dx in disc(6 * s):
            canvas[y + dy, x + dx] = packed_colour("#222222")

    def _scale_of_omega(self) -> tuple[int, int, int]:
        """Left, right and row of the scale of frequencies."""
        return self._left + int(330 * self._scale), self._right - 8, int(60 * self._scale)

    def _draw_axes(self) -> np.ndarray:
        """Draw what does not change; packed colours, shape (height, width)."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        scene, s = self.scene, self._scale
        dpi = 100 * s
        figure = Figure(figsize=(self.width / dpi, self.height / dpi), dpi=dpi)
        canvas = FigureCanvasAgg(figure)
        pixel_a = scene.amplitude
        pad = 0.01 * (pixel_a[-1] - pixel_a[0] if pixel_a.size > 1 else max(pixel_a[0], 1e-9))
        for floor, (top, bottom, left, right) in enumerate(self.panels):
            axis = figure.add_axes(self._box(left, right, top, bottom))
            axis.set_xlim(pixel_a[0] - pad, pixel_a[-1] + pad)
            axis.set_ylim(*self._limits(floor))
            axis.grid(True, color="0.92", linewidth=0.7)
            axis.set_axisbelow(True)
            axis.tick_params(labelsize=9, labelbottom=floor == 0)
            axis.locator_params(axis="y", nbins=max(2, int((bottom - top) / (42 * s))))
            axis.set_ylabel(rf"$u_{{{floor + 1}}}(jT)$  [gaps]" if bottom - top > 110 * s else "")
            if bottom - top <= 110 * s:
                axis.set_ylabel(rf"$u_{{{floor + 1}}}$")
            if floor == 0:
                axis.set_xlabel(r"forcing amplitude $A$  [gaps $\cdot\,\omega_0^2$]")
        self._label(figure, self._left, int(22 * s), scene.title, fontsize=10)
        for direction, (top, bottom) in zip(scene.directions, self.bands, strict=False):
            y = (top + bottom) / 2
            text = f"contact, {direction}"
            self._label(figure, self._left - 6, y, text, fontsize=7.5, ha="right")
        self._draw_scale(figure)
        self._draw_legends(figure)
        canvas.draw()
        picture = np.asarray(canvas.buffer_rgba())[: self.height, : self.width]
        return np.ascontiguousarray(picture).view("<u4").reshape(self.height, self.width).copy()

    def _draw_scale(self, figure) -> None:
        from matplotlib.lines import Line2D

        left, right, y = self._scale_of_omega()
        low, high = self.scene.omega
        s = self._scale

        def line(x, rows, **style):
            xs, ys = np.array(x) / self.width, 1 - np.array(rows) / self.height
            figure.add_artist(Line2D(xs, ys, **style))

        line((left, right), (y, y), color="0.6", linewidth=2)
        for value, name in ((low, f"{low:.4g}"), (high, f"{high:.4g}"), *self.scene.marks):
            x = left + (value - low) / (high - low or 1.0) * (right - left)
            line((x, x), (y - 7 * s, y + 7 * s), color="0.4", linewidth=1)
            above = name.startswith("$")
            where = y - 15 * s if above else y + 17 * s
            self._label(figure, x, where, name, fontsize=8.5, ha="center")

    def _draw_legends(self, figure) -> None:
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        scene = self.scene
        if scene.color == "direction":
            entries = [(DIRECTION_COLOUR[name], f"sweep {name}") for name in scene.directions]
            if len(entries) == 2:
                entries[1] = (entries[1][0], entries[1][1] + " (beneath)")
        elif scene.color == "period":
            entries = [period_class(p) for p in sorted(scene.periods, key=lambda p: p or 10**6)]
        else:
            entries = [(contact_colour(scene.contacts, c), self._name(c)) for c in scene.contacts]
        entries = list(dict.fromkeys(entries))[: len(PALETTE) + 2]
        points = [
            Line2D([], [], linestyle="none", marker="o", markersize=5, color=colour, label=label)
            for colour, label in entries
        ]
        bands = [
            Patch(color=tint(contact_colour(scene.contacts, c)), label=self._name(c))
            for c in scene.contacts[: len(PALETTE) + 1]
        ]
        for row, (title, handles) in enumerate((("points", points), ("contact bands", bands))):
            handles = _that_fit([handle.get_label() for handle in handles], handles)
            if not handles:
                continue
            y = 1 - (self._bottom + (66 + 28 * row) * self._scale) / self.height
            x = self._left - 70 * self._scale
            self._label(figure, x, (1 - y) * self.height, title, fontsize=9)
            figure.legend(
                handles=handles,
                loc="center left",
                bbox_to_anchor=((self._left + 46 * self._scale) / self.width, y),
                ncols=len(handles),
                fontsize=9,
                frameon=False,
                handletextpad=0.3,
                columnspacing=1.1,
                borderpad=0,
            )

    def _name(self, contact: int) -> str:
        return contact_name(contact, self.scene.n_floors).replace("none", "no contact")

    def _box(self, left, right, top, bottom) -> tuple[float, float, float, float]:
        """Turn pixels into matplotlib's (left, bottom, width, height) in shares of the picture."""
        return (
            left / self.width,
            1 - bottom / self.height,
            (right - left) / self.width,
            (bottom - top) / self.height,
        )

    def _label(self, figure, x, y, text, **style) -> None:
        figure.text(x / self.width, 1 - y / self.height, text, va="center", **style)


def _that_fit(labels: list[str], handles: list) -> list:
    """Keep the first entries of a legend, as many as there is room for on one line."""
    widths = np.cumsum([LETTER * len(label) + SWATCH for label in labels])
    return [handle for handle, end in zip(handles, widths, strict=True) if end < LEGEND]
