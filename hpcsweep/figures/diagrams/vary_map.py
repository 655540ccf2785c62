"""Maps over a key that a job varies."""

import math
import re
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams import mesh
from hpcsweep.figures.inferred import drawn_classes, inferred, is_by_period, share_note
from hpcsweep.figures.options import DIRECTION, OMEGA, Option, figure_of
from hpcsweep.figures.style import PlotError
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.run_names import written
from hpcsweep.studies.study import as_kind

OVER = Option(
    "--over", "key on the vertical axis (default: the one with most values)", metavar="KEY"
)
MAX_PANELS, MAX_FACETS = 12, (8, 8)
"""Most panels side by side, and rows and columns of those of two keys."""
NARROW = 2.6, 2.3
"""Width and height of a panel where there are more columns than `mesh.COLUMNS` (inches)."""
MAX_TICKS = 8
"""Values that are all marked on the vertical axis."""
WIDE = 30.0
"""Ratio of the largest to the smallest value from which on they are drawn on a logarithmic axis."""


class Panels(NamedTuple):
    """One frame of every part to draw, with titles.

    Attributes
    ----------
    motion : ndarray of int, shape (n_panels, n_keys, n_amplitudes)
        Places in `hpcsweep.figures.palette.MOTIONS`, -1 where nothing is computed.
    grazing : ndarray, shape (n_panels, n_keys)
        Grazing amplitude of the free steady state of a part.
    titles : tuple of str
    columns : int
        Panels beside each other.
    key : str
        Name of the key on the vertical axis; its values are `values`.
    values : tuple
    title : str
        Name of the job, frequency and direction.
    study : RunGrid
        Of one part.
    by_period : bool
        Whether motions without a period share one class.
    inferred : float
        Share of the points that are inferred.
    """

    motion: np.ndarray
    grazing: np.ndarray
    titles: tuple[str, ...]
    columns: int
    key: str
    values: tuple[Any, ...]
    title: str
    study: RunGrid
    by_period: bool
    inferred: float


def load(frames, omega: float | None = None, direction: str | None = None, over: str | None = None):
    """Read one frame of every part to draw.

    Returns
    -------
    Panels
    """
    axes = frames.whole.study.axes
    if not axes:
        raise PlotError("--kind vary shows a key that a job varies ([vary])")
    study = as_kind(frames.study, RunGrid)
    style.need_amplitudes(study)
    free = {axis.name: axis for axis in axes if axis.name not in frames.given}
    if over is None and free:
        over = max(free, key=lambda name: len(free[name].values))
    if over is None or over not in free:
        raise PlotError(f"--over {over}: must be one of {', '.join(free)}")
    shape, row = [len(axis.values) for axis in free.values()], [*free].index(over)
    sizes = [size for size in (*shape[:row], *shape[row + 1 :]) if size > 1]
    count, in_facets = math.prod(sizes), len(sizes) == 2 and all(np.array(sizes) <= MAX_FACETS)
    if count > MAX_PANELS and not in_facets:
        others = ", ".join(name for name in free if name != over)
        raise PlotError(f"{count} panels are more than {MAX_PANELS}: choose {others} by --at")
    frame_dim, along = study.run_dims[-2:]
    over_amplitude = (frame_dim, along) == ("omega", "amplitude")
    place = style.frame_at(study, omega)
    motion, grazing, titles, from_cells = [], [], [], []
    for _ in frames.parts():
        frame, study = frames.dataset(place), as_kind(frames.study, RunGrid)
        at = style.direction_index(frame["direction"].values, direction)
        from_cells.append(float(inferred(frame)[at, 0].mean()))
        motion.append(palette.motion_index(*(values[at, 0] for values in drawn_classes(frame))))
        place_of = study.structure, float(frame["omega"].values.flat[0])
        grazing.append(style.grazing_amplitude(*place_of) if over_amplitude else np.inf)
        pairs = ((_words(n), written(v)) for n, v in frames.at.items() if n != over)
        titles.append(", ".join(" = ".join(pair) for pair in pairs))

    def by_panel(values: list) -> np.ndarray:
        """Return what parts have with shape (n_panels, n_keys, ...)."""
        array = np.reshape(values, (*shape, *np.shape(values)[1:]))
        array = np.moveaxis(array, row, len(shape) - 1)
        return array.reshape(count, shape[row], *array.shape[len(shape) :])

    common_omega = labels.common(study.omegas_of(place))
    words = "" if common_omega is None else style.frequency_words(study.structure, common_omega)
    about = [labels.path_words(study, frame), rf"$\Omega$ = {words}" * bool(words)]
    title = ",  ".join(filter(None, (*about[::-1], study.words[study.directions[at]])))
    return Panels(
        motion=by_panel(motion),
        grazing=by_panel(grazing),
        titles=tuple(by_panel(titles)[:, 0].tolist()),
        columns=sizes[-1] if in_facets else mesh.COLUMNS,
        key=_words(over) + labels.unit(study.structure, free[over].units),
        values=free[over].values,
        title=f"{frames.whole.name},  {title}",
        study=study,
        by_period=is_by_period(frame),
        inferred=float(np.mean(from_cells)),
    )


@figure_of("vary", "motions", load, OMEGA, DIRECTION, OVER)
def vary(results: Panels, **_options):
    """Motion classes over the amplitude and a key that the job varies, one frame.

    A panel for each value of another, of two others in rows and columns.

    Raises
    ------
    PlotError
        If nothing is computed.
    """
    if (results.motion < 0).all():
        raise PlotError("no run of this frame is computed yet")
    each = (3.5, 3.2) if results.columns <= mesh.COLUMNS else NARROW
    count, columns = len(results.titles), results.columns
    figure, axes = mesh.panels(count, (7.2, 5.2), each, (1.0, 0.9), columns=columns)
    for panel, axis in enumerate(axes):
        _panel(axis, results, panel)
        axis.set_title(re.sub(r", (?=[\w ]+ = )", "\n", results.titles[panel]), fontsize=9)
        axis.label_outer()
        if each is NARROW:
            axis.locator_params(axis="x", nbins=4)
    grazing = [mesh.grazing_key()] if np.isfinite(results.grazing).any() else []
    keys = mesh.motion_keys(results.motion, results.study.structure, results.by_period)
    mesh.legend_of_shares(figure, [*keys, *grazing], bool(results.inferred))
    return style.head(figure, results.title, share_note(results.inferred))


def _panel(axis, results: Panels, panel: int) -> None:
    """Draw the motions of one panel, and its grazing amplitude."""
    cells, grazing, keys = results.motion[panel], results.grazing[panel], np.array(results.values)
    is_number = keys.dtype.kind in "if" and keys.size > 1 and bool(np.isfinite(keys).all())
    is_number = is_number and bool(np.all(np.diff(keys) > 0))
    is_wide = is_number and keys[0] > 0 and keys[-1] / keys[0] >= WIDE
    heights = keys.astype(float) if is_number else np.arange(keys.size, dtype=float)
    edges_to = _edges_of_wide if is_wide else mesh.edges_of
    edges = edges_to(heights)
    names = labels.along(results.study), results.key
    grid = mesh.Grid(results.study.along_of(0), heights, names, edges_to)
    grid.fill(axis, cells, palette.MOTION_COLOURS)
    if is_wide:
        axis.set_yscale("log")
    if not is_number or (not is_wide and keys.size <= MAX_TICKS):
        axis.set_yticks(heights, [written(key) for key in results.values])
    limits = axis.get_xlim()
    for colour, width in (("white", 1.8), (palette.GRAZING, 1.0)):
        axis.stairs(grazing, edges, baseline=None, orientation="horizontal", color=colour, lw=width)
    axis.set(xlim=limits, ylim=(edges[0], edges[-1]))


def _edges_of_wide(keys: np.ndarray) -> np.ndarray:
    return keys[0] * np.exp(mesh.edges_of(np.log(keys / keys[0])))


def _words(name: str) -> str:
    return name.replace("_", " ")
