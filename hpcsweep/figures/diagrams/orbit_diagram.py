"""Orbit diagram: stroboscopic displacement of each floor against the forcing amplitude."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

import numpy as np

from hpcsweep.figures import labels, palette, style
from hpcsweep.figures.diagrams.figure import load_frame
from hpcsweep.figures.diagrams.regions import coexistence, contact_regions
from hpcsweep.figures.options import FLOORS, OMEGA, Option
from hpcsweep.model.description import stops
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.sweep.amplitude_sweep import DOWN

NAME = "orbit"
DRAWS = "motions"
HELP = """\
stroboscopic displacement of each floor against the forcing amplitude, one frame, sweeps
up and down, contact regions along the top"""
OPTIONS = (
    OMEGA,
    FLOORS,
    Option(
        "--color",
        "what the colours show (default: direction)",
        choices=("direction", "contact", "period"),
    ),
)
load = load_frame
MAX_SHORTENED = 16
"""Regions whose contact sets have no room above the panels and are listed below them."""
MAX_SETS = 10
"""Contact sets that the legend names: the commonest."""
MAX_COLUMNS = 6
"""Columns of the legend."""
PANEL, PAGE = 1.75, 8.75
"""Height of a panel, and of all of them where there are many (inches)."""
FINE, FINE_KEY = 0.1, 3
"""Area of the points of a motion that does not repeat, in areas of an orbit's, and their size in
the legend."""
MIN_WIDTH, WIDE_LABEL, NARROW_LABEL = 0.035, 0.05, 0.02
"""Parts of the panel's width: least region whose label names its sets; room the labels take."""

LETTERS, MIN_LETTERS, APART = 110, 8, 1
"""Letters of such labels side by side, room of one for its sets' names, and between two."""


@dataclass(frozen=True)
class Group:
    """Points of one colour.

    Attributes
    ----------
    colour : str
    label : str
        Label in the legend; empty to leave the group out.
    runs : ndarray of bool, shape (n_directions, n_amplitudes)
        Runs of the points.
    """

    colour: str
    label: str
    runs: np.ndarray


def draw(
    results,
    omega: float | None = None,
    color: str = "direction",
    floors: Sequence[int] = (),
):
    """Draw one frame of a campaign.

    Parameters
    ----------
    results : xarray.Dataset
        From `hpcsweep.open_results`.
    omega : float, optional
        The frame nearest to this frequency; default the first.
    color : {"direction", "contact", "period"}
        Meaning of the colours; period: the period of orbits, the class of other motions.
    floors : sequence of int, optional
        Shown, from 1; see `labels.choose_floors`.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    style.need(results, "poincare", *(("contact",) if color == "contact" else ()))
    style.need_amplitudes(style.job_of(results).study)
    results = results.isel(omega=[style.nearest_frame(results["omega"].values, omega)])
    frame = results.isel(omega=0)
    structure = style.structure_of(results)
    shown = labels.choose_floors(structure.n_floors, floors)
    done = frame["outcome"].values == Outcome.COMPLETE
    if not done.any():
        raise style.PlotError("no run of this frame is complete yet")
    classes = style.classes_of(results)
    figure, axes = style.new_figure(len(shown), 1.2 + min(PANEL * len(shown), PAGE))
    groups = _groups(color, results, classes[:, 0], done, structure.contact_labels)
    low = PANEL * len(shown) > PAGE
    for floor, axis in zip(shown[::-1], axes, strict=True):
        for group in groups:
            _scatter(axis, frame, group, floor)
        axis.set_ylabel(labels.displacement(structure, floor, "" if low else "(jT)"))
        axis.margins(y=0.08)
        mark_stops(axis, structure, floor)
    axes[-1].set_xlabel(labels.amplitude(structure))
    style.limit_amplitudes(axes[-1], frame["amplitude"].values)
    note = ""
    if "contact" in frame:
        apart = coexistence(frame, classes[:, 0], structure.units_at)
        note = _mark_regions(axes, frame, done, structure.contact_labels, apart)
        note = "\n".join(filter(None, (note, labels.contacts_text(structure))))
    _legend(figure, groups, color, results, classes, note)
    return style.head(figure, style.caption(results, float(frame["omega"])), fontsize=10)


def _groups(color: str, results, classes: np.ndarray, done: np.ndarray, labels) -> list[Group]:
    """Group the complete runs of one frame by colour, in legend order."""
    frame = results.isel(omega=0)
    if color == "direction":
        own = np.eye(len(done), dtype=bool)[:, :, None]
        return [
            Group(palette.DIRECTIONS[str(name)], style.words_of(results, str(name)), done & own[d])
            for d, name in enumerate(frame["direction"].values)
        ]
    if color == "period":
        index = palette.motion_index(classes, frame["orbit_period"].values)
        return [
            Group(colour, name, done & (index == place))
            for place, (name, colour) in enumerate(palette.MOTIONS)
            if (done & (index == place)).any()
        ]
    contact = frame["contact"].values
    sets, counts = np.unique(contact[done], return_counts=True)
    named = set(np.argsort(-counts, kind="stable")[:MAX_SETS])
    order = sorted(range(sets.size), key=lambda k: (int(sets[k]).bit_count(), int(sets[k])))
    shown = [k for k in order if k in named]
    names = dict(zip(shown, style.set_names([int(sets[k]) for k in shown], labels), strict=True))
    return [
        Group(
            palette.contact_colour(int(sets[k]), labels),
            names.get(k, ""),
            done & (contact == sets[k]),
        )
        for k in order
    ]


def _scatter(axis, frame, group: Group, floor: int) -> None:
    """Draw a group's points.

    Points of orbits are large, filled on the way up, hollow on the way down; those of aperiodic
    motions are fine, so that their density shows.
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
            "marker": style.MARKERS[str(direction)],
            "facecolors": group.colour if filled else "none",
            "edgecolors": "none" if filled else group.colour,
            "linewidths": 0 if filled else 0.35,
        }
        fine = {"s": FINE * size, "color": group.colour, "linewidths": 0}
        for chosen, looks in ((~repeats[d], fine), (repeats[d], large)):
            runs = np.flatnonzero(group.runs[d] & chosen)
            if runs.size:
                axis.scatter(
                    np.repeat(amplitude[runs], counts[d, runs]),
                    displacement[d, runs][point < counts[d, runs, None]],
                    rasterized=True,
                    zorder=2 if filled else 3,
                    **looks,
                )


def mark_stops(axis, structure, floor: int) -> None:
    """Draw the floor's stops that lie within the panel."""
    limits = axis.get_ylim()
    for place in (place for side in stops(structure, floor) for place in side):
        if limits[0] < place < limits[1]:
            axis.axhline(place, color=palette.STOP, linewidth=0.8, linestyle=(0, (5, 3)), zorder=1)
    axis.set_ylim(limits)


def _mark_regions(axes, frame, done, labels, coexisting) -> str:
    """Mark the contact regions along the top, as in Figure 3 of the paper, with a legend."""
    amplitude = frame["amplitude"].values
    least = max(3, amplitude.size // 100)
    regions = contact_regions(frame["contact"].values, done, least, coexisting)
    edges = np.concatenate(
        ([amplitude[0]], 0.5 * (amplitude[1:] + amplitude[:-1]), [amplitude[-1]])
    )
    total = edges[-1] - edges[0]
    top = axes[0]
    taken: list[float] = []
    shortened: list[str] = []
    for number, region in enumerate(regions, 1):
        left, right = edges[region.first], edges[region.last + 1]
        if region.first > 0:
            for axis in axes:
                axis.axvline(left, color="0.45", linewidth=0.6, linestyle=(0, (4, 3)), zorder=1)
        share = (right - left) / total if total > 0 else 0.0
        wide = share > MIN_WIDTH
        room = max(int(LETTERS * share), MIN_LETTERS)
        names = [style.contact_name(c, labels, room).replace("none", "–") for c in region.contacts]
        whole = [style.contact_name(c, labels).replace("none", "–") for c in region.contacts]
        if not wide or names != whole:
            shortened.append(
                f"({style.roman(number)}) {' / '.join(whole)}".replace("–", "no contact")
            )
        sets = "\n".join(names)
        label = f"({style.roman(number)})\n{sets}" if wide else f"({style.roman(number)})"
        middle = 0.5 * (left + right)
        longest = (max(map(len, names)) + APART) / LETTERS
        half = 0.5 * (max(WIDE_LABEL, longest) if wide else NARROW_LABEL) * total
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
    return _words_of_regions(len(regions), shortened)


def _words_of_regions(count: int, shortened: list[str]) -> str:
    """Explain the numbers of regions, and list the contact sets that had no room."""
    if count < 2:
        return ""
    text = (
        f"(i) to ({style.roman(count)}): amplitudes of one contact set, C: contacts that close; "
        "two sets: sweeps on two motions"
    )
    if len(shortened) > MAX_SHORTENED:
        more = f"and {len(shortened) - MAX_SHORTENED} more"
        shortened = [*shortened[:MAX_SHORTENED], more]
    unbroken = [entry.replace(" ", "\u00a0") for entry in shortened]
    return "\n".join([text, *wrap(",  ".join(unbroken), style.CAPTION_ROOM)])


def _legend(figure, groups: list[Group], color: str, results, classes, note: str) -> None:
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
            key(group.label, style.MARKERS[name], group.colour, name == DOWN)
            for name, group in zip(directions, groups, strict=True)
        ]
    else:
        handles = [key(group.label, "s", group.colour) for group in groups if group.label]
        rest = sum(not group.label for group in groups)
        if rest:
            handles.append(Line2D([], [], linestyle="none", label=style.rarer_sets(rest)))
        handles += [
            key(style.words_of(results, d), style.MARKERS[d], "0.3", d == DOWN) for d in directions
        ]
    if (results["orbit_period"].values[results["outcome"].values == Outcome.COMPLETE] == 0).any():
        handles.append(key("no orbit found", ".", "0.3", size=FINE_KEY))
    style.foot(figure, handles, results, classes, min(len(handles), MAX_COLUMNS), note)
