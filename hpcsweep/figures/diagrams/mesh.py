"""Draw panels over amplitude and frequency: one cell a run, or one point for scattered runs."""

import functools
from collections.abc import Sequence

import numpy as np

from hpcsweep.dynamics.classify import MOTION
from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.inferred import VARIABLES as INFERRED
from hpcsweep.studies.points import FORCING_AMPLITUDE

VARIABLES = ("orbit_period", "outcome", "contact", "drift", "lyapunov")
"""Variables of maps, beside the classes."""
SCATTERED = FORCING_AMPLITUDE.name
"""Variable of results whose frames share no amplitudes."""


def open_map(frames, value: str | None = None, direction: str | None = None):
    """Read the variables of maps, one frame at a time, without the points behind the classes.

    Parameters
    ----------
    frames : hpcsweep.store.Frames
    value : str, optional
        A further variable.
    direction : {"up", "down"}, optional
        Default the first.

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
    least_cells(study.amplitude.size)
    further = () if value is None else (value,)
    direction = study.directions[0] if direction is None else direction
    if direction not in study.directions:
        there = " and ".join(study.directions)
        raise style.PlotError(f"--direction {direction}: the results hold {there} only")
    names = (*VARIABLES, *INFERRED, *further)
    results = frames.gather(names, direction=direction, derive={MOTION: style.classes_of})
    return results.assign_attrs(frames.audit())


def least_cells(amplitudes: int) -> None:
    """Refuse results that form neither a map nor one row of a map.

    Raises
    ------
    PlotError
        If there are fewer than two amplitudes.
    """
    if amplitudes < 2:
        raise style.PlotError(f"a map needs at least 2 amplitudes, the results hold {amplitudes}")


def by_frequency(results):
    """Sort the frames by frequency and refuse results that do not form a map.

    Raises
    ------
    PlotError
        If there are fewer than two amplitudes.
    """
    least_cells(amplitudes(results).size)
    return results.isel(omega=np.argsort(results["omega"].values, kind="stable"))


def amplitudes(results) -> np.ndarray:
    """Return the amplitudes shared by all frames, or for a list of points one a frame."""
    return results[SCATTERED if SCATTERED in results else "amplitude"].values


def draw_mesh(axis, results, values: np.ndarray, **options):
    """Draw values of shape (n_frames, n_amplitudes); where they are masked the panel is hatched.

    If cells are smaller than pixels, only as many are drawn as there are pixels. A list of points
    is drawn as points, without the masked ones.

    Returns
    -------
    matplotlib.collections.QuadMesh or PathCollection
    """
    axis.set_facecolor(palette.NOTHING)
    structure = style.structure_of(results)
    axis.set_xlabel(labels.amplitude(structure))
    axis.set_ylabel(labels.frequency(structure))
    if SCATTERED in results:
        size = float(np.clip(6e3 / len(values), 3.0, 40.0))
        rim = {"edgecolors": "0.2", "linewidths": 0.3 if size > 10 else 0.0}
        where = amplitudes(results), results["omega"].values
        return axis.scatter(*where, s=size, c=values[:, 0], plotnonfinite=False, **rim, **options)
    if np.ma.getmaskarray(values).any():
        axis.patch.set(hatch="xxxx", edgecolor="0.55")
    width, height = style.pixels(axis.get_figure())
    rows = _thinned(values.shape[0], height)
    columns = _thinned(values.shape[1], width)
    return axis.pcolormesh(
        edges_of(results["amplitude"].values[columns]),
        edges_of(results["omega"].values[rows]),
        values[rows][:, columns],
        rasterized=True,
        **options,
    )


def draw_classes(axis, results, index: np.ndarray, colours: Sequence[str]) -> None:
    """Draw indices of colours, shape (n_frames, n_amplitudes); hatched where negative."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    draw_mesh(
        axis,
        results,
        np.ma.masked_less(index, 0),
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours)),
    )


def _thinned(cells: int, most: float) -> np.ndarray:
    """Return evenly spread cells, including the first and the last, at most one a pixel."""
    count = min(cells, max(int(most), 2))
    return np.linspace(0, cells - 1, count).round().astype(int)


def draw_grazing(axis, results, structure) -> None:
    """Draw the amplitude at which the free steady state touches the stop, in closed form."""
    limits = axis.get_xlim(), axis.get_ylim()
    amplitude, omega = _curve(structure, *limits[1])
    axis.plot(amplitude, omega, color="white", linewidth=1.6)
    axis.plot(amplitude, omega, color=palette.GRAZING, linewidth=0.9)
    axis.set(xlim=limits[0], ylim=limits[1])


def grazing_keys(results) -> list:
    """Return the legend key of the grazing curve; none where it does not cross the map."""
    omega, across = results["omega"].values, amplitudes(results)
    reached, _ = _curve(style.structure_of(results), omega.min(), omega.max())
    if not ((across.min() <= reached) & (reached <= across.max())).any():
        return []
    return [grazing_key()]


def grazing_key():
    """Return the legend key of the grazing curve."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=palette.GRAZING, linewidth=1.2, label="grazing, closed form")


def legend_of_shares(
    figure,
    entries: list[tuple[str, str, float]],
    blank: float,
    blank_name: str,
    more: Sequence = (),
    of: str = "runs",
) -> None:
    """Add a legend of colours beside the panels, with the share of runs of each.

    Parameters
    ----------
    entries : list of (name, colour, share)
    blank : float
        Share of cells without a colour, which are hatched; not named if it is 0.
    blank_name : str
    more : sequence of matplotlib artists
        Further keys.
    of : str
        Noun for the runs of the shares.
    """
    from matplotlib.patches import Patch

    handles = [
        Patch(
            facecolor=colour,
            edgecolor="0.3",
            linewidth=0.5,
            label=f"{name}  {style.percent(share)}",
        )
        for name, colour, share in entries
    ]
    if blank:
        handles.append(
            Patch(
                facecolor=palette.NOTHING,
                edgecolor="0.55",
                hatch="xxxx",
                linewidth=0.5,
                label=f"{blank_name}  {style.percent(blank)}",
            )
        )
    handles += more
    figure.legend(
        handles=handles,
        loc="outside right center",
        fontsize=8,
        frameon=False,
        title=f"share of {of}",
        title_fontsize=8,
        alignment="left",
    )


@functools.lru_cache(maxsize=8)
def _curve(structure, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    # cached for the panels and pages of a study: computing it takes longer than drawing it
    omega = np.linspace(low, high, 800)
    with np.errstate(divide="ignore"):
        return np.array([_grazing(structure, value) for value in omega]), omega


def _grazing(structure, omega: float) -> float:
    try:
        return structure.grazing_amplitude(float(omega))
    except ZeroDivisionError:
        return 0.0


def map_height(results, height: float) -> float:
    """Return the height of a map: a strip for one frequency."""
    return height if results.sizes["omega"] > 1 else 0.5 * height


def mark_strip(axis, results) -> None:
    """Mark the one frequency of a strip, in place of an axis of frequencies."""
    if results.sizes["omega"] == 1:
        axis.set_yticks(results["omega"].values)


def edges_of(centres: np.ndarray) -> np.ndarray:
    """Return the borders of cells around ascending values; close ones of a single value."""
    if centres.size == 1:
        return centres[0] + (abs(centres[0]) or 1.0) * np.array([-5e-4, 5e-4])
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate(
        ([1.5 * centres[0] - 0.5 * centres[1]], middle, [1.5 * centres[-1] - 0.5 * centres[-2]])
    )
