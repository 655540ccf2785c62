"""Measured error against requested tolerance, one panel a solver."""

from pathlib import Path

from hpcsweep.figures.palette import series_colour
from hpcsweep.figures.view import save

MIN_ERROR = 1e-16
"""Errors below this are drawn here: the reference knows no better."""
MARKERS = "osv^D<>pX*"


def draw(rows: list, path: Path) -> None:
    """Draw the rows of `tolerance.measure` and write the figure to `path`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    solvers = list(dict.fromkeys(row.solver for row in rows))
    regimes = list(dict.fromkeys(row.regime for row in rows))
    figure, axes = pyplot.subplots(
        1,
        len(solvers),
        figsize=(3.8 * len(solvers), 4.4),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    tolerances = sorted({row.rtol for row in rows})
    for solver, axis in zip(solvers, axes[0], strict=True):
        for place, regime in enumerate(regimes):
            own = [row for row in rows if (row.solver, row.regime) == (solver, regime)]
            axis.loglog(
                [row.rtol for row in own],
                [max(row.error, MIN_ERROR) for row in own],
                color=series_colour(place),
                marker=MARKERS[place % len(MARKERS)],
                markersize=4.5,
                linewidth=1,
                label=regime,
            )
        axis.loglog(
            tolerances,
            tolerances,
            color="0.3",
            linewidth=1.2,
            linestyle="--",
            label="error = tolerance",
        )
        axis.set_title(solver, fontsize=10)
        axis.set_xlabel("relative tolerance requested", fontsize=9)
        axis.grid(True, color="0.9", linewidth=0.6)
        axis.set_axisbelow(True)
    axes[0, 0].invert_xaxis()
    figure.supylabel("error after one period  [gaps, gaps $\\cdot\\,\\omega_0$]", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    save(figure, path)
