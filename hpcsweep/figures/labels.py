"""Words of figures: labels in the units of the structure, legends, and how they fit the width."""

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.unit_names import is_in_gaps, is_in_own_units, unit_of
from hpcsweep.studies.quantities import MEASURES, ROWS, of_motions
from hpcsweep.studies.variables import percent_of_height

SHOWN = {name: of_motions(name) for name in MEASURES}
SHOWN |= {each.name: each for each in ROWS if len(each.dims) == 1}
"""Measures of motions that have a value for each storey, floor, contact or row."""
WORD = r"$\omega_0$"
PARAMETERS = {
    "amplitude": ("forcing amplitude $A$", "acceleration"),
    "omega": (r"forcing frequency $\Omega$", "frequency"),
    "gap": ("gap $g$", "length"),
    "damping_ratio": (r"damping ratio $\zeta$", "1"),
    "stiffness_ratio": (r"stiffness ratio $\beta$", "1"),
    "sharpness": (r"sharpness $\rho$", "1"),
}
"""Label, and quantity."""
SYMBOLS = {"omega": r"\Omega", "amplitude": "A"}
MAX_MODES = 5
"""Modes that are shown: the lowest."""
SIZES = {
    "m": (("mm", 1e-3), ("m", 1.0)),
    "mm": (("mm", 1.0), ("m", 1e3)),
    "N": (("N", 1.0), ("kN", 1e3), ("MN", 1e6)),
    "kN": (("kN", 1.0), ("MN", 1e3)),
    "N m": (("J", 1.0), ("kJ", 1e3), ("MJ", 1e6)),
    "kN m": (("kJ", 1.0), ("MJ", 1e3)),
    "N mm": (("mJ", 1.0), ("J", 1e3), ("kJ", 1e6)),
}
"""Units in which numbers are told that are small or large in a unit, and how much of it each is."""
RUN_LABELS = {
    "drift": r"normalised drift $\delta$  [$A/\Omega^2$]",
    "modal_norm": r"mean modal norm $\eta_j$ free of contact",
    "lyapunov": r"largest Lyapunov exponent $\lambda$",
    "ductility": "largest ductility of the sliders",
    "share": "share of the starts",
}
"""What the other numbers of a run are."""

WIDEST = 0.98
"""Share of a figure's width that its head or its legend may take."""
MAGNIFIED = 8
SMALL, SMALLER = 8, 7.5
"""Sizes of the entries of a legend, and of the words above them (points)."""
BETWEEN = r"(?<=,)  |(?<=;) (?![^(]*\))"
"""Two blanks after a comma, or one after a semicolon that is not in brackets."""
LEGEND: dict[str, Any] = {"fontsize": SMALL, "frameon": False}
"""Style of legends."""


def displacement(structure, symbol: str, at: str = "") -> str:
    """Label the displacement with the symbol of a `coordinates.Coordinate`."""
    return _at(symbol.replace("@", "u"), at) + unit(structure, "length")


def velocity(structure, symbol: str, at: str = "") -> str:
    """Label the velocity with the symbol of a `coordinates.Coordinate`."""
    return _at(symbol.replace("@", "v"), at) + unit(structure, "velocity")


def _at(symbol: str, at: str) -> str:
    return f"$({symbol}){at}$" if at and " - " in symbol else f"${symbol}{at}$"


def parameter(structure, name: str, quantity: str = "1") -> str:
    """Label the axis of a parameter, with the unit of a quantity where it is none of the forcing.

    Parameters
    ----------
    structure : Structure
    name : str
        Such as "omega", or that of a key of the structure.
    quantity : str
    """
    words, quantity = PARAMETERS.get(name, (name.replace("_", " "), quantity))
    return words + unit(structure, quantity)


def along(study) -> str:
    """Label the axis of the parameter along which the sweeps of a study lead."""
    *_, (name, (_, units, _)) = study.grid.items()
    return parameter(study.structure, name, units)


def typeset(text: str) -> str:
    r"""Typeset a name or formula of a job: ``0.7 * omega**2`` is 0.7\,\Omega^{2}.

    Without spaces, at which a title would be broken; mathtext sets its own.
    """
    words = re.sub(r"\*\* *(-?[\w.]+|\(.*?\))", r"^{\1}", text)
    words = re.sub(r"sqrt\(([^()]*)\)", r"\\sqrt{\1}", words).replace("*", r"\,")
    words = re.sub(r"\b(?<!\\)([a-z]\w+)", lambda name: _symbol(name[0]), words)
    return f"${words.replace(' ', '')}$"


def _symbol(name: str) -> str:
    return SYMBOLS.get(name, rf"\mathrm{{{name}}}".replace("_", "~"))


def common(values: np.ndarray) -> float | None:
    """Return the value that all have, None where they differ."""
    return float(values.flat[0]) if np.all(values == values.flat[0]) else None


def path_words(study, runs=None) -> str:
    """Format what sweeps along another parameter than the amplitude do with that one, of `runs`."""
    amplitude = None if runs is None else common(runs["amplitude"].values)
    over = study.run_dims[-2:] == ("omega", "amplitude")
    words = [] if amplitude is None or over else [f"$A$ = {amplitude:.6g}"]
    return ",  ".join([*words, *map(typeset, study.ties)])


def unit(structure, quantity: str) -> str:
    """Format the unit that follows a label; empty where it has no name."""
    is_length = quantity in ("length", "velocity", "acceleration")
    is_own = is_in_own_units(structure)
    has_name = any(structure.unit_names) or (is_in_gaps(structure) if is_length else not is_own)
    if not has_name or quantity == "1":
        return ""
    name = unit_of(structure, quantity).replace("omega_0^2", r"$\omega_0^2$").replace("^2", "²")
    return f"  [{name if '$' in name else name.replace('omega_0', WORD)}]"


def sized(structure, quantity: str, *numbers) -> tuple[str, float]:
    """Return the unit that suits numbers, formatted as `unit` does, and by what to divide them."""
    name = unit_of(structure, quantity)
    if name not in SIZES:
        return unit(structure, quantity), 1.0
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in numbers)
    name, size = _suiting(name, largest)
    return f"  [{name}]", size


def _suiting(unit: str, largest: float) -> tuple[str, float]:
    choices = SIZES[unit]
    return next((choice for choice in choices[::-1] if largest >= choice[1]), choices[0])


def suit(figure) -> None:
    """Write the numbers of all axes in units that suit them, where labels name those they are in.

    A reader with a log scale finds powers of ten in any unit.
    """
    for axis in (a for panel in figure.axes for a in (panel.xaxis, panel.yaxis)):
        words, _, name = axis.get_label_text().rpartition("  [")
        if name.removesuffix("]") in SIZES and axis.get_scale() == "linear":
            name, size = _suiting(name.removesuffix("]"), max(map(abs, axis.get_view_interval())))
            axis.set_major_formatter(lambda value, _, size=size: f"{value / size:g}")
            axis.set_label_text(f"{words}  [{name}]")


def named(structure, quantity: str) -> str:
    """Format the unit that follows a number, as `unit` follows a label."""
    name = unit(structure, quantity).strip(" []")
    return f" {name}" if name else ""


class ShownMeasure(NamedTuple):
    """A measure as figures show it."""

    label: str
    """Without its unit ..."""
    unit: str
    """... which follows it; empty where it has no name."""
    dim: str
    places: tuple[str, ...]
    """Each storey, floor or contact by its name."""
    factor: np.ndarray
    """By which the values of each place are multiplied."""


def held_measures(results) -> list[str]:
    """Return the names of the measures that results hold."""
    return [name for name in SHOWN if name in results]


def measure_of(results, structure, name: str) -> ShownMeasure:
    """Return how a measure is shown; drifts as ratios to the storeys' heights where known.

    Parameters
    ----------
    results : xarray.Dataset
    structure : Structure
    name : str
        One of `held_measures`.
    """
    variable = SHOWN[name]
    (dim,) = variable.dims
    word = {"stop": "contact", "coordinate": "row"}.get(dim, dim)
    places = tuple(f"{word} {place}" for place in results[dim].values.tolist())
    percent = percent_of_height(results)
    if name == "storey_drift" and percent is not None:
        return ShownMeasure(f"{variable.label} ratio", "  [%]", dim, places, percent)
    name = unit(structure, variable.units)
    return ShownMeasure(variable.label, name, dim, places, np.ones(len(places)))


def broken(text: str, fits: Callable[[str], bool], between: str = BETWEEN) -> str:
    """Break lines between their parts wherever they do not fit.

    Parameters
    ----------
    text : str
        Lines.
    fits : callable
        Return whether a line fits.
    between : str
        Regular expression of what stands between two parts.

    Returns
    -------
    str
    """
    lines: list[str] = []
    for line in text.split("\n"):
        parts, gaps = re.split(between, line), [match[0] for match in re.finditer(between, line)]
        lines.append(parts[0])
        for gap, part in zip(gaps, parts[1:], strict=True):
            joined = f"{lines[-1]}{gap}{part}"
            if fits(joined):
                lines[-1] = joined
            else:
                lines.append(part)
    return "\n".join(lines)


def fitter(figure, fontsize: float, edges: float = 0.0) -> Callable[[str], bool]:
    """Return whether a line of a size is no wider than a figure without `edges` (pixels)."""
    renderer = figure.canvas.get_renderer()

    def fits(line: str) -> bool:
        # magnified, since letters are rounded to pixels, and the picture has others
        probe = figure.text(0, 0, line, fontsize=MAGNIFIED * fontsize)
        width = probe.get_window_extent(renderer).width / MAGNIFIED
        probe.remove()
        return bool(width <= WIDEST * figure.bbox.width - edges)

    return fits


def key(label: str = "", **looks):
    """Return the key of lines, or of points, that look so."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **looks)


def dot(label: str, colour: str, marker: str = "o", size: float = 5.0, face: str | None = None):
    """Return the key of points; `face`: inside another colour, or none."""
    return key(label, mfc=face or colour, ls="none", marker=marker, ms=size, color=colour)


def area(label: str, colour: str, edge: str = "0.3", hatch: str | None = None):
    """Return the key of an area of a colour."""
    from matplotlib.patches import Patch

    return Patch(facecolor=colour, edgecolor=edge, hatch=hatch, linewidth=0.5, label=label)


def blank(label: str):
    """Return the key of a hatched area, where nothing is drawn."""
    return area(label, "white", "0.55", "xxxx")


def legend_below(figure, handles: Sequence, title: str, most_columns: int | None = None):
    """Put a legend with a title below the panels, no wider than the figure.

    Parameters
    ----------
    figure
    handles : sequence
        Entries, in the order of the legend.
    title : str
        Lines; one that is too long is broken between words.
    most_columns : int, optional
        Default: as many as there are entries.

    Returns
    -------
    matplotlib.legend.Legend
    """
    edges = 2 * SMALL * figure.dpi / 72  # of the legend around its title
    fits = fitter(figure, SMALLER, edges)
    title = broken(broken(title, fits, "(?<=;) "), fits, " ")
    looks = {"loc": "outside lower center", "title_fontsize": SMALLER, **LEGEND}
    for columns in range(max(min(len(handles), most_columns or len(handles)), 1), 0, -1):
        legend = figure.legend(handles=handles, ncols=columns, title=title, **looks)
        if columns == 1 or legend.get_window_extent().width <= WIDEST * figure.bbox.width:
            return legend
        legend.remove()
    raise AssertionError("a legend of one column is always drawn")
