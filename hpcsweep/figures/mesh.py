"""Panels over amplitude and frequency: one cell a run."""

import numpy as np

from hpcsweep.figures.style import AMPLITUDE, OMEGA, PlotError

GRAZING = "#b00000"
"""Colour of the grazing curve."""


def by_frequency(results):
    """Sort the frames by frequency and refuse what is no map.

    Raises
    ------
    PlotError
        If there are fewer than two frames or amplitudes.
    """
    sizes = results.sizes["frame"], results.sizes["amplitude"]
    if min(sizes) < 2:
        raise PlotError(
            "a map needs at least 2 frames and 2 amplitudes, the results hold "
            f"{sizes[0]} and {sizes[1]}"
        )
    return results.isel(frame=np.argsort(results["omega"].values, kind="stable"))


def draw_mesh(axis, results, values: np.ndarray, **options):
    """Draw values of shape (n_frames, n_amplitudes); where they are masked the panel is hatched.

    Returns
    -------
    matplotlib.collections.QuadMesh
    """
    axis.set_facecolor("white")
    if np.ma.getmaskarray(values).any():
        axis.patch.set(hatch="xxxx", edgecolor="0.55")
    mesh = axis.pcolormesh(
        _edges(results["amplitude"].values),
        _edges(results["omega"].values),
        values,
        rasterized=True,
        **options,
    )
    axis.set_xlabel(AMPLITUDE)
    axis.set_ylabel(OMEGA)
    return mesh


def draw_grazing(axis, results, structure) -> None:
    """Draw the amplitude at which the free steady state touches the stop, in closed form."""
    omega = np.linspace(*_edges(results["omega"].values)[[0, -1]], 800)
    with np.errstate(divide="ignore"):
        amplitude = [_grazing(structure, value) for value in omega]
    limits = axis.get_xlim(), axis.get_ylim()
    axis.plot(amplitude, omega, color="white", linewidth=1.6)
    axis.plot(amplitude, omega, color=GRAZING, linewidth=0.9)
    axis.set(xlim=limits[0], ylim=limits[1])


def grazing_key():
    """Make the legend's key of that curve."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=GRAZING, linewidth=1.2, label="grazing, closed form")


def _grazing(structure, omega: float) -> float:
    try:
        return structure.grazing_amplitude(float(omega))
    except ZeroDivisionError:
        return 0.0


def _edges(centres: np.ndarray) -> np.ndarray:
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate(
        ([1.5 * centres[0] - 0.5 * centres[1]], middle, [1.5 * centres[-1] - 0.5 * centres[-2]])
    )
