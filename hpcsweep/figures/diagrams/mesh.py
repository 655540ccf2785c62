"""The one mesh of all maps: values over two parameters, one cell a run, or a point a scattered run.

A figure gives numbers, or indices of its own colours, and says what they mean; axes, cells, hatched
areas, grazing amplitudes and keys are made here.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import MOTION
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.inferred import draw_cells, drawn_motions, gather
from hpcsweep.figures.overlay import draw_specials, special_keys
from hpcsweep.studies.points import FORCING_AMPLITUDE

VARIABLES = ("orbit_period", "outcome", "contact", "drift", "lyapunov")
"""Variables of maps, beside the classes."""
COLUMNS = 3
"""Of equal panels, at most."""
SCATTERED = FORCING_AMPLITUDE.name
"""Variable of results whose frames share no amplitudes."""


def open_map(
    frames, value: str | None = None, direction: str | None = None, cells: bool | None = None
):
    """Read the variables of maps, one frame at a time, without the points behind the classes.

    Parameters
    ----------
    frames : hpcsweep.store.Frames
    value : str, optional
        A further variable.
    direction : {"up", "down"}, optional
        Default the first.
    cells : bool, optional
        Whether the cells of a refined map will be outlined.

    Returns
    -------
    xarray.Dataset
        `VARIABLES`, `value` and the motion classes of one direction; of a refined map also what
        is inferred, and its audit as an attribute.

    Raises
    ------
    PlotError
        If there is no such direction, or fewer than two frames or amplitudes.
    """
    study = frames.study
    need_map(study.run_dims, study.amplitude.size)
    further = () if value is None else (value,)
    direction = study.directions[style.direction_index(study.directions, direction)]
    names = (*VARIABLES, *further)
    return gather(frames, names, cells, direction=direction, derive={MOTION: style.classes_of})


def need_map(dims: Sequence[str], amplitudes: int) -> None:
    """Refuse runs that are not spread over amplitude and frequency, or form not even one row.

    Raises
    ------
    PlotError
    """
    if not {"omega", "amplitude"} <= {*dims}:
        raise style.PlotError(f"no map over amplitude and frequency: the sweep is along {dims[-1]}")
    if amplitudes < 2:
        raise style.PlotError(f"a map needs at least 2 amplitudes, the results hold {amplitudes}")


def by_frequency(results):
    """Take the first direction, sort the frames by frequency, and refuse no map.

    Raises
    ------
    PlotError
        If there are fewer than two amplitudes.
    """
    need_map(results["outcome"].dims, amplitudes(results).size)
    results = results.transpose("direction", "omega", "amplitude", ...)
    order = np.argsort(results["omega"].values, kind="stable")
    return results.isel(omega=order, direction=[0])


def amplitudes(results) -> np.ndarray:
    """Return the amplitudes shared by all frames, or for a list of points one a frame."""
    return results[SCATTERED if SCATTERED in results else "amplitude"].values


def panels(
    count: int,
    single: tuple[float, float],
    each: tuple[float, float],
    more: tuple[float, float] = (0.0, 0.0),
    sharey: bool = True,
    columns: int = COLUMNS,
    sharex: bool = True,
):
    """Make a figure of equal panels with common axes, row by row.

    Parameters
    ----------
    count : int
    one : tuple of float
        Width and height (inches) of a figure of one panel.
    each, more : tuple of float
        Of each of several panels, and of what is beside them.
    sharey : bool
    columns : int
        At most so many beside each other.
    sharex : bool

    Returns
    -------
    figure, list of axes
    """
    columns = min(count, columns)
    rows = -(-count // columns)
    size = single if count == 1 else (each[0] * columns + more[0], each[1] * rows + more[1])
    figure, axes = style.new_grid(rows, columns, size, sharex=sharex, sharey=sharey)
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    return figure, list(axes.flat[:count])


def edges_of(centres: np.ndarray) -> np.ndarray:
    """Return the borders of cells around ascending values; close ones of a single value.

    The cells of values above 0 end there.
    """
    if centres.size == 1:
        return centres[0] + (abs(centres[0]) or 1.0) * np.array([-5e-4, 5e-4])
    middle = 0.5 * (centres[1:] + centres[:-1])
    first, last = 1.5 * centres[0] - 0.5 * centres[1], 1.5 * centres[-1] - 0.5 * centres[-2]
    return np.concatenate(([max(first, 0.0) if centres[0] > 0 else first], middle, [last]))


class Grid(NamedTuple):
    """Places of the cells of a map, and the labels of its axes.

    Attributes
    ----------
    horizontal, vertical : ndarray
        Ascending places of columns and rows.
    names : (str, str)
        Labels of the axes.
    edges : callable
        Return the borders of the rows; see `edges_of`.
    is_list : bool
        Whether rows are single points, each with a place of its own along the horizontal axis.
    """

    horizontal: np.ndarray
    vertical: np.ndarray
    names: tuple[str, str] = ("", "")
    edges: Callable[[np.ndarray], np.ndarray] = edges_of
    is_list: bool = False

    def draw(self, axis, values: np.ndarray, **looks):
        """Draw values of shape (rows, columns); where they are masked the panel is hatched.

        A list of points is drawn as points, without the masked ones.

        Returns
        -------
        matplotlib.collections.QuadMesh or PathCollection
        """
        axis.set(xlabel=self.names[0], ylabel=self.names[1])
        axis.set_facecolor(palette.NOTHING)
        if self.is_list:
            size = float(np.clip(6e3 / len(values), 3.0, 40.0))
            looks |= {"edgecolors": "0.2", "linewidths": 0.3 if size > 10 else 0.0, "s": size}
            places = self.horizontal, self.vertical
            return axis.scatter(*places, c=values[:, 0], plotnonfinite=False, **looks)
        if np.ma.getmaskarray(values).any():
            axis.patch.set(hatch="xxxx", edgecolor="0.55")
        sides = edges_of(self.horizontal), self.edges(self.vertical)
        return axis.pcolormesh(*sides, values, rasterized=True, **looks)

    def fill(self, axis, index: np.ndarray, colours: Sequence[str]) -> None:
        """Draw cells by the indices of their colours; hatched where these are negative."""
        from matplotlib.colors import BoundaryNorm, ListedColormap

        norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
        self.draw(axis, np.ma.masked_less(index, 0), cmap=ListedColormap(colours), norm=norm)


def grid_of(results) -> Grid:
    """Return the grid of results over amplitude and frequency."""
    structure = style.structure_of(results)
    names = labels.parameter(structure, "amplitude"), labels.parameter(structure, "omega")
    places = amplitudes(results), results["omega"].values
    return Grid(*places, names, is_list=SCATTERED in results)


def finish(axes, results, cells: bool | None = None) -> None:
    """Draw on each map its grazing amplitudes, special points, and `cells` of a refined one."""
    for axis in axes:
        limits = axis.get_xlim(), axis.get_ylim()
        amplitude, omega = _curve(style.structure_of(results), *limits[1])
        for colour, width in (("white", 1.6), (palette.GRAZING, 0.9)):
            axis.plot(amplitude, omega, color=colour, linewidth=width)
        draw_specials(axis, results)
        if cells:
            draw_cells(axis, results, results["omega"].values, results["amplitude"].values)
        axis.set(xlim=limits[0], ylim=limits[1])
        if results.sizes["omega"] == 1:
            axis.set_yticks(results["omega"].values)
        axis.label_outer()


def map_keys(results) -> list:
    """Return the legend keys of the grazing curve, where it crosses the map, and special points."""
    omega, across = results["omega"].values, amplitudes(results)
    reached, _ = _curve(style.structure_of(results), omega.min(), omega.max())
    crosses = ((across.min() <= reached) & (reached <= across.max())).any()
    return [*([grazing_key()] if crosses else []), *special_keys(results)]


def grazing_key():
    """Return the legend key of the grazing curve."""
    return labels.key("grazing, closed form", color=palette.GRAZING, linewidth=1.2)


def share_keys(
    index: np.ndarray,
    entries: Sequence[tuple[str, str]],
    missing: str,
    always: Sequence[str] = (),
    total: int | None = None,
) -> list:
    """Return the legend keys of colours that occur on a map, with the share of each.

    Parameters
    ----------
    index : ndarray of int
        Of all cells, in `entries`; negative where there is no colour.
    entries : sequence of (name, colour)
    missing : str
        Name of cells without a colour, which are hatched.
    always : sequence of str
        Names that are there even if their colours are not.
    total : int, optional
        Cells of which the shares are; by default all.
    """
    handles = [
        labels.area(
            f"{name}  {style.percent(int((index == place).sum()) / (total or index.size))}", colour
        )
        for place, (name, colour) in enumerate(entries)
        if name in always or (index == place).any()
    ]
    absent = float((index < 0).mean())
    return [*handles, labels.blank(f"{missing}  {style.percent(absent)}")] if absent else handles


def motion_keys(index: np.ndarray, structure, by_period: bool) -> list:
    """Return the legend keys of motions that occur, and always of the undecided ones, with shares.

    Parameters
    ----------
    index : ndarray of int
        Of all runs, in `palette.MOTIONS`; -1 where nothing is computed.
    structure : Structure
    by_period : bool
        See `drawn_motions`.
    """
    computed = max(int((index >= 0).sum()), 1)
    names = drawn_motions(by_period, structure)
    return share_keys(index, names, "not computed", ("undecided",), computed)


def legend_of_shares(figure, handles: Sequence, inferred: bool) -> None:
    """Add a legend of shares beside the panels: of runs, or of points that may be inferred."""
    title = f"share of {'points' if inferred else 'runs'}"
    place = {"loc": "outside right center", "alignment": "left", "title_fontsize": 8}
    figure.legend(handles=handles, title=title, **place, **labels.LEGEND)


@functools.lru_cache(maxsize=8)
def _curve(structure, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    # cached for the panels and pages of a study: computing it takes longer than drawing it
    omega = np.linspace(low, high, 800)
    with np.errstate(divide="ignore"):
        reached = [style.grazing_amplitude(structure, value) for value in omega.tolist()]
    return np.array(reached), omega


def map_height(results, height: float) -> float:
    """Return the height of a map: a strip for one frequency."""
    return height if results.sizes["omega"] > 1 else 0.5 * height
