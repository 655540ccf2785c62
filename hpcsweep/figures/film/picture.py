"""Draw the frames of a film: orbit diagrams on one matplotlib figure, with fixed axes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.diagrams.mesh import edges_of
from hpcsweep.figures.film.frames import Film, Survey
from hpcsweep.figures.overlay import Drawn, lay, overlay_keys
from hpcsweep.solvers.outcome import Outcome

PIXELS = 1280, 960
"""Width of a frame of MP4 and of GIF, unless it is requested."""
WIDTH = 12.8
"""Inches: sizes of letters and points are those of figures."""
SCALE, BAND, REST = 0.12, 0.24, 2.0
"""Heights of the scale, of a contact band, and of what is around the panels (inches)."""
PANELS, MIN_PANEL, MAX_PANEL = 7.2, 1.0, 2.4
"""Height of all panels together, and bounds of one (inches)."""
MARGIN = 0.06
"""Room around the points, in ranges of a floor's displacement."""
MAX_SETS, MAX_COLUMNS = 14, 10
"""Contact sets that the legend names, the commonest, and its columns."""
LETTERS = 140
"""Letters side by side on a contact band."""


class Picture:
    """Painter of the frames of one film.

    Parameters
    ----------
    film : Film
    survey : Survey
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

    def __init__(self, film: Film, survey: Survey):
        self._film, study, self._labels = film, film.study, film.structure.contact_labels
        self._along = study.along_of(0)
        symbols = {"omega": "Ω = {:.4f}", "amplitude": "A = {:.4g}"}
        self._symbol = symbols.get(study.run_dims[-2], "")
        sets = sorted(survey.contacts, key=lambda c: (-survey.contacts[c], c))
        self.sets = {
            c: (palette.contact_colour(c, self._labels), name)
            for c, name in zip(sets, style.set_names(sets, self._labels), strict=True)
        }
        self.keys = {key: self._key(key) for key in sorted(survey.keys)}
        n_panels, n_bands = len(film.words), len(study.directions) if self.sets else 0
        tall = float(np.clip(PANELS / n_panels, MIN_PANEL, MAX_PANEL))
        heights = [SCALE, *([BAND * n_bands] if n_bands else []), *[tall] * n_panels]
        pixels = film.request.width or PIXELS[film.request.is_gif]
        dpi = pixels / WIDTH
        # an even number of pixels; matplotlib cuts to whole ones
        size = pixels + 0.01, 2 * round((sum(heights) + REST) * dpi / 2) + 0.01
        inches = size[0] / dpi, size[1] / dpi
        self.figure, axes = style.new_grid(len(heights), 1, inches, dpi=dpi, height_ratios=heights)
        scale, *rest = axes[:, 0]
        self.panels = rest[: -n_panels - 1 : -1]
        for panel, label, *ends in zip(self.panels, film.words, *survey[1:3], strict=True):
            low, high = view.apart(*ends)
            pad = MARGIN * (high - low) or 1e-6
            style.limit_amplitudes(panel, self._along)
            panel.set(ylim=(low - pad, high + pad), ylabel=label)
            style.draw_lattice(panel)
            panel.tick_params(labelbottom=panel is self.panels[0])
        self.panels[0].set_xlabel(labels.along(study))
        self._edges = np.clip(edges_of(self._along), *panel.get_xlim())
        self.bands: Any = None
        if n_bands:
            self.bands = rest[0]
            words = [f"contact, {name}" for name in study.directions]
            self.bands.set(xlim=panel.get_xlim(), ylim=(n_bands, 0), xticks=[], frame_on=False)
            self.bands.set_yticks(np.arange(n_bands) + 0.5, words, fontsize=8)
            self.bands.tick_params(length=0)
        room = 0.9 * pixels / self._along.size
        radius = float(np.clip(0.3 * room, 1.0, 3.2 * max(pixels / PIXELS[0], 0.6)))
        # points of chaos are fine, those of orbits are large and lie on them
        sizes = ("s", np.clip(radius, 1.5, 3)), ("o", 2 * radius + 1)
        self._markers: list[dict[str, Any]] = [
            {"ls": "none", "marker": marker, "ms": 72 * size / dpi, "mew": 0}
            for marker, size in sizes
        ]
        self._value, self._mark = self._draw_scale(scale, study.frames[[*survey.frames]])
        self._add_legend()
        measure = film.measure.label if film.measure else ""
        fixed = style.parameters(study.structures[0], other=study.structures[-1])
        style.head(self.figure, measure, ",  ".join([fixed, *study.ties]))
        self.figure.align_ylabels(self.panels)
        self.figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08)
        self.figure.canvas.draw()
        self._still = self.figure.canvas.copy_from_bbox(self.figure.bbox)

    def paint(self, frame: int) -> np.ndarray:
        """Paint a frame of the film; see `draw`."""
        film = self._film
        return self.draw(float(film.study.frames[frame]), film.read(frame), film.branches(frame))

    def draw(
        self, value: float, frame: Mapping[str, np.ndarray], branches: Sequence[Drawn] = ()
    ) -> np.ndarray:
        """Draw one frame.

        Parameters
        ----------
        value : float
            Frequency, along that amplitude.
        frame : mapping
            From `Film.read`.
        branches : sequence of Drawn, optional
            Beneath the points.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green, blue.
        """
        canvas = self.figure.canvas
        canvas.restore_region(self._still)
        for artist in (*self._bands(frame), *self._branches(branches), *self._points(frame)):
            self.figure.draw_artist(artist)
            artist.remove()
        self._value.set_text(self._symbol.format(value))
        self._mark.set_xdata([value])
        for artist in (self._value, self._mark):
            self.figure.draw_artist(artist)
        return np.array(canvas.buffer_rgba())[..., :3]

    def _bands(self, frame: Mapping[str, np.ndarray]) -> Iterator[Any]:
        """Draw the contact sets, a band for each direction, named where there is room."""
        done = frame["outcome"] == Outcome.COMPLETE
        for d, row in enumerate(frame["contact"] if self.bands else ()):
            first, end = np.transpose(style.stretches(row, done[d]))
            left, right = self._edges[first], self._edges[end]
            sets = [int(row[k]) if done[d, k] else None for k in first]
            colours = [palette.NOTHING if c is None else self.sets[c][0] for c in sets]
            spans = [*zip(left, right - left, strict=True)]
            yield self.bands.broken_barh(spans, (d + 0.04, 0.92), facecolors=colours, lw=0)
            rooms = (LETTERS * (right - left) / np.ptp(self._edges)).astype(int)
            for place in np.flatnonzero(rooms > 1):
                contact, room = sets[place], int(rooms[place])
                name = "" if contact is None else style.set_name(contact, self._labels, room)
                if name and len(name) <= room:
                    at = 0.5 * (left[place] + right[place]), d + 0.5
                    looks = {"ha": "center", "va": "center", "fontsize": 9}
                    yield self.bands.text(*at, name, color=palette.ink(colours[place]), **looks)

    def _branches(self, branches: Sequence[Drawn]) -> Iterator[Any]:
        for coordinate, panel in zip(self._film.coordinates, self.panels, strict=False):
            yield from lay(panel, branches, coordinate)

    def _points(self, frame: Mapping[str, np.ndarray]) -> Iterator[Any]:
        points, large = frame["poincare"], frame["orbit_period"] > 0
        along = np.broadcast_to(self._along[:, None], points.shape[1:3])
        for d in reversed(range(len(points))):  # the first direction is on top
            for is_large, looks in enumerate(self._markers):
                for key, (colour, _) in self.keys.items():
                    runs = (frame["key"][d] == key) & (large[d] == is_large)
                    for place, panel in enumerate(self.panels if runs.any() else ()):
                        drawn = along[runs].ravel(), points[d, runs, :, place].ravel()
                        yield from panel.plot(*drawn, color=colour, **looks)

    def _key(self, key: int) -> tuple[str, str]:
        """Return the colour and the name of a direction, a motion or a contact set."""
        film = self._film
        if film.request.color == "period":
            return palette.motions_of(film.structure)[key][::-1]
        if film.request.color == "contact":
            return self.sets[key]
        name = film.study.directions[key]
        return palette.DIRECTIONS[name], film.study.words[name] + (" (beneath)" if key else "")

    def _draw_scale(self, axis, values: np.ndarray):
        """Draw the scale of frequencies, or amplitudes; return the text and the mark that move."""
        low, high = values.min(), values.max()
        around = (low, high) if high > low else (low - 1, low + 1)
        axis.set(frame_on=False, yticks=[], xlim=around)
        axis.plot([low, high], [0, 0], color="0.6", linewidth=2, clip_on=False)
        axis.set_xticks([low, high], [f"{low:.4g}", f"{high:.4g}"])
        is_frequency = self._film.study.run_dims[-2] == "omega"
        natural = enumerate(self._film.structure.frequencies if is_frequency else (), 1)
        inside = {rf"$\omega_{{{i}}}$": w for i, w in natural if low < w < high}
        axis.set_xticks([*inside.values()], [*inside], minor=True)
        axis.tick_params(which="both", direction="inout", length=8, labelsize=9, color="0.4")
        axis.tick_params(which="minor", top=True, labeltop=True, bottom=False, labelbottom=False)
        looks = {"c": palette.DARK_INK, "animated": True}
        text = axis.set_title("Ω", loc="left", fontsize=20, **looks)
        return text, axis.plot([low], [0], "o", ms=9, clip_on=False, **looks)[0]

    def _add_legend(self) -> None:
        """Put the keys of points, branches and contact sets below the panels."""
        points = {} if self._film.request.color == "contact" else self.keys
        handles: list[Any] = [labels.dot(name, colour) for colour, name in points.values()]
        if self._film.overlay:
            handles += overlay_keys()
        sets = [*self.sets.values()]
        handles += [labels.area(name, colour) for colour, name in sets[:MAX_SETS]]
        if len(sets) > MAX_SETS:
            handles.append(labels.dot(style.rarer_sets(len(sets) - MAX_SETS), "none"))
        labels.legend_below(self.figure, handles, "", MAX_COLUMNS)
