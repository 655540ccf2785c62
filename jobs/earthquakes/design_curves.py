r"""Design curves: responses to records against a key that the job varies.

    python jobs/earthquakes/design_curves.py friction-damper.h5 --over slider_0_strength \
        --by scale --show storey_drift floor_acceleration=3 --least -o friction-damper.png

Draws a panel for each response, a variable of the file, of one storey, floor or slider or else the
largest of all: the median of the records over the key ``--over``, the band from their 16 to their
84 % fractile, and a curve for each value of ``--by``, another varied key or ``scale``; of further
keys that vary the values are those with which the 84 % fractile is least. With
``--least`` a mark is at the least median, which is printed.
"""

import argparse
from pathlib import Path

import numpy as np

import hpcsweep

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#000000")


def unit_of(array) -> str:
    """Return the unit of an array as it follows a label; nothing for numbers."""
    unit = str(array.attrs.get("units", "1"))
    return "" if unit == "1" else f"  [{unit.replace('^2', '²')}]"


def shown(results, name: str):
    """Return a response, its records and one dimension more at most, and its label."""
    variable, _, place = name.partition("=")
    if variable not in results:
        raise SystemExit(f"--show {name}: must be a variable of the file")
    array = results[variable]
    dim = str(array.dims[-1])
    if place and place not in array[dim].values:
        raise SystemExit(f"--show {name}: must be one of {', '.join(array[dim].values)}")
    words = str(array.attrs["long_name"]).removesuffix(f" of each {dim}")
    where = f"{dim} {place}" if place.isdigit() else place
    label = f"{words}, {where or f'largest of all {dim}s'}{unit_of(array)}"
    return (array.sel({dim: place}) if place else array.max(dim)), label


def curves(array, over: str, by: str | None) -> list[tuple[float | None, np.ndarray, list[str]]]:
    """Return 16 %, median, 84 % of the records over a key, shape (3, k), for each value of another.

    Of further keys that vary, those of the design whose 84 % fractile is the least, which is named.
    """
    values = [None] if by is None else array[by].values.tolist()
    found = []
    for value in values:
        own = (array if value is None else array.sel({by: value})).squeeze()
        own = own.transpose("record", over, ...)
        low, high = hpcsweep.fractiles(own.values, (0.16, 0.84))
        each = np.array([low, np.median(own.values, axis=0), high])
        each = each.reshape(3, own.shape[1], -1)
        best = each[2].argmin(axis=1)
        keys = [own[dim] for dim in own.dims[2:]]
        places = np.transpose(np.unravel_index(best, own.shape[2:] or (1,)))
        named = [
            ", ".join(f"{key.name} = {key.values[k]:.4g}" for key, k in zip(keys, at, strict=False))
            for at in places
        ]
        found.append((value, np.take_along_axis(each, best[None, :, None], axis=2)[..., 0], named))
    return found


def draw(results, options) -> list[str]:
    """Draw a panel for each response; return a line for each of their curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    over, by, names = options.over, options.by, options.show
    size = 4.1 * len(names), 3.9
    figure, axes = pyplot.subplots(1, len(names), figsize=size, layout="constrained", squeeze=False)
    x, lines = results[over].values, []
    for axis, name in zip(axes[0], names, strict=True):
        array, words = shown(results, name)
        found = curves(array, over, by)[: len(COLOURS)]
        for colour, (value, fractiles, named) in zip(COLOURS, found, strict=False):
            low, median, high = fractiles
            unit = "" if by is None else unit_of(results[by]).strip(" []")
            key = results[by].attrs["long_name"] if by == "scale" else str(by).split("_")[-1]
            told = "" if by is None else f"{key} = {value:g} {unit}".strip()
            least = int(np.argmin(median))
            axis.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
            axis.plot(x, median, color=colour, label=told or "median")
            if options.least:
                axis.plot(x[least], median[least], "o", color=colour, markersize=5)
            lines.append(f"{words}, {told}: least median {median[least]:.4g} at {x[least]:.4g}")
            for at, three, design in zip(x, fractiles.T, named, strict=True):
                shares = ", ".join(f"{one:.4g}" for one in three)
                lines += [f"  at {at:.4g}: {shares} with {design}"] if design else []
        axis.set(xlabel=options.label or over + unit_of(results[over]), ylabel=words)
        axis.set(xlim=(x[0], x[-1]), ylim=(0, None))
        axis.ticklabel_format(style="sci", axis="x", scilimits=(-3, 4), useMathText=True)
    title = f"{results.attrs['name']}: median of {results.sizes['record']} records, 16 to 84 %"
    title += ", least median marked" if options.least else ""
    looks = {"frameon": False, "fontsize": 9, "title": title, "title_fontsize": 9}
    handles = axes[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=len(COLOURS), **looks)
    figure.savefig(options.output, dpi=120)
    pyplot.close(figure)
    return lines


def main() -> None:
    """Draw the curves of a file, and print their least values."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--over", required=True, metavar="KEY", help="as a dimension of the file")
    parser.add_argument("--by", metavar="KEY", help="another, or scale")
    parser.add_argument("--show", nargs="+", required=True, metavar="NAME[=PLACE]")
    parser.add_argument("--least", action="store_true", help="mark the least medians")
    parser.add_argument("--label", default="", help="of the horizontal axis")
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    results = hpcsweep.open_results(options.file)
    for key in filter(None, (options.over, options.by)):
        if key not in results.dims:
            raise SystemExit(f"{key}: must be one of {', '.join(map(str, results.dims))}")
    print("\n".join(draw(results, options)))
    print(options.output)


if __name__ == "__main__":
    main()
