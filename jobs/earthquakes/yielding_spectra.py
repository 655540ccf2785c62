"""Pounding spectra of buildings that yield, beside those of elastic ones.

    python jobs/earthquakes/yielding_spectra.py yielding-pounding-spectra.h5 elastic.h5

Reads the results of yielding-pounding-spectra.toml and those of the same job with a yield force
that is never reached (see there). What pounding does is told by the ductility beside a neighbour
over that of the same building at the largest gap, at which they never touch; what is told of
motions without contacts in the files themselves is elastic.
"""

import argparse
from pathlib import Path

import numpy as np

import hpcsweep

PERIODS = ("building_0_period", "building_1_period")
STIFFER, SOFTER = 0.8, 1.25
"""Ratio T_A / T_B below which A is the stiffer building, above which the softer."""


def compared(results):
    """Return the ductility of both buildings over that alone, at the gaps at which they touch."""
    if (results.impacts.isel(gap=-1) > 0).any():
        raise SystemExit("they touch at the largest gap")
    return results.ductility.isel(gap=slice(-1)) / results.ductility.isel(gap=-1)


def told(results, elastic) -> list[str]:
    """Return what the study says, a line each."""
    ratio, lines = compared(results), []
    q = (results[PERIODS[0]] / results[PERIODS[1]]).values
    for name, found in (("yield", ratio), ("stay elastic", compared(elastic))):
        for scale in found.scale.values:
            whole = found.sel(gap=0.02, scale=scale).isel(slider=0).median("record").values
            lines.append(
                f"buildings that {name}, gap 2 cm, records times {scale:g}: drift of A over that "
                f"alone, median of the records: {np.median(whole[q < STIFFER]):.2f} where A is the "
                f"stiffer (T_A < 0.8 T_B), {np.median(whole[q > SOFTER]):.2f} where the softer"
            )
    near, alone = results.isel(gap=slice(-1)), results.isel(gap=-1)
    touched = (near.impacts > 0).any("stop")
    for scale in results.scale.values:
        own = ratio.sel(scale=scale).where(touched.sel(scale=scale)).values
        own, level = own[np.isfinite(own)], float(alone.ductility.sel(scale=scale).median())
        low, high = np.quantile(own, (0.16, 0.84))
        lines.append(
            f"records times {scale:g}, ductility {level:.1f} alone in the median: they touch in "
            f"{100 * float(touched.sel(scale=scale).mean()):.0f} % of the runs; there ductility "
            f"over that alone is {np.median(own):.2f} in the median, 16 to 84 % {low:.2f} to "
            f"{high:.2f}, larger in {100 * np.mean(own > 1):.0f} %"
        )
    for scale in results.scale.values:
        rest, left = (
            np.abs(one.residual_drift.sel(scale=scale)).where(touched.sel(scale=scale))
            for one in (alone, near)
        )
        lines.append(
            f"records times {scale:g}: where they touch the residual drift is "
            f"{1000 * float(left.mean()):.1f} mm in the mean, {1000 * float(rest.mean()):.1f} alone"
        )
    touches = (near.impacts.isel(stop=0) > 0).sel(gap=0.02)
    for_elastic = (elastic.impacts.isel(stop=0, gap=0) > 0).values
    lines.append(
        f"gap 2 cm: {100 * float(touches.mean()):.1f} % of the runs touch, of elastic buildings "
        f"{100 * for_elastic.mean():.1f} %; "
        f"{100 * float((touches.values & ~for_elastic).mean()):.1f} % only if they yield, "
        f"{100 * float((~touches.values & for_elastic).mean()):.1f} % only if they do not"
    )
    return lines


def draw(results, elastic, path: Path) -> None:
    """Draw maps over both periods: of buildings that yield above, of elastic ones below."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import colors, pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(8.2, 7.0), sharex=True, sharey=True)
    x, y = results[PERIODS[1]].values, results[PERIODS[0]].values
    norm, drawn = colors.LogNorm(0.25, 4.0), None
    for row, (name, found) in zip(axes, (("yielding", results), ("elastic", elastic)), strict=True):
        ratio = compared(found).isel(slider=0).sel(gap=0.02).median("record")
        for axis, scale in zip(row, (0.5, 2.0), strict=True):
            drawn = axis.pcolormesh(x, y, ratio.sel(scale=scale).values, norm=norm, cmap="PuOr_r")
            axis.set_title(f"{name}, records times {scale:g}", fontsize=9)
            axis.plot([0.25, 2.0], [0.25, 2.0], color="0.4", linewidth=0.7, linestyle=":")
    bar = figure.colorbar(drawn, ax=axes, ticks=[0.25, 0.5, 1, 2, 4], extend="both")
    bar.ax.minorticks_off()
    bar.ax.set_yticklabels(["1/4", "1/2", "1", "2", "4"])
    bar.set_label("peak drift of A over that alone, median of the records, gap 2 cm", fontsize=8)
    for axis in axes[1]:
        axis.set_xlabel("period of B alone  [s]")
    for axis in axes[:, 0]:
        axis.set_ylabel("period of A alone  [s]")
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main() -> None:
    """Print what the study says, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("elastic", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("yielding-spectra.png"))
    options = parser.parse_args()
    files = [hpcsweep.open_results(path) for path in (options.file, options.elastic)]
    print("\n".join(told(*files)))
    draw(*files, options.output)
    print(options.output)


if __name__ == "__main__":
    main()
