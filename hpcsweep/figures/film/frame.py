"""Paint the pictures of a film: orbit diagrams as pixels over axes that are drawn once.

Every frame paints its points, contact bands and frequency onto a copy of the axes.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from hpcsweep.figures.film.axes import draw_axes
from hpcsweep.figures.film.pixels import (
    WHITE,
    blend,
    disc,
    fine_point,
    look_up,
    packed_colour,
    polyline,
    text_mask,
)
from hpcsweep.figures.film.scene import STABLE, UNSTABLE, Page, Scene
from hpcsweep.figures.overlay import Drawn
from hpcsweep.figures.palette import DARK_INK, DIRECTIONS, MOTION_COLOURS, ink
from hpcsweep.solvers.outcome import Outcome

LETTER = 0.62
"""Width of a letter on a contact band, of its height."""


class Painter:
    """Painter of the frames of one scene.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    page : Page
    """

    def __init__(self, scene: Scene):
        self.scene = scene
        self.page = page = Page(scene)
        self._background = draw_axes(scene, page)
        self._nearest = page.amplitude_index(scene.amplitude)
        self._column = page.column(scene.amplitude)
        room = (page.right - page.left) / max(scene.amplitude.size, 1)
        self._radius = float(np.clip(0.3 * room, 1.0, 3.2 * max(page.scale, 0.6)))

    def paint(
        self, omega: float, frame: Mapping[str, np.ndarray], branches: Sequence[Drawn] = ()
    ) -> np.ndarray:
        """Paint one frame.

        Parameters
        ----------
        omega : float
        frame : mapping
            ``poincare`` (direction, amplitude, point, floors shown), NaN where there is no point;
            ``orbit_period``, ``outcome`` and, where the colours need them, ``contact`` and
            ``motion`` (index in `palette.MOTIONS`), all (direction, amplitude).
        branches : sequence of Drawn, optional
            Beneath the points.

        Returns
        -------
        ndarray of uint8, shape (height, width, 4)
            Red, green, blue, 255.
        """
        canvas = self._background.copy()
        self._paint_bands(canvas, frame)
        self._paint_branches(canvas, branches)
        self._paint_points(canvas, frame)
        self._paint_omega(canvas, omega)
        return canvas.view(np.uint8).reshape(self.page.height, self.page.width, 4)

    def _paint_branches(self, canvas: np.ndarray, branches: Sequence[Drawn]) -> None:
        flat, floors = canvas.reshape(-1), self.scene.floors or range(self.scene.n_panels)
        pieces = [(one, *piece) for one in branches for piece in one.pieces()]
        for one, piece, steady in sorted(pieces, key=lambda entry: entry[-1]):  # stable on top
            colour, width = STABLE if steady else UNSTABLE
            stamp = disc(0.5 * (width - 1) * self.page.scale)
            for panel, turn in np.ndindex(self.scene.n_panels, one.period):
                top, bottom, left, right = self.page.panels[panel]
                rows = self.page.row(panel, one.points[piece, turn, floors[panel]])
                x, y = polyline(self.page.column(one.value[piece]), rows)
                for dy, dx in stamp:
                    there = (y + dy >= top) & (y + dy < bottom)
                    there &= (x + dx >= left) & (x + dx < right)
                    flat[((y + dy) * self.page.width + x + dx)[there]] = packed_colour(colour)

    def _paint_points(self, canvas: np.ndarray, frame: Mapping[str, np.ndarray]) -> None:
        points = frame["poincare"][..., : self.scene.n_panels]
        colours = self._run_colours(frame)
        settled = frame["orbit_period"] > 0
        flat = canvas.reshape(-1)
        # points of chaos are fine, those of orbits are large; the first direction is on top
        for d in reversed(range(len(points))):
            there = np.isfinite(points[d, :, :, 0])
            for few, stamp in ((False, fine_point(self._radius)), (True, disc(self._radius))):
                run, point = np.nonzero(there & (settled[d] == few)[:, None])
                for floor in range(self.scene.n_panels if run.size else 0):
                    top, bottom, left, right = self.page.panels[floor]
                    rows = self.page.row(floor, points[d, run, point, floor])
                    columns, colour = self._column[run], colours[d, run]
                    for dy, dx in stamp:
                        y, x = rows + dy, columns + dx
                        inside = (y >= top) & (y < bottom) & (x >= left) & (x < right)
                        flat[(y * self.page.width + x)[inside]] = colour[inside]

    def _run_colours(self, frame: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the packed colour of every run's points, shape (direction, amplitude)."""
        scene = self.scene
        if scene.color == "direction":
            shape = frame["orbit_period"].shape
            own = [packed_colour(DIRECTIONS[name]) for name in scene.directions]
            return np.broadcast_to(np.array(own, np.uint32)[:, None], shape)
        if scene.color == "period":
            of = {place: packed_colour(colour) for place, colour in enumerate(MOTION_COLOURS)}
            return look_up(frame["motion"], of)
        return self._contact_colours(frame)

    def _contact_colours(self, frame: Mapping[str, np.ndarray]) -> np.ndarray:
        scene = self.scene
        of = {c: packed_colour(scene.contact_colour(c)) for c in scene.contacts}
        return look_up(frame["contact"], of)

    def _paint_bands(self, canvas: np.ndarray, frame: Mapping[str, np.ndarray]) -> None:
        """Paint the contact sets, a band for each direction, labelled where there is room."""
        if not self.page.bands:
            return
        colours = self._contact_colours(frame)
        size = max(9, round(13 * self.page.scale))
        for d, (top, bottom) in enumerate(self.page.bands):
            done = frame["outcome"][d] == Outcome.COMPLETE
            own = np.where(done, colours[d], np.uint32(WHITE))
            chosen = np.append(own, np.uint32(WHITE))[self._nearest]
            canvas[top:bottom, self.page.left : self.page.right] = chosen
            # runs without a set have an index of their own, as sets may use all 64 bits
            sets, index = np.unique(frame["contact"][d], return_inverse=True)
            at = np.append(np.where(done, index, -1), -1)[self._nearest]
            starts = np.flatnonzero(np.diff(at, prepend=at[0] - 1))
            for start, end in zip(starts, [*starts[1:], at.size], strict=True):
                if at[start] < 0:
                    continue
                contact = int(sets[at[start]])
                room = int((end - start) / (LETTER * size))
                mask = text_mask(self.scene.set_name(contact, max(room, 1)), size)
                if mask.shape[1] + 6 <= end - start:
                    x = self.page.left + (start + end - mask.shape[1]) // 2
                    y = (top + bottom - mask.shape[0]) // 2
                    blend(canvas, mask, y, x, ink(self.scene.contact_colour(contact)))

    def _paint_omega(self, canvas: np.ndarray, omega: float) -> None:
        s = self.page.scale
        mask = text_mask(f"Ω = {omega:.4f}", max(12, round(30 * s)))
        blend(canvas, mask, int(46 * s), self.page.left, DARK_INK)
        low, high = self.scene.omega
        share = (omega - low) / (high - low) if high > low else 0.5
        left, right, y = self.page.omega_scale()
        x = round(left + share * (right - left))
        for dy, dx in disc(6 * s):
            canvas[y + dy, x + dx] = packed_colour(DARK_INK)
