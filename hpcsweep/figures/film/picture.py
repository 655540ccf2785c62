"""Draw the frames of a film with one matplotlib figure, of which a frame redraws what moves.

Axes, labels, scale and legends are drawn once. A frame restores them and draws bands, branches,
points and the frequency by a few artists, whose data change.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.mesh import edges_of
from hpcsweep.figures.fitting import dot
from hpcsweep.figures.overlay import Drawn
from hpcsweep.solvers.outcome import Outcome

if TYPE_CHECKING:
    from hpcsweep.figures.film.film import Film, FirstPass

WIDTH = 1280
"""Width (pixels) for which the sizes below are meant; other widths scale them."""
STABLE, UNSTABLE = (palette.DARK_INK, 3), ("#8c8c8c", 1)
"""Colour of a branch, and width."""
LEFT, RIGHT, HEADER, BAND, GAP, FOOTER = 92, 28, 92, 22, 12, 112
ALL_PANELS, MIN_PANEL, MAX_PANEL = 720, 56, 240
"""Height of all panels together, and bounds of one."""
LOW_PANEL = 110
"""Height of a panel up to which its label is short."""
MARGIN, AMPLITUDE_MARGIN = 0.06, 0.01
"""Room around the points, in ranges of a floor's displacement and of the amplitude."""
MAX_KEYS = 20
"""Entries of a legend for which room is sought."""
LETTER = 8
"""Width of a letter on a contact band."""


class Picture:
    """Painter of the frames of one film.

    Parameters
    ----------
    film : Film
    found : Found
        Of all frames.

    Attributes
    ----------
    keys : dict of int to (str, str)
        Colour and name of each direction, motion or contact set that points have.
    sets : dict of int to (str, str)
        Of each contact set, the commonest first; none without contact bands.
    panels : list of axes
        The first floor first.
    bands : axes or None
    """

    def __init__(self, film: "Film", found: "FirstPass"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._film, study, self._labels = film, film.study, film.structure.contact_labels
        sets = sorted(found.contacts, key=lambda c: (-found.contacts[c], c))
        names = zip(sets, style.set_names(sets, self._labels), strict=True)
        self.sets = {c: (palette.contact_colour(c, self._labels), name) for c, name in names}
        beneath = "", " (beneath)"
        self.keys = {
            "direction": {
                d: (palette.DIRECTIONS[name], study.words[name] + beneath[d])
                for d, name in enumerate(film.directions)
            },
            "period": {place: palette.MOTIONS[place][::-1] for place in sorted(found.motions)},
            "contact": self.sets,
        }[film.request.color]
        n_panels, n_bands = len(film.floors), len(film.directions) if sets else 0
        tall = int(np.clip(ALL_PANELS / n_panels, MIN_PANEL, MAX_PANEL))
        top = HEADER + n_bands * BAND + (GAP if n_bands else 0)
        self._bottom = top + n_panels * (tall + GAP) - GAP
        scale = film.width / WIDTH
        self._size = WIDTH, 2 * round((self._bottom + FOOTER) * scale / 2) / scale
        self.figure = Figure((WIDTH / 100, self._size[1] / 100), 100 * scale)
        self._canvas = FigureCanvasAgg(self.figure)
        self.panels = [self._axes(top + k * (tall + GAP), tall) for k in range(n_panels)][::-1]
        a = study.amplitude
        pad = AMPLITUDE_MARGIN * (a[-1] - a[0] if a.size > 1 else max(a[0], 1e-9))
        span = a[0] - pad, a[-1] + pad
        for k, panel in enumerate(self.panels):
            pad = max(MARGIN * (found.high[k] - found.low[k]), 1e-6)
            panel.set(xlim=span, ylim=(found.low[k] - pad, found.high[k] + pad))
            panel.set_ylabel(self._name(k, tall <= LOW_PANEL))
            panel.grid(True, color="0.92", linewidth=0.7)
            panel.set_axisbelow(True)
            panel.tick_params(labelsize=9, labelbottom=k == 0)
            panel.locator_params(axis="y", nbins=max(2, tall // 42))
        self.panels[0].set_xlabel(labels.amplitude(film.structure))
        looks = {"linestyle": "none", "markeredgewidth": 0, "animated": True}
        self._points = [panel.plot([], [], **looks)[0] for panel in self.panels]
        self._lines = [panel.plot([], [], animated=True)[0] for panel in self.panels]
        room = scale * (WIDTH - LEFT - RIGHT) / a.size
        radius = float(np.clip(0.3 * room, 1.0, 3.2 * max(scale, 0.6)))
        fine = float(np.clip(radius, 1.5, 3))
        # points of chaos are fine, those of orbits are large and lie on them
        self._markers = (("s", 0.72 * fine / scale), ("o", 0.72 * (2 * radius + 1) / scale))
        self.bands: Any = None
        if n_bands:
            self.bands = self._axes(HEADER, n_bands * BAND, xlim=span, xticks=[])
            words = [f"contact, {name}" for name in film.directions]
            self.bands.set_yticks(np.arange(n_bands) + 0.5, words, fontsize=7.5)
            self.bands.tick_params(length=0)
            self.bands.set_frame_on(False)
            blank = np.ones((n_bands, a.size, 4))
            self._cells = self.bands.pcolormesh(
                edges_of(a), np.arange(n_bands + 1), blank, animated=True
            )
            self.bands.set_ylim(n_bands, 0)
            self._gap = self.bands.axhline(1, color="white", linewidth=1.5, animated=True)
            self._word = self.bands.text(
                0, 0, "", ha="center", va="center", fontsize=9, animated=True
            )
        title = style.parameters(film.structure, room=None)
        if film.measure:
            title = f"{film.measure.label};  {title}"
        self._label(LEFT, 22, title, fontsize=10)
        self._omega = self._label(
            LEFT, 60, "", fontsize=21.6, color=palette.DARK_INK, animated=True
        )
        self._mark = self._scale(study.omega[[*found.richness]])
        self._legends()
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self.figure.bbox)

    def paint(
        self, omega: float, frame: Mapping[str, np.ndarray], branches: Sequence[Drawn] = ()
    ) -> np.ndarray:
        """Paint one frame.

        Parameters
        ----------
        omega : float
        frame : mapping
            From `Film.read`.
        branches : sequence of Drawn, optional
            Beneath the points.

        Returns
        -------
        ndarray of uint8, shape (height, width, 4)
            Red, green, blue, 255.
        """
        self._canvas.restore_region(self._still)
        if self.bands is not None:
            self._paint_bands(frame)
        self._paint_branches(branches)
        self._paint_points(frame)
        self._omega.set_text(f"Ω = {omega:.4f}")
        self._mark.set_xdata([omega])
        self.figure.draw_artist(self._omega)
        self.figure.draw_artist(self._mark)
        return np.array(self._canvas.buffer_rgba())

    def _paint_bands(self, frame: Mapping[str, np.ndarray]) -> None:
        """Paint the contact sets, a band for each direction, named where there is room."""
        from matplotlib.colors import to_rgba_array

        done = frame["outcome"] == Outcome.COMPLETE
        sets, index = np.unique(frame["contact"], return_inverse=True)
        index = np.where(done, index.reshape(done.shape), sets.size)
        colours = [self.sets[c][0] if c in self.sets else palette.NOTHING for c in sets.tolist()]
        self._cells.set_array(to_rgba_array([*colours, palette.NOTHING])[index])
        self.figure.draw_artist(self._cells)
        self.figure.draw_artist(self._gap)
        span = self.bands.get_xlim()
        edges = np.clip(self._cells.get_coordinates()[0, :, 0], *span)
        width = (WIDTH - LEFT - RIGHT) / (span[1] - span[0])
        for d, row in enumerate(index):
            starts = np.flatnonzero(np.diff(row, prepend=-1))
            for start, end in zip(starts, [*starts[1:], row.size], strict=True):
                room = int((edges[end] - edges[start]) * width / LETTER)
                if row[start] == sets.size or room < 2:
                    continue
                name = style.set_name(int(sets[row[start]]), self._labels, room)
                if len(name) <= room:
                    self._word.set(text=name, color=palette.ink(colours[row[start]]))
                    self._word.set_position(((edges[start] + edges[end]) / 2, d + 0.5))
                    self.figure.draw_artist(self._word)

    def _paint_branches(self, branches: Sequence[Drawn]) -> None:
        pieces = [(one, *piece) for one in branches for piece in one.pieces()]
        for one, piece, steady in sorted(pieces, key=lambda entry: entry[-1]):  # stable on top
            colour, width = STABLE if steady else UNSTABLE
            for floor, line in zip(self._film.floors, self._lines, strict=True):
                line.set(color=colour, linewidth=0.72 * width)
                for turn in range(one.period):
                    line.set_data(one.value[piece], one.points[piece, turn, floor])
                    self.figure.draw_artist(line)

    def _paint_points(self, frame: Mapping[str, np.ndarray]) -> None:
        points, settled = frame["poincare"], frame["orbit_period"] > 0
        there = np.isfinite(points[..., 0])
        key = {"period": "motion"}.get(self._film.request.color, self._film.request.color)
        for d in reversed(range(len(points))):  # the first direction is on top
            keys = frame[key][d] if key in frame else np.full(settled[d].shape, d)
            for large, (marker, size) in enumerate(self._markers):
                for value, (colour, _) in self.keys.items():
                    chosen = (settled[d] == large) & (keys == value)
                    run, point = np.nonzero(there[d] & chosen[:, None])
                    for panel, line in enumerate(self._points if run.size else ()):
                        line.set(color=colour, marker=marker, markersize=size)
                        line.set_data(self._film.study.amplitude[run], points[d, run, point, panel])
                        self.figure.draw_artist(line)

    def _axes(self, top: float, tall: float, left: float = LEFT, right: float = RIGHT, **options):
        width, height = self._size
        place = left / width, 1 - (top + tall) / height, 1 - (left + right) / width, tall / height
        return self.figure.add_axes(place, **options)

    def _label(self, x: float, y: float, text: str, **style):
        width, height = self._size
        return self.figure.text(x / width, 1 - y / height, text, va="center", **style)

    def _name(self, panel: int, short: bool) -> str:
        """Label the vertical axis of a panel."""
        film, floor = self._film, self._film.floors[panel]
        if film.measure:
            return film.measure.places[floor] + ("" if short else film.measure.unit)
        name = f"u_{{{floor + 1}}}"
        return f"${name}$" if short else f"${name}(jT)$" + labels.unit(film.structure, "length")

    def _scale(self, omega: np.ndarray):
        """Draw the scale of frequencies; return the mark on it."""
        low, high = omega.min(), omega.max()
        looks = {"frame_on": False, "yticks": [], "ylim": (-1, 1)}
        scale = self._axes(53, 14, LEFT + 330, RIGHT + 8, **looks)
        scale.set_xlim(low, high) if high > low else scale.set_xlim(low - 1, low + 1)
        scale.plot([low, high], [0, 0], color="0.6", linewidth=2, clip_on=False)
        above = scale.secondary_xaxis("top")
        above.set_frame_on(False)
        natural = list(enumerate(self._film.structure.frequencies, 1))
        inside = {rf"$\omega_{{{i}}}$": w for i, w in natural if low < w < high}
        above.set_xticks(list(inside.values()), list(inside))
        scale.set_xticks([low, high], [f"{low:.4g}", f"{high:.4g}"])
        for axis in (scale, above):
            looks = {"direction": "in", "length": 10, "labelsize": 8.5, "color": "0.4", "pad": 2}
            axis.tick_params(axis="x", **looks)
        return scale.plot([low], [0], "o", ms=9, c=palette.DARK_INK, clip_on=False, animated=True)[
            0
        ]

    def _legends(self) -> None:
        """Put the legends below the panels, each on a line: the entries that fit."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        points = [dot(name, colour) for colour, name in self.keys.values()]
        if self._film.overlay:
            for (colour, width), word in ((STABLE, "stable branch"), (UNSTABLE, "unstable")):
                points.append(Line2D([], [], color=colour, linewidth=0.72 * width, label=word))
        bands = [Patch(color=colour, label=name) for colour, name in self.sets.values()]
        self._legend(66, "points", points)
        self._legend(94, "contact bands", bands)

    def _legend(self, below: float, title: str, keys: list) -> None:
        y = self._bottom + below
        if keys:
            self._label(LEFT - 70, y, title, fontsize=9)
        corner = (LEFT + 46) / WIDTH, 1 - y / self._size[1]
        looks: dict[str, Any] = {"loc": "center left", "fontsize": 9, "frameon": False}
        looks |= {"handletextpad": 0.3, "columnspacing": 1.1, "borderpad": 0}
        for count in range(min(len(keys), MAX_KEYS), 0, -1):
            keys = keys[:count]
            legend = self.figure.legend(handles=keys, ncols=count, bbox_to_anchor=corner, **looks)
            if legend.get_window_extent().x1 < 0.99 * self.figure.bbox.width:
                return
            legend.remove()
