"""Orbit diagrams of sweeps, with the contact regions."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics import classify
from hpcsweep.figures import labels, palette, style, view
from hpcsweep.figures.diagrams import sweep
from hpcsweep.figures.diagrams.mesh import edges_of
from hpcsweep.figures.diagrams.regions import coexistence, contact_regions
from hpcsweep.figures.options import AMPLITUDES, BRANCHES, COLOUR, FLOORS, OMEGA, ROWS, figure_of
from hpcsweep.model.coordinates import Coordinate
from hpcsweep.model.description import contacts_named
from hpcsweep.studies.grid import DOWN

MAX_SHORTENED = 16
"""Regions whose contact sets have no room above the panels and are listed below them."""
PLACES = {"amplitude": "amplitudes", "omega": "frequencies"}
MAX_SETS = 10
"""Contact sets that the legend names: the commonest."""
MAX_COLUMNS, NOTE_ROOM = 6, 92
"""Columns of the legend, and letters of a line of its note."""
MIN_WIDTH, WIDE_LABEL, NARROW_LABEL = 0.035, 0.05, 0.02
"""Parts of the panel's width: least region whose label names its sets; room the labels take."""

LETTERS, MIN_LETTERS, APART = 110, 8, 1
"""Letters of such labels side by side, room of one for its sets' names, and between two."""


class Group(NamedTuple):
    """Points of one colour.

    Attributes
    ----------
    colour : str
    label : str
        Label in the legend; empty to leave the group out.
    runs : ndarray of bool, shape (n_directions, n_along)
        Runs of the points.
    """

    colour: str
    label: str
    runs: np.ndarray


@figure_of("orbit", "motions", sweep.load_frame, OMEGA, AMPLITUDES, FLOORS, ROWS, BRANCHES, COLOUR)
def orbit(
    results,
    color: str = "direction",
    floors: Sequence[int | str] = (),
    branches: Path | None = None,
    **_options,
):
    """Stroboscopic displacement of each floor against the forcing amplitude, or another parameter.

    One frame, sweeps up and down, contact regions along the top.

    Parameters
    ----------
    results : xarray.Dataset
        The first frame is drawn.
    color : {"direction", "contact", "period"}
        Meaning of the colours; period: the period of orbits, the class of other motions.
    floors : sequence of int or str, optional
        Shown, see `coordinates.coordinates`.
    branches : Path, optional
        Results file of branches along the same path, drawn beneath.

    Raises
    ------
    PlotError
        If the file does not hold the variables to draw.
    """
    needed = ("poincare", *(("contact",) if color == "contact" else ()))
    frame = sweep.open_frame(results, *needed)
    structure = frame.structure
    figure, axes = sweep.coordinate_panels(structure, floors, labels.along(frame.study))
    groups, keys = _groups(color, frame), sweep.lay_branches(axes, frame, branches)
    for coordinate, axis in axes.items():
        for group in groups:
            _scatter(axis, frame.runs, group, coordinate)
        sweep.mark_stops(axis, frame.study.structures, coordinate, frame.along)
    style.limit_amplitudes(axis, frame.along)
    note = ""
    if "contact" in frame.runs and structure.contacts:
        apart = coexistence(frame.runs, frame.classes, frame.study.units_at)
        regions = _mark_regions([*axes.values()], frame, structure.contact_labels, apart)
        named = contacts_named(structure)
        note = "\n".join(filter(None, (regions, f"Contacts: {named}" * bool(named))))
    _legend(figure, groups, color, frame, note, keys)
    return style.head(figure, frame.caption)


def _groups(color: str, frame: sweep.Frame) -> list[Group]:
    """Group the complete runs of one frame by colour, in legend order."""
    if color == "direction":
        names = [str(name) for name in frame.runs["direction"].values]
        by_direction = frame.done & np.eye(len(names), dtype=bool)[:, :, None]
        return [
            Group(palette.DIRECTIONS[name], style.words_of(frame.results, name), runs)
            for name, runs in zip(names, by_direction, strict=True)
        ]
    if color == "period":
        index = palette.motion_index(frame.classes, frame.runs["orbit_period"].values)
        groups = [
            Group(colour, name, frame.done & (index == place))
            for place, (name, colour) in enumerate(palette.motions_of(frame.structure))
        ]
        return [group for group in groups if group.runs.any()]
    contact, numbers = frame.runs["contact"].values, frame.structure.contact_labels
    return [
        Group(colour, name, frame.done & (contact == c))
        for c, colour, name in style.commonest_sets(contact[frame.done], numbers, MAX_SETS)
    ]


def _scatter(axis, swept, group: Group, coordinate: Coordinate) -> None:
    """Draw a group's points.

    Points of orbits are large, filled on the way up, hollow on the way down; those of aperiodic
    motions are fine, so that their density shows.
    """
    size, repeats = sweep.orbit_area(swept), swept["orbit_period"].values > 0
    fine = {"s": sweep.FINE * size, "color": group.colour, "linewidths": 0}
    solid = {"s": size, "facecolors": group.colour, "edgecolors": "none", "linewidths": 0}
    hollow = {"s": 1.6 * size, "facecolors": "none", "edgecolors": group.colour, "linewidths": 0.35}
    for d, direction in enumerate(swept["direction"].values):
        filled = str(direction) != DOWN
        large = {"marker": style.MARKERS[str(direction)], **(solid if filled else hollow)}
        runs = group.runs & (np.arange(len(repeats)) == d)[:, None]
        for chosen, looks in ((~repeats, fine), (repeats, large)):
            order = 2 if filled else 3
            sweep.scatter(axis, swept, runs & chosen, coordinate, zorder=order, **looks)


def _mark_regions(axes, frame: sweep.Frame, labels, coexisting) -> str:
    """Mark the contact regions along the top, as in Figure 3 of the paper, with a legend."""
    along = frame.along
    least = max(3, along.size // 100)
    regions = contact_regions(frame.runs["contact"].values, frame.done, least, coexisting)
    edges = np.clip(edges_of(along), *view.visible("x", along[0], along[-1]))
    total = edges[-1] - edges[0]
    top = axes[0]
    taken: list[float] = []
    shortened: list[str] = []
    for number, region in enumerate(regions, 1):
        left, right = edges[region.first], edges[region.last + 1]
        if left == right and total > 0:
            continue  # beyond the limits of the axis
        if left > edges[0]:
            for axis in axes:
                axis.axvline(left, color="0.45", linewidth=0.6, linestyle=(0, (4, 3)), zorder=1)
        share = (right - left) / total if total > 0 else 0.0
        wide = share > MIN_WIDTH
        room = max(int(LETTERS * share), MIN_LETTERS)
        names, whole = (_names(region.contacts, labels, most) for most in (room, None))
        if not wide or names != whole:
            sets = " / ".join(whole).replace("–", "no contact")
            shortened.append(f"({roman(number)}) {sets}")
        sets = "\n".join(names)
        label = f"({roman(number)})\n{sets}" if wide else f"({roman(number)})"
        middle = 0.5 * (left + right)
        longest = (max(map(len, names)) + APART) / LETTERS
        half = 0.5 * (max(WIDE_LABEL, longest) if wide else NARROW_LABEL) * total
        level = 0
        while level < len(taken) and middle - half < taken[level]:
            level += 1
        taken[level:] = [middle + half]
        at = (middle, 1.0), (0, 3 + 30 * level)
        where = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        looks = {"fontsize": 7, "linespacing": 1.05, "rotation": 0 if wide else 90}
        top.annotate(label, *at, ha="center", va="bottom", **where, **looks)
    return _words_of_regions(len(regions), shortened, frame.study.run_dims[-1])


def _names(contacts: tuple[int, ...], labels, room: int | None) -> list[str]:
    """Return the names of the contact sets of a region; of two motions with one set, their number.

    Parameters
    ----------
    contacts : tuple of int
        Of a `Region`.
    labels : int or sequence of str
        See `classify.contact_name`.
    room : int or None
        Most letters of a name.
    """
    sets = dict.fromkeys(contacts)
    names = [classify.contact_name(c, labels, room).replace("none", "–") for c in sets]
    return names if len(names) == len(contacts) else [f"{len(contacts)} × {names[0]}"]


def _words_of_regions(count: int, shortened: list[str], along: str) -> str:
    """Explain the numbers of regions, and list the contact sets that had no room."""
    if count < 2:
        return ""
    text = (
        f"(i) to ({roman(count)}): {PLACES.get(along, 'values')} of one contact set, C: contacts "
        "that close; two sets: sweeps on two motions"
    )
    if len(shortened) > MAX_SHORTENED:
        more = f"and {len(shortened) - MAX_SHORTENED} more"
        shortened = [*shortened[:MAX_SHORTENED], more]
    unbroken = [entry.replace(" ", "\u00a0") for entry in shortened]
    return "\n".join([text, *wrap(",  ".join(unbroken), NOTE_ROOM)])


def roman(number: int) -> str:
    """Return a positive number in lower-case Roman numerals."""
    digits = ((100, "c"), (90, "xc"), (50, "l"), (40, "xl"), (10, "x"), (9, "ix"), (5, "v"))
    text = ""
    for value, letters in (*digits, (4, "iv"), (1, "i")):
        while number >= value:
            text += letters
            number -= value
    return text


def _legend(
    figure, groups: list[Group], color: str, frame: sweep.Frame, note: str, keys: list
) -> None:
    directions = [str(name) for name in frame.runs["direction"].values]
    looks = [(style.MARKERS[d], 5, "none" if d == DOWN else None) for d in directions]
    if color == "direction":
        pairs = zip(groups, looks, strict=True)
        handles = [labels.dot(group.label, group.colour, *look) for group, look in pairs]
    else:
        handles = [labels.dot(group.label, group.colour, "s") for group in groups if group.label]
        rest = sum(not group.label for group in groups)
        if rest:
            handles.append(labels.dot(style.rarer_sets(rest), "none"))
        words = (style.words_of(frame.results, name) for name in directions)
        handles += [labels.dot(word, "0.3", *look) for word, look in zip(words, looks, strict=True)]
    if (frame.runs["orbit_period"].values[frame.done] == 0).any():
        handles.append(labels.dot("no orbit found", "0.3", ".", sweep.FINE_KEY))
    handles += keys
    style.foot(figure, handles, frame.results, frame.classes, min(len(handles), MAX_COLUMNS), note)
