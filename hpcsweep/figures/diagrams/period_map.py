"""Map over amplitude and frequency of the motion of each run, or of one of its numbers."""

from pathlib import Path

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.figures.diagrams.mesh import by_frequency, draw_grazing, draw_mesh, grazing_key
from hpcsweep.figures.shades import BLANK, SHADES, shade_index, shade_shares
from hpcsweep.figures.style import (
    PALETTE,
    UNDECIDED,
    caption,
    classes_of,
    contact_name,
    direction_index,
    foot,
    job_of,
    need,
    new_grid,
    percent,
    save,
)
from hpcsweep.solvers.outcome import Outcome

VALUES = ("period", "drift", "contact", "modal_norm", "lyapunov")
MOST_SETS = len(PALETTE) - 1
"""Contact sets that have a colour of their own."""
MAX_COLUMNS = 3


def draw(results, path: Path, value: str = "period", direction: str | None = None) -> None:
    """Draw the map of one direction and write it to `path`.

    Parameters
    ----------
    results : xarray.Dataset
    path : Path
    value : {"period", "drift", "contact", "modal_norm", "lyapunov"}
        What the colours tell; period: the motion classes.
    direction : {"up", "down"}, optional
        Default the first.

    Raises
    ------
    PlotError
        If the file does not hold what is to be drawn.
    """
    if value != "period":
        need(results, value)
    results = by_frequency(results)
    results = results.isel(direction=[direction_index(results, direction)])
    panels = results.sizes["mode"] if value == "modal_norm" else 1
    columns = min(panels, MAX_COLUMNS)
    rows = -(-panels // columns)
    size = (7.2, 5.2) if panels == 1 else (3.6 * columns, 3.6 * rows + 0.6)
    figure, axes = new_grid(rows, columns, size, sharex=True, sharey=True)
    {
        "period": _classes,
        "contact": _contact_sets,
        "drift": _drift,
        "lyapunov": _exponent,
        "modal_norm": _modal_norms,
    }[value](figure, axes, results)
    if value != "period":
        foot(figure, [grazing_key()], results, classes_of(results))
    for axis in axes.flat[:panels]:
        draw_grazing(axis, results, job_of(results).structure)
        axis.label_outer()
    for axis in axes.flat[panels:]:
        axis.set_visible(False)
    swept = str(results["direction"].values[0])
    figure.suptitle(f"{caption(results)},  sweep {swept}", fontsize=10)
    save(figure, path)


def _classes(figure, axes, results) -> None:
    classes = classes_of(results)[0]
    index = shade_index(classes, results["orbit_period"].values[0])
    _discrete(axes[0, 0], results, index, [colour for _, colour in SHADES])
    entries = shade_shares(index, classes)
    lost = float((classes == MotionClass.FAILED).mean())
    missing = float((classes == MotionClass.NOT_COMPUTED).mean())
    _legend(figure, entries, lost + missing, grazing=True)


def _contact_sets(figure, axes, results) -> None:
    contact = results["contact"].values[0]
    done = results["outcome"].values[0] == Outcome.COMPLETE
    sets, counts = np.unique(contact[done], return_counts=True)
    order = [int(c) for c in sets[np.argsort(-counts, kind="stable")] if c]
    named = sorted(order[:MOST_SETS], key=lambda c: (c.bit_count(), c))
    index = np.full(contact.shape, len(named) + 1)
    index[contact == 0] = 0
    for place, chosen in enumerate(named, 1):
        index[contact == chosen] = place
    index[~done] = -1
    n = results.sizes["state"] // 2
    names = ["no contact", *(contact_name(c, n) for c in named), "other sets"]
    colours = ["#ffffff", *_by_lightness(len(named)), UNDECIDED]
    _discrete(axes[0, 0], results, index, colours)
    entries = [
        (name, colour, float((index == place).mean()))
        for place, (name, colour) in enumerate(zip(names, colours, strict=True))
        if (index == place).any()
    ]
    _legend(figure, entries, float((~done).mean()))


def _by_lightness(count: int) -> list[str]:
    """Give colours from light to dark: the lightness tells them apart in grey."""
    if count <= len(SHADES) - 2:
        places = np.linspace(1, len(SHADES) - 1, count).round().astype(int)
        return [SHADES[place][1] for place in places]
    return list(PALETTE[:count])


def _drift(figure, axes, results) -> None:
    drift = np.ma.masked_invalid(results["drift"].values[0])
    top = float(np.percentile(drift.compressed(), 99)) if drift.count() else 1.0
    mesh = draw_mesh(axes[0, 0], results, drift, cmap="cividis", vmin=0, vmax=top)
    figure.colorbar(mesh, ax=axes, extend="max", label=r"normalised drift $\delta$  [$A/\Omega^2$]")


def _exponent(figure, axes, results) -> None:
    from matplotlib.colors import TwoSlopeNorm

    exponent = np.ma.masked_invalid(results["lyapunov"].values[0])
    inside = exponent.compressed()
    low, high = np.percentile(inside, [1, 99.8]) if inside.size else (-1, 1)
    norm = TwoSlopeNorm(0.0, min(float(low), -1e-6), max(float(high), 1e-6))
    mesh = draw_mesh(axes[0, 0], results, exponent, cmap="cividis", norm=norm)
    figure.colorbar(
        mesh, ax=axes, extend="both", label=r"largest Lyapunov exponent $\lambda$  [$\omega_0$]"
    )


def _modal_norms(figure, axes, results) -> None:
    norms = np.ma.masked_invalid(results["modal_norm"].values[0])
    for mode in range(results.sizes["mode"]):
        axis = axes.flat[mode]
        mesh = draw_mesh(axis, results, norms[..., mode], cmap="cividis", vmin=0, vmax=1)
        axis.set_title(f"mode {mode + 1}", fontsize=9)
    figure.colorbar(mesh, ax=axes, label=r"mean modal norm $\eta_j$ free of contact", aspect=30)


def _discrete(axis, results, index: np.ndarray, colours: list[str]) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    draw_mesh(
        axis,
        results,
        np.ma.masked_less(index, 0),
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours)),
    )


def _legend(
    figure, entries: list[tuple[str, str, float]], blank: float, grazing: bool = False
) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(facecolor=colour, edgecolor="0.3", linewidth=0.5, label=f"{name}  {percent(share)}")
        for name, colour, share in entries
    ]
    if blank:
        handles.append(
            Patch(
                facecolor="white",
                edgecolor="0.55",
                hatch="xxxx",
                linewidth=0.5,
                label=f"{BLANK}  {percent(blank)}",
            )
        )
    if grazing:
        handles.append(grazing_key())
    figure.legend(
        handles=handles,
        loc="outside right center",
        fontsize=8,
        frameon=False,
        title="share of runs",
        title_fontsize=8,
        alignment="left",
    )
