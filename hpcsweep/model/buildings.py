"""Buildings side by side, in an engineer's terms: masses, storeys, gaps between floors."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import instance, items, number, plain, refused, wrong
from hpcsweep.model.dashpot import read_restitution, refuse_smooth
from hpcsweep.model.forcing import ONE_HARMONIC
from hpcsweep.model.isolation import POSITIVE, RANGE, Isolation
from hpcsweep.model.matrices import Contact, each, vector
from hpcsweep.model.plausibility import heights_apart
from hpcsweep.model.rayleigh import Rayleigh, read_rayleigh
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import COLUMN

SAME_HEIGHT = 1e-6
"""Relative difference of heights that count as equal."""
SHARE_AND_MASS = "the share of a storey's stiffness that it has, and the mass that moves with it"
"""What is asked of a column that is hit."""
OF_STOREYS = (
    *("mass", "storey_stiffness", "damping_ratio", "rayleigh", "storey_damping", "yield_force"),
    *("yield_drift", "hardening", "p_delta", "weight", "storey_height", "collapse_drift"),
)
"""What a building and its structure on a fixed base have under the same names."""


class Column(NamedTuple):
    """The column that floors of a neighbour hit between two floors, alike in each storey.

    A beam fixed at both ends, of the share s of the stiffness k of its storey, 12 EI/h^3 = s k. At
    the part x of its height a free point moves as the floors say, by 1 - H of the lower and H of
    the upper one, H = 3 x^2 - 2 x^3, and resists by 3 EI / (h^3 x^3 (1 - x)^3) what moves it from
    there. So a coordinate w beside those of the floors adds a spring to the stiffness of the
    building, along w - (1 - H) u_low - H u_up, and nothing else: its rotation is condensed out.
    """

    share: float
    mass: float
    """That moves with the point."""


@dataclass(frozen=True)
class Building:
    """A building of storeys on the ground, in any consistent units.

    Attributes
    ----------
    mass : float or sequence of n floats
        Of each floor, from the lowest on; one number: of the only floor.
    storey_stiffness : float or sequence of n floats
        Where the period is given only their ratios matter, 1 by default.
    period : float, optional
        Longest natural period of the building alone, above 0.
    storey_height : float or sequence of n floats, optional
        Heights determine the floors that face each other.
    damping_ratio : float or sequence of n floats
        Of the building's own modes.
    rayleigh : dict or (float, float), optional
        In place of `damping_ratio`, as of `hpcsweep.model.structure.Structure`.
    storey_damping : float or sequence of n floats
        Coefficient of a dashpot in each storey, besides.
    name : str
    yield_force, yield_drift : float or sequence of n floats, optional
        Force, or drift, at which each storey yields, above 0; ``math.inf`` for one that does not.
        One of the two.
    hardening : float or sequence of n floats
        Stiffness of a storey that yields over that before, from -0.1 to below 1.
    p_delta : bool
        Whether the weight above each storey over its height is taken from its stiffness, see
        `hpcsweep.model.system`. A `period` is that without.
    weight : float or sequence of n floats, optional
        Of each floor: what p_delta needs beside `storey_height`.
    collapse_drift : float or sequence of n floats, optional
        Drift of each storey beyond which a motion has collapsed and ends, see
        `hpcsweep.model.structure.Structure`.
    column : dict, optional
        ``{"share": 0.1, "mass": 400.0}``: share of the stiffness of each storey that the column has
        which a floor of a neighbour hits between two floors, and the mass that moves with the point
        that is hit, see `Column`. It needs `storey_height`.
    isolation : Isolation or dict, optional
        Bearings and slab beneath it; `period` and damping remain those on a fixed base.

    Examples
    --------
    Two storeys, the upper one lighter and softer; the same by its period alone:

    >>> hpcsweep.Building(mass=[2.0, 1.0], storey_stiffness=[3000.0, 2000.0], name="A").name
    'A'
    >>> hpcsweep.Building(mass=[2.0, 1.0], storey_stiffness=[3.0, 2.0], period=0.4).period
    0.4
    """

    mass: float | Sequence[float]
    storey_stiffness: float | Sequence[float] = 1.0
    storey_height: float | Sequence[float] | None = None
    damping_ratio: float | Sequence[float] = 0.05
    rayleigh: tuple[float, float] | Rayleigh | Mapping[str, Any] | None = None
    name: str = ""
    period: float | None = None
    yield_force: float | Sequence[float] | None = None
    yield_drift: float | Sequence[float] | None = None
    hardening: float | Sequence[float] = 0.0
    p_delta: bool = False
    weight: float | Sequence[float] | None = None
    collapse_drift: float | Sequence[float] | None = None
    isolation: Isolation | None = None
    storey_damping: float | Sequence[float] = 0.0
    column: Column | Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        mass = plain(self.mass)
        masses = vector("building.mass", mass if hasattr(mass, "__len__") else [mass], None)
        if not masses:
            raise wrong("building.mass", "must not be empty")
        object.__setattr__(self, "mass", masses)
        rayleigh = read_rayleigh("building.rayleigh", self.rayleigh, self.n_floors)
        object.__setattr__(self, "rayleigh", rayleigh)
        if self.storey_height is not None:
            heights = each("building.storey_height", self.storey_height, self.n_floors, "mass")
            if min(heights) <= 0:
                raise wrong("building.storey_height", f"must be above 0, is {min(heights)!r}")
            object.__setattr__(self, "storey_height", heights)
        stiffness = each("building.storey_stiffness", self.storey_stiffness, self.n_floors, "mass")
        if self.period is not None:
            wanted = number("building.period", self.period, POSITIVE, *RANGE)
            bare = replace(self, period=None, p_delta=False, isolation=None)
            factor = (bare.structure.longest_period / wanted) ** 2
            if math.isinf(factor):
                raise wrong("building.period", "needs a storey_stiffness above 0")
            object.__setattr__(self, "storey_stiffness", tuple(k * factor for k in stiffness))
        if self.column is not None:
            object.__setattr__(self, "column", _column(self.column))
        bearings: Any = self.isolation
        if isinstance(bearings, Mapping):
            for key in set(bearings) - {field.name for field in fields(Isolation)}:
                raise wrong("building.isolation", f"must not have {key!r}")
            object.__setattr__(self, "isolation", Isolation(**bearings))
        elif bearings is not None:
            instance("building.isolation", bearings, Isolation)

    @property
    def n_floors(self) -> int:
        """Number n of floors, without a slab on bearings."""
        return int(np.size(self.mass))

    @functools.cached_property
    def structure(self) -> Structure:
        """Structure of the building alone, on its bearings if it has some."""
        return self.struck([])

    def struck(self, heights: Sequence[float]) -> Structure:
        """Return the structure with a coordinate for each point of its columns at some heights."""
        fixed = self._with_points(heights) if heights else self.on_fixed_base
        made = fixed if self.isolation is None else self.isolation.beneath(fixed)
        return made.named(*made.names[:2], *fixed.names[2:3], fixed.storey_names, fixed.names.taken)

    @functools.cached_property
    def on_fixed_base(self) -> Structure:
        """Structure of its storeys on the ground, without stops."""
        parameters: dict[str, Any] = {name: getattr(self, name) for name in OF_STOREYS}
        parameters |= {"stiffness_ratio": 0.0, "gap": math.inf, "sharpness": math.inf}
        return Structure(self.n_floors, **parameters)

    def _with_points(self, heights: Sequence[float]) -> Structure:
        """Return the structure on the ground, with points of columns behind its floors."""
        fixed, n = self.on_fixed_base, self.n_floors
        assert isinstance(self.column, Column)
        share, mass = self.column
        levels, springs = (0.0, *self.heights), each("", self.storey_stiffness, n, "mass")
        rows, stiffness = [], []
        for p, height in enumerate(heights):
            i = int(np.searchsorted(levels, height)) - 1
            x = (height - levels[i]) / (levels[i + 1] - levels[i])
            up = x * x * (3.0 - 2.0 * x)
            row = np.eye(1, n + len(heights), n + p)[0]
            row[i] -= up
            row[i - 1 : i] -= 1.0 - up  # empty above the ground, which does not move
            rows.append(row)
            stiffness.append(share * springs[i] / (4.0 * (x * (1.0 - x)) ** 3))
        points, kept = np.array(rows), np.eye(n, n + len(heights))
        ratio = float(np.min(fixed.damping_ratios))
        drag = 2.0 * ratio * np.sqrt(np.multiply(stiffness, mass))
        made = Structure.from_matrices(
            np.append(np.diag(fixed.mass_matrix), [mass] * len(heights)),
            kept.T @ fixed.elastic_stiffness @ kept + points.T @ np.diag(stiffness) @ points,
            [],
            damping=kept.T @ fixed.damping_matrix @ kept + points.T @ np.diag(drag) @ points,
            drift=fixed.drift_rows @ kept,
            sliders=[replace(s, direction=np.dot(s.direction, kept)) for s in fixed.sliders],
            collapse_drift=fixed.collapse_drift,
        )
        names = (*fixed.floor_names, *map(_floor, heights))
        return made.named(names, (), fixed.names.storey_heights, fixed.floor_names)

    @property
    def heights(self) -> tuple[float, ...]:
        """Height of each floor above the ground; by default the number of the floor."""
        if self.storey_height is None:
            return tuple(float(i) for i in range(1, self.n_floors + 1))
        return tuple(np.cumsum(self.storey_height).tolist())


def adjacent(
    buildings: Sequence[Building],
    gap: float | Sequence[float],
    stiffness: float | Sequence[float],
    *,
    sharpness: float = math.inf,
    restitution: float | Sequence[float] | None = None,
    damping: float | Sequence[float] | None = None,
    tension: bool = False,
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
    unit = np.eye(first[-1])
    if restitution is not None and damping is not None:
        raise wrong("pounding.restitution and pounding.damping", "must not be given both")
    masses = np.concatenate([np.diag(structure.mass_matrix) for structure in alone])
    of_levels = (
        ("pounding.gap", gap),
        ("pounding.stiffness", stiffness),
        ("pounding.restitution", 1.0 if restitution is None else restitution),
        ("pounding.damping", 0.0 if damping is None else damping),
    )
    contacts, labels = [], []
    for pairs in levels:
        values = (each(name, value, len(pairs), "level") for name, value in of_levels)
        for (i, j), own_gap, kappa, e, c in zip(pairs, *values, strict=True):
            stop = unit[i] - unit[j], own_gap, kappa
            contacts.append(_contact(stop, c, tension, None if restitution is None else e, masses))
            labels.append(f"{floors[i]}-{floors[j]}")
    refuse_smooth(contacts, sharpness, of_levels[2 if damping is None else 3])
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
    heights, taken = _heights_and_loads(alone)
    return made.named(floors, labels + of("names.contacts"), heights, of("storey_names"), taken)


def _heights_and_loads(alone: Sequence[Structure]) -> tuple[list[float], list[float]]:
    """Return the height of each storey, and what P-Delta has taken from its stiffness."""
    heights = [height for structure in alone for height in structure.names.storey_heights]
    taken = [p for one in alone for p in one.names.taken or (0.0,) * len(one.drift_rows)]
    return heights, taken


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


def _floor(end: int | float) -> str:
    """Return the name of a floor, from its number, or of a point of a column."""
    return f"{COLUMN} {end:g}" if isinstance(end, float) else str(end + 1)


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
            [first[k + s] + alone[k + s].floor_names.index(_floor(end[s])) for s in (0, 1)]
            for end in ends
        ]
        for k, ends in enumerate(levels)
    ]
    return alone, first, meets


def _column(column: Any) -> Column:
    """Read the columns of a building."""
    column = column._asdict() if isinstance(column, Column) else column
    if not isinstance(column, Mapping) or set(column) != set(Column._fields):
        raise refused("building.column", "share and mass", column)
    share = number("building.column.share", column["share"], "above 0, to 1", math.ulp(0.0), 1.0)
    return Column(share, number("building.column.mass", column["mass"], POSITIVE, *RANGE))
