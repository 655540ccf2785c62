"""Work-precision diagram: run time against error, one panel a regime."""

from pathlib import Path

from hpcsweep.figures.style import PALETTE, save

LEAST_ERROR = 1e-16
"""Errors below this are drawn here: the reference knows no better."""
MARKERS = "osv^D<>pX*"


def draw(rows: list, path: Path) -> None:
    """Draw the rows of `hpcsweep.bench.work_precision` and write the figure to `path`."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    regimes = list(dict.fromkeys(row.regime for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    columns = min(4, len(regimes))
    lines = -(-len(regimes) // columns)
    figure, axes = pyplot.subplots(
        lines,
        columns,
        figsize=(2.6 * columns, 2.6 * lines + 0.6),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for regime, axis in zip(regimes, axes.flat, strict=False):
        for place, method in enumerate(methods):
            own = [row for row in rows if (row.regime, row.method) == (regime, method)]
            axis.loglog(
                [max(row.error, LEAST_ERROR) for row in own],
                [row.microseconds for row in own],
                color=PALETTE[place % len(PALETTE)],
                marker=MARKERS[place % len(MARKERS)],
                markersize=5,
                linewidth=1,
                label=method,
            )
        axis.set_title(regime, fontsize=9)
        axis.grid(True, color="0.9", linewidth=0.6)
    for axis in list(axes.flat)[len(regimes) :]:
        axis.set_visible(False)
    axes[0, 0].invert_xaxis()
    figure.supxlabel("error after the stretch  [gaps, gaps $\\cdot\\,\\omega_0$]", fontsize=9)
    figure.supylabel("run time  [µs per forcing period]", fontsize=9)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    save(figure, path)
