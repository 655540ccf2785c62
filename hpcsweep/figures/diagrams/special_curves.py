"""Special points of branches over amplitude and frequency, and their curves, laid over a map."""

import contextlib
from pathlib import Path

import numpy as np

from hpcsweep.dynamics.continuation.events import Kind
from hpcsweep.figures import palette
from hpcsweep.figures.fitting import key
from hpcsweep.figures.overlay import Overlay
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import as_kind

MARKS = {
    Kind.FOLD: ("fold", "o", palette.series_colour(1)),
    Kind.DOUBLING: ("period doubling", "s", palette.series_colour(0)),
    Kind.TORUS: ("torus", "D", palette.series_colour(2)),
    Kind.BRANCH_POINT: ("branch point", "^", palette.series_colour(3)),
    Kind.GRAZING: ("grazing", "|", palette.GRAZING),
    Kind.SLIP: ("slip", "v", palette.DARK_INK),
}
"""Word, marker and colour of each kind of special point."""
SPECIALS = ("special_kind", "special_value")
CURVES = ("curve_kind", "curve_of_step", "curve_amplitude", "curve_omega")


def with_specials(results, path: Path, under: RunGrid):
    """Add the special points and curves of a file of branches to the results of a map.

    Raises
    ------
    PlotError
        If the file holds branches along another parameter, or those of another structure.
    """
    with contextlib.closing(Overlay(path, under)) as held:
        study = as_kind(held.study, Branches)
        names = (*SPECIALS, *(CURVES if study.curves else ()))
        lines = held.frames.gather(names)
    of = {name: lines[name].values[0, :, 0] for name in names}
    kind = of["special_kind"]
    line, place = np.nonzero(kind)
    at = {"amplitude": study.amplitude[line], "omega": study.omega[line]}
    at[study.parameter] = of["special_value"][line, place]
    marked = results.assign(
        special_kind=("special", kind[line, place]),
        special_amplitude=("special", at["amplitude"]),
        special_omega=("special", at["omega"]),
    )
    if study.curves:
        line, step = np.nonzero(of["curve_of_step"])
        number = of["curve_of_step"][line, step]
        marked = marked.assign(
            curve_number=("curve_step", line * study.max_curves + number),
            curve_kind=("curve_step", of["curve_kind"][line, number - 1]),
            curve_amplitude=("curve_step", of["curve_amplitude"][line, step]),
            curve_omega=("curve_step", of["curve_omega"][line, step]),
        )
    return marked


def draw_specials(axis, results) -> None:
    """Draw what `with_specials` has added, if anything."""
    if "special_kind" not in results:
        return
    for kind, (_, _, colour) in MARKS.items():
        marked = results["special_kind"].values == kind
        at = results["special_amplitude"].values[marked], results["special_omega"].values[marked]
        axis.plot(*at, **_looks(colour, 2.6))
    if "curve_number" in results:
        for _, curve in results.groupby("curve_number"):
            colour = MARKS[Kind(int(curve["curve_kind"][0]))][-1]
            places = curve["curve_amplitude"].values, curve["curve_omega"].values
            axis.plot(*places, color=colour, lw=1)


def special_keys(results) -> list:
    """Return the legend keys of the special points."""
    there = np.unique(results["special_kind"].values).tolist() if "special_kind" in results else []
    return [
        key(word, **_looks(colour, 5.0))
        for kind, (word, _, colour) in MARKS.items()
        if kind in there
    ]


def _looks(colour: str, size: float) -> dict:
    edge = {"markeredgecolor": "white", "markeredgewidth": 0.3}
    return {"linestyle": "none", "marker": "o", "color": colour, "markersize": size, **edge}
