"""Buildings side by side, and the contacts of their floors."""

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from hpcsweep.model.arguments import instance, items, wrong
from hpcsweep.model.buildings import Building, floor_name
from hpcsweep.model.dashpot import read_restitution, refuse_smooth
from hpcsweep.model.forcing import ONE_HARMONIC
from hpcsweep.model.matrices import Contact
from hpcsweep.model.plausibility import heights_apart
from hpcsweep.model.structure import Structure
from hpcsweep.model.vectors import each, vector

SAME_HEIGHT = 1e-6
"""Relative difference of heights that count as equal."""
SHARE_AND_MASS = "the share of a storey's stiffness that it has, and the mass that moves with it"
"""What is asked of a column that is hit."""
OF_PAIRS = {"gap", "stiffness", "restitution", "damping", "tension", "bumper"}
"""What two neighbours may have of their own."""


def adjacent(
    buildings: Sequence[Building],
    gap: float | Sequence[float] = math.inf,
    stiffness: float | Sequence[float] = 0.0,
    *,
    sharpness: float = math.inf,
    restitution: float | Sequence[float] | None = None,
    damping: float | Sequence[float] | None = None,
    tension: bool = False,
    bumper: Sequence[tuple[float, float]] = (),
    between: Sequence[Mapping[str, Any]] = (),
    harmonics: Sequence[tuple[int, float, float]] = ONE_HARMONIC,
) -> Structure:
    """Return the structure of buildings that pound each other, from left to right.

    Floors of equal height, or number without `storey_height`, touch; one that faces a column of a
    building hits that (`Building`, column). Units are those of the
    buildings.

    Parameters
    ----------
    buildings : sequence of Building
        At least two.
    gap, stiffness : float or sequence of float
        Of all contacts, or of each level at which floors face each other, from the lowest on, the
        same between all neighbours of that level.
    restitution : float or sequence of float, optional
        Of the contacts, above 0 and at most 1, for two floors that collide as if alone.
    damping : float or sequence of float, optional
        Coefficient of their dashpots, in place of `restitution`.
    tension : bool
        Whether the dashpots may pull, see `Contact`.
    bumper : sequence of (float, float)
        Further straight lines of the force: from which closing on contacts have which stiffness,
        above the one before. Each line is a contact of its own.
    between : sequence of dict
        In place of these parameters, from `gap` on, a table of them between each two neighbours.
    sharpness, harmonics
        See `Structure`.

    Returns
    -------
    Structure
        Its `names` identify building and floor.

    Raises
    ------
    ValueError
        If a value is outside its range, or a floor faces a column of which nothing is known.

    References
    ----------
    Anagnostopoulos, Earthquake Engineering & Structural Dynamics 16 (1988) 443, of `restitution`.

    Examples
    --------
    A building of two storeys, 20 mm from one of a single storey: the lower floors face each other.

    >>> left = hpcsweep.Building(mass=[2.0, 1.0], storey_stiffness=[3000.0, 2000.0], name="A")
    >>> right = hpcsweep.Building(mass=1.5, storey_stiffness=900.0, name="B")
    >>> pair = hpcsweep.adjacent([left, right], gap=0.02, stiffness=1e5, restitution=0.65)
    >>> pair.names.floors
    ('A1', 'A2', 'B1')
    >>> pair.names.contacts
    ('A1-B1',)
    """
    from scipy.linalg import block_diag  # takes 0.1 s to load

    listed = items("building", buildings, "a list of buildings")
    buildings = [instance("building", building, Building) for building in listed]
    names = _names(buildings)
    alone, first, levels = _side_by_side(buildings, names)
    of = functools.partial(_labels, alone, names)
    floors = of("floor_names")
    masses = np.concatenate([np.diag(structure.mass_matrix) for structure in alone])
    of_all: dict[str, Any] = {"gap": gap, "stiffness": stiffness, "restitution": restitution}
    of_all |= {"damping": damping, "tension": tension, "bumper": bumper}
    tables = [*between] or [of_all] * len(levels)
    contacts, labels = _touching(levels, tables, floors, masses)
    key = "restitution" if damping is None else "damping"
    refuse_smooth(contacts, sharpness, None if between else (f"pounding.{key}", of_all[key]))
    sliders = _beside([structure.sliders for structure in alone], first)
    falls = any(structure.collapse_drift is not None for structure in alone)
    limits = np.concatenate([structure.drift_limits for structure in alone]).tolist()
    made = Structure.from_matrices(
        block_diag(*(structure.mass_matrix for structure in alone)),
        block_diag(*(structure.elastic_stiffness for structure in alone)),
        contacts + _beside([structure.contacts for structure in alone], first),
        damping=block_diag(*(structure.damping_matrix for structure in alone)),
        drift=block_diag(*(structure.drift_rows for structure in alone)),
        sharpness=sharpness,
        harmonics=harmonics,
        sliders=[replace(s, name=n) for s, n in zip(sliders, of("slider_names"), strict=True)],
        collapse_drift=limits if falls else None,
    )
    heights = [height for structure in alone for height in structure.names.storey_heights]
    taken = [p for one in alone for p in one.names.taken or (0.0,) * len(one.drift_rows)]
    return made.named(floors, labels + of("names.contacts"), heights, of("storey_names"), taken)


def _touching(
    levels: Sequence[Sequence[Sequence[int]]],
    tables: Sequence[Mapping[str, Any]],
    floors: Sequence[str],
    masses: np.ndarray,
) -> tuple[list[Contact], list[str]]:
    """Return the contacts between neighbours, each two with a table, and their names."""
    if len(tables) != len(levels):
        limit = f"must be one table, or {len(levels)}, one between each two, is {len(tables)}"
        raise wrong("pounding", limit)
    contacts, labels, unit = [], [], np.eye(len(floors))
    for pairs, table in zip(levels, tables, strict=True):
        if unknown := {*table} - OF_PAIRS:
            raise wrong(f"pounding.{unknown.pop()}", "goes with one table, of all neighbours")
        ends = [(unit[i] - unit[j], f"{floors[i]}-{floors[j]}") for i, j in pairs]
        for contact, label in _contacts(ends, masses, **table):
            contacts.append(contact)
            labels.append(label)
    return contacts, labels


def _contacts(
    ends, masses, gap, stiffness, restitution=None, damping=None, tension=False, bumper=()
) -> Iterator[tuple[Contact, str]]:
    """Yield the contacts of two neighbours, with their names; see `adjacent`."""
    if restitution is not None and damping is not None:
        raise wrong("pounding.restitution and pounding.damping", "must not be given both")
    of_levels = (
        ("pounding.gap", gap),
        ("pounding.stiffness", stiffness),
        ("pounding.restitution", 1.0 if restitution is None else restitution),
        ("pounding.damping", 0.0 if damping is None else damping),
    )
    values = (each(name, value, len(ends), "level") for name, value in of_levels)
    for (direction, label), own_gap, kappa, e, c in zip(ends, *values, strict=True):
        stop = direction, own_gap, kappa
        yield _contact(stop, c, tension, None if restitution is None else e, masses), label
        before = (0.0, kappa)
        for line in items("pounding.bumper", bumper, "pairs of a closing and a stiffness"):
            closing, stiff = vector("pounding.bumper", line, 2)
            if not (closing > before[0] and before[1] < stiff < math.inf):
                limit = "must ascend from 0 and from the stiffness, as [[0.01, 5e8]]"
                raise wrong("pounding.bumper", f"{limit}, is {bumper!r}")
            yield Contact(direction, own_gap + closing, stiff - before[1]), f"{label} {closing:g}"
            before = closing, stiff


def _contact(stop: tuple[Any, float, float], c, tension, e: float | None, masses) -> Contact:
    """Return a contact, if wanted with the dashpot of a coefficient of restitution, or rigid."""
    if e is None:
        return Contact(*stop, c, tension)
    if stop[2] < math.inf:
        read_restitution("pounding.restitution", e)
    return Contact.from_restitution(*stop, e, masses, tension)


def _labels(alone: Sequence[Structure], names: Sequence[str], what: str) -> list[str]:
    """Return labels of buildings, of floors for instance, behind the buildings' names."""
    pairs = zip(names, map(attrgetter(what), alone), strict=True)
    return [
        f"{name}{label}" if label.isdigit() else f"{name} {label}"
        for name, labels in pairs
        for label in labels
    ]


def _beside(elements: Sequence[Sequence[Any]], first: Sequence[int]) -> list[Any]:
    """Return contacts or sliders of buildings in the coordinates of all."""
    n = first[-1]
    return [
        replace(element, direction=(0.0,) * before + element.direction + (0.0,) * (n - after))
        for of_building, (before, after) in zip(elements, pairwise(first), strict=True)
        for element in of_building
    ]


def _names(buildings: Sequence[Building]) -> list[str]:
    """Return the names of two or more buildings, by default letters."""
    if len(buildings) < 2:
        raise wrong("building", f"must be given at least twice, is given {len(buildings)} times")
    names = [building.name or chr(ord("A") + k) for k, building in enumerate(buildings)]
    if len(set(names)) < len(names):
        raise wrong("building.name", f"must be of one building each, are {names}")
    return names


def _facing(first: tuple[Building, str], second: tuple[Building, str]) -> list[list[Any]]:
    """Return what meets between two buildings, upwards: floors, and heights on columns."""
    (left, _), (right, _) = first, second
    if (left.storey_height is None) != (right.storey_height is None):
        raise wrong("building.storey_height", "must be given of all buildings or of none")
    meets: list[tuple[float, list[Any]]] = [
        (height, [i, j])
        for i, height in enumerate(left.heights)
        for j, met in enumerate(right.heights)
        if abs(met - height) <= SAME_HEIGHT * height
    ]
    floors = [ends for _, ends in meets]
    lower = min(left.heights[-1], right.heights[-1])
    apart = heights_apart(np.hstack([np.diff(b.heights, prepend=0) for b in (left, right)]))
    for side, ((building, name), (hit, hit_name)) in enumerate(((first, second), (second, first))):
        met = {ends[side] for ends in floors}
        for i, height in enumerate(building.heights):
            if i in met or height > lower * (1.0 + SAME_HEIGHT):
                continue
            if hit.column is None:
                faces = f": floor {i + 1} of {name} at height {height:g} faces a column of"
                remedy = apart or f"give {hit_name} column = {{share, mass}}, {SHARE_AND_MASS}"
                raise wrong("building.storey_height", f"{faces} {hit_name}: {remedy}")
            meets.append((height, [height, i] if side else [i, height]))
    return [ends for _, ends in sorted(meets, key=lambda level: level[0])]


def _side_by_side(
    buildings: Sequence[Building], names: Sequence[str]
) -> tuple[list[Structure], list[int], list[list[list[int]]]]:
    """Return the structures alone, their first coordinates, and pairs of coordinates that meet."""
    levels = [_facing(*pair) for pair in pairwise(zip(buildings, names, strict=True))]
    points: list[set[float]] = [set() for _ in buildings]
    for k, ends in enumerate(levels):
        for side in (0, 1):
            points[k + side] |= {end[side] for end in ends if isinstance(end[side], float)}
    alone = [
        building.struck(sorted(heights)) if heights else building.structure
        for building, heights in zip(buildings, points, strict=True)
    ]
    first = np.cumsum([0, *(structure.n_floors for structure in alone)]).tolist()
    meets = [
        [
            [first[k + s] + alone[k + s].floor_names.index(floor_name(end[s])) for s in (0, 1)]
            for end in ends
        ]
        for k, ends in enumerate(levels)
    ]
    return alone, first, meets
