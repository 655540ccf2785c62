"""A building in an engineer's terms: masses, storeys, what stands beneath."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import instance, number, plain, refused, wrong
from hpcsweep.model.backbone import Backbone, read_backbones
from hpcsweep.model.isolation import POSITIVE, RANGE, Isolation
from hpcsweep.model.rayleigh import Rayleigh, read_rayleigh
from hpcsweep.model.soil import Soil
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import COLUMN
from hpcsweep.model.vectors import each, vector

OF_STOREYS = (
    *("mass", "storey_stiffness", "damping_ratio", "rayleigh", "storey_damping", "yield_force"),
    *("yield_drift", "hardening", "p_delta", "weight", "storey_height", "collapse_drift"),
    *("flag_height", "backbone"),
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
    flag_height : float or sequence of n floats
        Of storeys that spring back, as of `hpcsweep.model.structure.Structure`.
    backbone : Backbone, dict or sequence of n, optional
        Of storeys that degrade, likewise.
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
    soil : Soil or dict, optional
        Foundation that sways and rocks beneath it, in place of `isolation`; likewise.

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
    soil: Soil | None = None
    flag_height: float | Sequence[float] = 0.0
    backbone: Backbone | Mapping[str, Any] | Sequence[Backbone | None] | None = None

    def __post_init__(self) -> None:
        mass = plain(self.mass)
        masses = vector("building.mass", mass if hasattr(mass, "__len__") else [mass], None)
        if not masses:
            raise wrong("building.mass", "must not be empty")
        object.__setattr__(self, "mass", masses)
        rayleigh = read_rayleigh("building.rayleigh", self.rayleigh, self.n_floors)
        object.__setattr__(self, "rayleigh", rayleigh)
        if self.backbone is not None:
            read = read_backbones("building.backbone", self.backbone, self.n_floors)
            object.__setattr__(self, "backbone", read)
        if self.storey_height is not None:
            heights = each("building.storey_height", self.storey_height, self.n_floors, "mass")
            if min(heights) <= 0:
                raise wrong("building.storey_height", f"must be above 0, is {min(heights)!r}")
            object.__setattr__(self, "storey_height", heights)
        stiffness = each("building.storey_stiffness", self.storey_stiffness, self.n_floors, "mass")
        if self.period is not None:
            wanted = number("building.period", self.period, POSITIVE, *RANGE)
            bare = replace(self, period=None, p_delta=False, isolation=None, soil=None)
            factor = (bare.structure.longest_period / wanted) ** 2
            if math.isinf(factor):
                raise wrong("building.period", "needs a storey_stiffness above 0")
            object.__setattr__(self, "storey_stiffness", tuple(k * factor for k in stiffness))
        if self.column is not None:
            object.__setattr__(self, "column", _column(self.column))
        for name, kind in (("isolation", Isolation), ("soil", Soil)):
            beneath: Any = getattr(self, name)
            if isinstance(beneath, Mapping):
                for key in set(beneath) - {field.name for field in fields(kind)}:
                    raise wrong(f"building.{name}", f"must not have {key!r}")
                object.__setattr__(self, name, kind(**beneath))
            elif beneath is not None:
                instance(f"building.{name}", beneath, kind)
        if self.soil is not None and self.isolation is not None:
            raise wrong("building.soil", "does not go with isolation")
        if self.soil is not None and self.storey_height is None:
            raise wrong("building.soil", "needs storey_height")

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
        if self.soil is not None:
            made = self.soil.beneath(fixed, (*self.heights, *heights), self.heights[-1])
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
        floors, names = (*fixed.floor_names, *map(floor_name, heights)), fixed.names
        return made.named(floors, (), names.storey_heights, fixed.floor_names, names.taken)

    @property
    def heights(self) -> tuple[float, ...]:
        """Height of each floor above the ground; by default the number of the floor."""
        if self.storey_height is None:
            return tuple(float(i) for i in range(1, self.n_floors + 1))
        return tuple(np.cumsum(self.storey_height).tolist())


def floor_name(end: int | float) -> str:
    """Return the name of a floor, from its number, or of a point of a column."""
    return f"{COLUMN} {end:g}" if isinstance(end, float) else str(end + 1)


def _column(column: Any) -> Column:
    """Read the columns of a building."""
    column = column._asdict() if isinstance(column, Column) else column
    if not isinstance(column, Mapping) or set(column) != set(Column._fields):
        raise refused("building.column", "share and mass", column)
    share = number("building.column.share", column["share"], "above 0, to 1", math.ulp(0.0), 1.0)
    return Column(share, number("building.column.mass", column["mass"], POSITIVE, *RANGE))
