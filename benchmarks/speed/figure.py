"""Work-precision diagram: run time against error, one panel a regime."""

from pathlib import Path

from hpcsweep.figures.palette import series_colour
from hpcsweep.figures.style import new_grid
from hpcsweep.figures.view import save

MIN_ERROR = 1e-16
"""Errors below this are drawn here: the reference knows no better."""
MARKERS = "osv^D<>pX*"
COLUMNS = 4
ERRORS = tuple(10.0**k for k in range(0, -17, -4))
"""Ticks of the error axis."""
SYMBOLS = {"beta": r"$\beta$", "1e5": "$10^5$"}


def draw(rows: list, path: Path) -> None:
    """Draw the rows of `speed.work_precision` and write the figure to `path`.

    A line joins the tolerances of a method. Better is further right and further down.
    """
    regimes = list(dict.fromkeys(row.regime for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    columns = min(COLUMNS, len(regimes))
    lines = -(-len(regimes) // columns)
    figure, axes = new_grid(
        lines, columns, (2.4 * columns + 0.6, 2.5 * lines + 1.1), sharex=True, sharey=True
    )
    for regime, axis in zip(regimes, axes.flat, strict=False):
        for place, method in enumerate(methods):
            own = [row for row in rows if (row.regime, row.method) == (regime, method)]
            axis.loglog(
                [max(row.error, MIN_ERROR) for row in own],
                [row.microseconds for row in own],
                color=series_colour(place),
                marker=MARKERS[place % len(MARKERS)],
                markersize=5,
                markeredgecolor="white",
                markeredgewidth=0.4,
                linewidth=1,
                label=method,
            )
        axis.set_title(_in_symbols(regime), fontsize=9)
        axis.grid(True, color="0.9", linewidth=0.6)
        axis.set_axisbelow(True)
        axis.set_xticks(ERRORS)
        axis.minorticks_off()
        axis.tick_params(labelsize=8)
    for place in range(len(regimes), axes.size):
        axes.flat[place].set_visible(False)
        axes.flat[place - columns].tick_params(labelbottom=True)
    axes[0, 0].invert_xaxis()
    lowest = list(axes.flat)[max(len(regimes) - columns, 0) : len(regimes)]
    for axis in lowest:
        axis.set_xlabel(r"error  [gaps, gaps $\cdot\,\omega_0$]", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("CPU time  [µs a forcing period]", fontsize=8)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    save(figure, path)


def _in_symbols(regime: str) -> str:
    for word, symbol in SYMBOLS.items():
        regime = regime.replace(word, symbol)
    return regime
