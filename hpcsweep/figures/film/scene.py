"""Common parts of all frames of a film: scene, positions, colours."""

from dataclasses import dataclass

import numpy as np

from hpcsweep.figures.palette import DARK_INK, DIRECTIONS, MOTIONS, contact_colour
from hpcsweep.figures.style import LEGEND_ROOM, set_name, set_names

WIDTH = 1280
"""Width (pixels) for which the sizes below are meant; other widths scale them."""
STABLE, UNSTABLE = (DARK_INK, 3), ("#8c8c8c", 1)
"""Colour of a branch, and width in pixels."""
LEFT, RIGHT, HEADER, BAND, GAP, FOOTER = 92, 28, 92, 20, 12, 112
ALL_PANELS, LEAST_PANEL, MOST_PANEL = 720, 56, 240
"""Height of all panels together, and bounds of one."""
MARGIN, AMPLITUDE_MARGIN = 0.06, 0.01
"""Room around the points, in ranges of a floor's displacement and of the amplitude."""


@dataclass(frozen=True)
class Scene:
    """Common parts of all frames of a film.

    Attributes
    ----------
    title : str
        Parameters of the structure.
    amplitude : ndarray, shape (n_amplitudes,)
    omega : tuple of float
        Smallest and largest frequency.
    marks : tuple of (float, str)
        Frequencies to mark on the scale of frequencies, and their names.
    low, high : ndarray, shape (n_panels,)
        Range of the points of every floor shown.
    directions : tuple of str
        Directions to draw, in the order of the variables' first axis.
    words : tuple of str
        The same in words.
    color : {"direction", "contact", "period"}
        Meaning of the points' colours.
    motions : tuple of int
        Indices in `palette.MOTIONS` that occur, where colours show motions.
    contacts : tuple of int
        Contact sets that occur, commonest first; empty without contact bands.
    width : int
        Width of the pictures in pixels, even.
    floors : tuple of int
        Those shown, from 0, ascending; empty: all.
    labels : tuple of str
        `Structure.contact_labels`; empty: of a stop on the right of each floor shown.
    axes : tuple of str
        Label of the amplitude, and the unit of the displacements or of the measure.
    places : tuple of str
        Storeys, floors or contacts, where a measure is drawn: one a panel.
    branches : bool
        Whether branches lie under the points.
    """

    title: str
    amplitude: np.ndarray
    omega: tuple[float, float]
    marks: tuple[tuple[float, str], ...]
    low: np.ndarray
    high: np.ndarray
    directions: tuple[str, ...]
    words: tuple[str, ...]
    color: str
    motions: tuple[int, ...]
    contacts: tuple[int, ...]
    width: int = WIDTH
    floors: tuple[int, ...] = ()
    labels: tuple[str, ...] = ()
    axes: tuple[str, str] = ("forcing amplitude $A$", "")
    places: tuple[str, ...] = ()
    branches: bool = False

    @property
    def n_panels(self) -> int:
        """Number of floors shown."""
        return len(self.low)

    def label(self, panel: int, short: bool) -> str:
        """Label the vertical axis of a panel (from 0)."""
        _, unit = self.axes
        if self.places:
            return self.places[panel] + ("" if short else unit)
        floor = (self.floors[panel] if self.floors else panel) + 1
        return f"$u_{{{floor}}}$" if short else f"$u_{{{floor}}}(jT)${unit}"

    def contact_colour(self, contact: int) -> str:
        """Return the colour of a contact set."""
        return contact_colour(contact, self.labels or self.n_panels)

    def set_name(self, contact: int, room: int | None = LEGEND_ROOM) -> str:
        """Return the name of a contact set."""
        return set_name(contact, self.labels or self.n_panels, room)

    def point_legend(self) -> list[tuple[str, str]]:
        """Return (colour, label) of every class of points."""
        if self.color == "direction":
            entries = [
                (DIRECTIONS[name], words)
                for name, words in zip(self.directions, self.words, strict=True)
            ]
            if len(entries) == 2:
                entries[1] = (entries[1][0], entries[1][1] + " (beneath)")
            return entries
        if self.color == "period":
            return [MOTIONS[place][::-1] for place in sorted(self.motions)]
        return self.contact_legend()

    def contact_legend(self) -> list[tuple[str, str]]:
        """Return (colour, label) of every contact set, commonest first."""
        names = set_names(self.contacts, self.labels or self.n_panels)
        return [(self.contact_colour(c), n) for c, n in zip(self.contacts, names, strict=True)]


class Page:
    """Positions on the page, in pixels from the top left.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    scale : float
        Scale relative to `WIDTH`.
    height, width : int
        Size of the pictures, even.
    left, right, bottom : int
        Edges of all panels.
    panels : list of (top, bottom, left, right)
        Interiors of the axes, first floor first.
    bands : list of (top, bottom)
        Contact bands, one for each direction.
    span : tuple of float
        Amplitudes at the left and right edge.
    """

    def __init__(self, scene: Scene):
        self.scale = s = scene.width / WIDTH
        self.width = scene.width
        self.left, self.right = int(LEFT * s), self.width - int(RIGHT * s)
        panel = int(np.clip(ALL_PANELS / scene.n_panels, LEAST_PANEL, MOST_PANEL) * s)
        gap = max(2, int(GAP * s))
        band = int(BAND * s)
        top = int(HEADER * s)
        self.bands: list[tuple[int, int]] = []
        if scene.contacts:
            for _ in scene.directions:
                self.bands.append((top, top + band))
                top += band + 2
            top += gap // 2
        self.panels: list[tuple[int, int, int, int]] = []
        for _ in range(scene.n_panels):
            self.panels.append((top, top + panel, self.left, self.right))
            top += panel + gap
        self.panels.reverse()
        self.bottom = top - gap
        self.height = 2 * ((self.bottom + int(FOOTER * s) + 1) // 2)
        a = scene.amplitude
        pad = AMPLITUDE_MARGIN * (a[-1] - a[0] if a.size > 1 else max(a[0], 1e-9))
        self.span = float(a[0] - pad), float(a[-1] + pad)
        self._low, self._high = scene.low, scene.high

    def column(self, amplitude: np.ndarray) -> np.ndarray:
        """Return the pixel columns of amplitudes."""
        low, high = self.span
        share = (np.asarray(amplitude) - low) / (high - low)
        return (self.left + share * (self.right - self.left)).astype(np.int64)

    def row(self, floor: int, displacement: np.ndarray) -> np.ndarray:
        """Return the pixel rows of displacements (gaps) in the panel of a floor (from 0)."""
        top, bottom, _, _ = self.panels[floor]
        low, high = self.limits(floor)
        share = (np.asarray(displacement) - low) / (high - low)
        return np.floor(bottom - share * (bottom - top)).astype(np.int64)

    def limits(self, floor: int) -> tuple[float, float]:
        """Return the displacements at the bottom and the top of the panel of a floor (from 0)."""
        low, high = float(self._low[floor]), float(self._high[floor])
        pad = max(MARGIN * (high - low), 1e-6)
        return low - pad, high + pad

    def amplitude_index(self, amplitude: np.ndarray) -> np.ndarray:
        """Return the index of the amplitude nearest to each column of the panels, -1 outside."""
        low, high = self.span
        columns = np.arange(self.left, self.right)
        centre = low + (columns + 0.5 - self.left) / (self.right - self.left) * (high - low)
        nearest = np.searchsorted(0.5 * (amplitude[1:] + amplitude[:-1]), centre)
        half = 0.5 * (amplitude[0] - low)
        nearest[(centre < amplitude[0] - half) | (centre > amplitude[-1] + half)] = -1
        return nearest

    def omega_scale(self) -> tuple[int, int, int]:
        """Return left, right and row of the scale of frequencies."""
        return self.left + int(330 * self.scale), self.right - 8, int(60 * self.scale)
