"""Pounding spectra: what pounding does to two one-storey buildings, and how far apart they must be.

    python jobs/earthquakes/pounding_spectra.py pounding-spectra.h5 -o pounding-spectra.png

Reads the results of pounding-spectra.toml. For each pair of periods it draws the median over the
records of the drift of building A with contacts over that without, and the share of records for
which the separation that a code rule asks for is not enough, the rules of `hpcsweep.separation`
with the peaks of each building alone, by record.

What is needed is the largest approach of the two without contacts (`gap_needed`).
"""

import argparse
from pathlib import Path

import numpy as np
import xarray

import hpcsweep

DAMPING = 0.05
PERIODS = ("building_0_period", "building_1_period")
RULES = ("ABS", "SRSS", "DDC")


def separations(results) -> dict:
    """Return the separation over that needed, by rule: arrays over the periods and records."""
    one = results.sel(scale=1.0).isel(building_1_mass=0, gap=0)
    u_a = one.displacement_alone.isel(floor=0)
    u_b = one.displacement_alone.isel(floor=1)
    needed = one.gap_needed.isel(stop=0)
    given = xarray.broadcast(u_a, u_b, one[PERIODS[0]], one[PERIODS[1]])
    rules = hpcsweep.separation(*(array.values for array in given), DAMPING)
    return {name: given[0].copy(data=gap) / needed for name, gap in zip(RULES, rules, strict=True)}


def told(results) -> list[str]:
    """Return what the study says, a line each."""
    lines = []
    for name, part in separations(results).items():
        fails = part < 1.0 - 1e-9
        lines.append(
            f"{name}: not enough in {100 * float(fails.mean()):.1f} % of all cases, at worst "
            f"{100 * float(fails.mean('record').max()):.0f} % of the records of one pair of "
            f"periods; {float(part.median()):.2f} of what is needed in the median, "
            f"{float(part.min()):.2f} to {float(part.max()):.2f}"
        )
    touched = (results.impacts > 0).any("stop")
    for variable, name in (("storey_drift", "drift"), ("floor_acceleration", "floor acceleration")):
        ratio = (results[variable] / results[f"{variable}_alone"]).where(touched)
        dim = ratio.dims[-1]
        for i, building in enumerate("AB"):
            own = ratio.isel({dim: i}).values
            low, median, high = np.nanquantile(own, (0.16, 0.5, 0.84))
            lines.append(
                f"{name} of {building} where they touch, over that alone: median {median:.2f}, "
                f"16 to 84 % {low:.2f} to {high:.2f}; larger in "
                f"{100 * float((own > 1).sum() / np.isfinite(own).sum()):.0f} % of the cases"
            )
    ratio = (results.storey_drift / results.storey_drift_alone).isel(storey=0, scale=1)
    q = (results[PERIODS[0]] / results[PERIODS[1]]).values
    for mass in results["building_1_mass"].values:
        whole = ratio.sel(building_1_mass=mass, gap=0.02).median("record").values
        lines.append(
            f"gap 2 cm, mass ratio B/A {mass / 1e6:g}: median drift of A over that alone "
            f"{np.median(whole[q < 0.8]):.2f} where A is the stiffer (T_A < 0.8 T_B), "
            f"{np.median(whole[q > 1.25]):.2f} where it is the softer"
        )
    return lines


def draw(results, path: Path) -> None:
    """Draw four maps over both periods."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import colors, pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(8.2, 7.0), sharex=True, sharey=True)
    x, y = results[PERIODS[1]].values, results[PERIODS[0]].values
    ratio = (results.storey_drift / results.storey_drift_alone).isel(storey=0)
    ratio = ratio.sel(scale=1.0, gap=0.02).median("record")
    scale = colors.LogNorm(0.25, 4.0)
    for axis, mass in zip(axes[0], (1e6, 4e6), strict=True):
        drawn = axis.pcolormesh(
            x, y, ratio.sel(building_1_mass=mass).values, norm=scale, cmap="PuOr_r"
        )
        axis.set_title(
            f"drift of A over that alone\ngap 2 cm, mass B/A = {mass / 1e6:g}", fontsize=8
        )
    bar = figure.colorbar(drawn, ax=axes[0], ticks=[0.25, 0.5, 1, 2, 4])
    bar.ax.minorticks_off()
    bar.ax.set_yticklabels(["1/4", "1/2", "1", "2", "4"])
    bar.set_label("median of the records", fontsize=8)
    found = separations(results)
    for axis, rule in zip(axes[1], RULES[1:], strict=True):
        share = 100 * (found[rule] < 1.0 - 1e-9).mean("record")
        drawn = axis.pcolormesh(x, y, share.values, cmap="cividis", vmin=0, vmax=100)
        axis.set_title(f"separation by {rule} is not enough", fontsize=8)
        axis.set_xlabel("period of B alone  [s]")
    figure.colorbar(drawn, ax=axes[1]).set_label("share of the records  [%]", fontsize=8)
    for axis in axes.flat:
        axis.plot([0.25, 2.0], [0.25, 2.0], color="0.4", linewidth=0.7, linestyle=":")
    for axis in axes[:, 0]:
        axis.set_ylabel("period of A alone  [s]")
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main() -> None:
    """Print what the study says, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("pounding-spectra.png"))
    options = parser.parse_args()
    results = hpcsweep.open_results(options.file)
    print("\n".join(told(results)))
    draw(results, options.output)
    print(options.output)


if __name__ == "__main__":
    main()
