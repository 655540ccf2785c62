"""Orbit diagram: stroboscopic displacement of each floor against the forcing amplitude."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hpcsweep.figures.diagrams.figure import OMEGA, Option, load_frame
from hpcsweep.figures.diagrams.regions import coexistence, contact_regions
from hpcsweep.figures.palette import DIRECTIONS, MOTIONS, contact_colour, motion_index
from hpcsweep.figures.style import (
    AMPLITUDE,
    MARKERS,
    PlotError,
    caption,
    classes_of,
    contact_name,
    foot,
    nearest_frame,
    need,
    new_figure,
    roman,
    save,
    set_name,
    words_of,
)
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.amplitude_sweep import DOWN

NAME = "orbit"
HELP = """\
stroboscopic displacement of each floor against the forcing amplitude, one frame, sweeps
up and down, contact regions along the top"""
OPTIONS = (
    OMEGA,
    Option(
        "--color",
        "what the colours tell (default: direction)",
        "color",
        {"choices": ("direction", "contact", "period")},
    ),
)
load = load_frame
MOST_SETS = 10
"""Contact sets that the legend names: the commonest."""
MOST_COLUMNS = 6
"""Columns of the legend."""
FINE, FINE_KEY = 0.1, 3
"""Area of the points of a motion that does not repeat, in areas of an orbit's, and their size in
the legend."""
LEAST_WIDTH, WIDE_LABEL, NARROW_LABEL = 0.035, 0.05, 0.02
"""Parts of the panel's width: least region whose label names its sets; room the labels take."""


@dataclass(frozen=True)
class Group:
    """Points of one colour.

    Attributes
    ----------
    colour : str
    label : str
        In the legend; empty for what it leaves out.
    runs : ndarray of bool, shape (n_directions, n_amplitudes)
        Whose points they are.
    """

    colour: str
    label: str
    runs: np.ndarray


def draw(results, path: Path, omega: float | None = None, color: str = "direction") -> None:
    """Draw one frame of a campaign and write it to `path`.

    Parameters
    ----------
    results : xarray.Dataset
        Of `hpcsweep.open_results`.
    path : Path
        Its ending chooses the format.
    omega : float, optional
        The frame nearest to this frequency; default the first.
    color : {"direction", "contact", "period"}
        What the colours tell; period: the period of orbits, the class of other motions.

    Raises
    ------
    PlotError
        If the file does not hold what is to be drawn.
    """
    need(results, "poincare", *(("contact",) if color == "contact" else ()))
    results = results.isel(frame=[nearest_frame(results["omega"].values, omega)])
    frame = results.isel(frame=0)
    n = results.sizes["state"] // 2
    done = frame["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise PlotError("no run of this frame is complete yet")
    classes = classes_of(results)
    figure, axes = new_figure(n, 1.2 + 1.75 * n)
    groups = _groups(color, results, classes[:, 0], done, n)
    for floor, axis in zip(range(n)[::-1], axes, strict=True):
        for group in groups:
            _scatter(axis, frame, group, floor)
        axis.set_ylabel(rf"$u_{{{floor + 1}}}(jT)$  [gaps]")
        axis.margins(y=0.08)
    axes[-1].set_xlabel(AMPLITUDE)
    span = frame["amplitude"].values
    axes[-1].set_xlim(span[0], span[-1] if span.size > 1 else span[0] + 1e-9)
    if "contact" in frame:
        _mark_regions(axes, frame, done, n, coexistence(frame, classes[:, 0]))
    _legend(figure, groups, color, results, classes)
    figure.suptitle(caption(results, float(frame["omega"])), fontsize=10)
    save(figure, path)


def _groups(color: str, results, classes: np.ndarray, done: np.ndarray, n: int) -> list[Group]:
    """Divide the complete runs of one frame by colour, in the order of the legend."""
    frame = results.isel(frame=0)
    if color == "direction":
        own = np.eye(len(done), dtype=bool)[:, :, None]
        return [
            Group(DIRECTIONS[str(name)], words_of(results, str(name)), done & own[d])
            for d, name in enumerate(frame["direction"].values)
        ]
    if color == "period":
        index = motion_index(classes, frame["orbit_period"].values)
        return [
            Group(colour, name, done & (index == place))
            for place, (name, colour) in enumerate(MOTIONS)
            if (done & (index == place)).any()
        ]
    contact = frame["contact"].values
    sets, counts = np.unique(contact[done], return_counts=True)
    named = set(np.argsort(-counts, kind="stable")[:MOST_SETS])
    order = sorted(range(sets.size), key=lambda k: (int(sets[k]).bit_count(), int(sets[k])))
    return [
        Group(
            contact_colour(int(sets[k]), n),
            set_name(int(sets[k]), n) if k in named else "",
            done & (contact == sets[k]),
        )
        for k in order
    ]


def _scatter(axis, frame, group: Group, floor: int) -> None:
    """Draw a group's points.

    Those of orbits are large, filled on the way up, hollow on the way down; those of motions that
    do not repeat are fine, so that it shows where they gather.
    """
    amplitude, counts = frame["amplitude"].values, frame["n_points"].values
    size = float(np.clip(14000 / max(amplitude.size, 1), 0.4, 7.0))
    repeats = frame["orbit_period"].values > 0
    displacement = frame["poincare"].values[..., floor]
    point = np.arange(displacement.shape[-1])
    for d, direction in enumerate(frame["direction"].values):
        filled = str(direction) != DOWN
        large = {
            "s": size if filled else 1.6 * size,
            "marker": MARKERS[str(direction)],
            "facecolors": group.colour if filled else "none",
            "edgecolors": "none" if filled else group.colour,
            "linewidths": 0 if filled else 0.35,
        }
        fine = {"s": FINE * size, "color": group.colour, "linewidths": 0}
        for chosen, style in ((~repeats[d], fine), (repeats[d], large)):
            runs = np.flatnonzero(group.runs[d] & chosen)
            if runs.size:
                axis.scatter(
                    np.repeat(amplitude[runs], counts[d, runs]),
                    displacement[d, runs][point < counts[d, runs, None]],
                    rasterized=True,
                    zorder=2 if filled else 3,
                    **style,
                )


def _mark_regions(axes, frame, done, n, coexisting) -> None:
    """Mark the contact regions along the top, as in Figure 3 of the paper."""
    amplitude = frame["amplitude"].values
    least = max(3, amplitude.size // 100)
    regions = contact_regions(frame["contact"].values, done, least, coexisting)
    edges = np.concatenate(
        ([amplitude[0]], 0.5 * (amplitude[1:] + amplitude[:-1]), [amplitude[-1]])
    )
    total = edges[-1] - edges[0]
    top = axes[0]
    taken: list[float] = []
    for number, region in enumerate(regions, 1):
        left, right = edges[region.first], edges[region.last + 1]
        if region.first > 0:
            for axis in axes:
                axis.axvline(left, color="0.45", linewidth=0.6, linestyle=(0, (4, 3)), zorder=1)
        sets = "\n".join(contact_name(c, n).replace("none", "–") for c in region.contacts)
        wide = total > 0 and (right - left) / total > LEAST_WIDTH
        label = f"({roman(number)})\n{sets}" if wide else f"({roman(number)})"
        middle = 0.5 * (left + right)
        half = 0.5 * (WIDE_LABEL if wide else NARROW_LABEL) * total
        level = 0
        while level < len(taken) and middle - half < taken[level]:
            level += 1
        taken[level:] = [middle + half]
        top.annotate(
            label,
            (middle, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3 + 30 * level),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7,
            linespacing=1.05,
            rotation=0 if wide else 90,
        )


def _legend(figure, groups: list[Group], color: str, results, classes) -> None:
    from matplotlib.lines import Line2D

    def key(label: str, marker: str, colour: str, hollow: bool = False, size: float = 5):
        return Line2D(
            [],
            [],
            linestyle="none",
            marker=marker,
            label=label,
            markersize=size,
            markerfacecolor="none" if hollow else colour,
            markeredgecolor=colour,
        )

    directions = [str(name) for name in results["direction"].values]
    if color == "direction":
        handles = [
            key(group.label, MARKERS[name], group.colour, name == DOWN)
            for name, group in zip(directions, groups, strict=True)
        ]
    else:
        handles = [key(group.label, "s", group.colour) for group in groups if group.label]
        rest = sum(not group.label for group in groups)
        if rest:
            handles.append(Line2D([], [], linestyle="none", label=f"{rest} rarer sets"))
        handles += [key(words_of(results, d), MARKERS[d], "0.3", d == DOWN) for d in directions]
    if (results["orbit_period"].values[results["outcome"].values == Outcome.COMPLETE] == 0).any():
        handles.append(key("no orbit found", ".", "0.3", size=FINE_KEY))
    foot(figure, handles, results, classes, min(len(handles), MOST_COLUMNS))
