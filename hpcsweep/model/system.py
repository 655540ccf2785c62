"""Equation of motion of a structure, M u'' + C u' + K u + contacts = b G, from its parameters.

Contacts have numbers: bits of a contact set in files, and names, as floors have, in figures.

A storey that yields is a bilinear spring: an elastic one and a slider. With P-Delta a storey of
height h carries the weight P of its floor and of all above. Where it drifts by d these stand beside
its foot: about that the moment P d acts, which a couple of horizontal forces P d / h, h apart,
replaces. So of the shear k d of the storey P d / h is spent on the weight, and

    K = sum_i (k_i - P_i / h_i) b_i b_i^T,      b_i . u = d_i,

of which the second term is the geometric stiffness of the storeys. It is linear in u and belongs to
the elastic spring: a storey yields at the drift at which it would without weights, and goes on with
alpha k - P / h, which may be negative.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from os.path import commonprefix
from typing import Any

import numpy as np

from hpcsweep.model.arguments import wrong
from hpcsweep.model.backbone import Backbone, read_backbones
from hpcsweep.model.dashpot import damping_of_restitution
from hpcsweep.model.definite import rigid_motions
from hpcsweep.model.forcing import ONE_HARMONIC
from hpcsweep.model.matrices import Contact, Matrices
from hpcsweep.model.rayleigh import Rayleigh
from hpcsweep.model.reduction import Reduction
from hpcsweep.model.slider import Slider, storey_sliders
from hpcsweep.model.unit_names import Names, UnitNames

LINKED = 1e-12
"""Entry of a damping matrix, over the largest, that links two coordinates: less is rounding."""
PerFloor = float | tuple[float, ...]


def frozen(array: np.ndarray) -> np.ndarray:
    """Return the array, read-only."""
    array.setflags(write=False)
    return array


def _of_storeys(stiffness: np.ndarray) -> np.ndarray:
    """Return the matrix of springs, or dashpots, of storeys from the lowest on."""
    above = np.append(stiffness[1:], 0.0)
    return np.diag(stiffness + above) - np.diag(stiffness[1:], 1) - np.diag(stiffness[1:], -1)


def weight_stiffness(stiffness: Sequence[float], weight: Any, height: Any) -> np.ndarray:
    """Return P / h of each storey, what P-Delta takes from its stiffness, shape (n,).

    Parameters
    ----------
    stiffness : sequence of n floats
        Of the storeys without weights, from the lowest on.
    weight, height : float or sequence of n floats
        Of each floor and of each storey.

    Raises
    ------
    ValueError
        If one is missing, or a storey cannot carry what is above it.
    """
    n = len(stiffness)
    for name, value in (("weight", weight), ("storey_height", height)):
        if value is None:
            raise wrong(name, "is missing: p_delta needs it")
    loads = np.broadcast_to(weight, n)[::-1].cumsum()[::-1] / np.broadcast_to(height, n)
    for i, (k, load) in enumerate(zip(stiffness, loads.tolist(), strict=True), 1):
        if load >= k:
            limit = f"the weight above it over its height, {load:.4g}, must be below its stiffness"
            raise wrong("p_delta", f": storey {i} does not stand: {limit}, {k:.4g}")
    return loads


@dataclass(frozen=True, repr=False)
class System:
    """Matrices and contacts of a structure, and their names.

    The attributes are the parameters of `hpcsweep.model.structure.Structure`, which validates them.
    """

    n_floors: int = 3
    stiffness_ratio: PerFloor | Sequence[float] = 1000.0
    sharpness: float = 1e4
    damping_ratio: float | Sequence[float] = 0.05
    mass: PerFloor | Sequence[float] | None = None
    storey_stiffness: PerFloor | Sequence[float] | None = None
    gap: PerFloor | Sequence[float] = 1.0
    gap_left: PerFloor | Sequence[float] = math.inf
    _: KW_ONLY
    rayleigh: tuple[float, float] | Rayleigh | Mapping[str, Any] | None = None
    storey_damping: PerFloor | Sequence[float] = 0.0
    restitution: PerFloor | Sequence[float] | None = None
    tension: bool = False
    yield_force: float | Sequence[float] | None = None
    yield_drift: float | Sequence[float] | None = None
    hardening: float | Sequence[float] = 0.0
    flag_height: float | Sequence[float] = 0.0
    backbone: Backbone | Mapping[str, Any] | Sequence[Backbone | None] | None = None
    p_delta: bool = False
    weight: PerFloor | Sequence[float] | None = None
    storey_height: PerFloor | Sequence[float] | None = None
    collapse_drift: float | Sequence[float] | None = None
    harmonics: Sequence[tuple[int, float, float]] = ONE_HARMONIC
    matrices: Matrices | None = None
    reduction: Reduction | None = field(default=None, repr=False, compare=False)
    unit_names: UnitNames = field(default=UnitNames(), compare=False)
    names: Names = field(default=Names(), compare=False)
    motion_length: float = field(default=0.0, repr=False)
    unreached: tuple[int, ...] = field(default=(), repr=False)

    def _floors(self, value: Any) -> tuple[float, ...]:
        """Return a value for each floor, storey or mode; 1 where there is none."""
        if value is None:
            return (1.0,) * self.n_floors
        return value if isinstance(value, tuple) else (value,) * self.n_floors

    @cached_property
    def is_uniform(self) -> bool:
        """Whether the structure is the chain of equal storeys, whose modes have closed forms."""
        parameters = self.matrices, self.mass, self.storey_stiffness
        return parameters == (None, None, None) and not self.p_delta

    @cached_property
    def mass_matrix(self) -> np.ndarray:
        """M, shape (n, n)."""
        if self.matrices is not None:
            return frozen(np.array(self.matrices.mass))
        return frozen(np.diag(self._floors(self.mass)))

    @property
    def elastic_stiffness(self) -> np.ndarray:
        """K without the springs of sliders, shape (n, n)."""
        if self.matrices is None:
            return self.stiffness_matrix - self._springs
        return np.array(self.matrices.stiffness)

    @property
    def _springs(self) -> np.ndarray:
        """Stiffness of the springs of all sliders, shape (n, n)."""
        return self.of_sliders([slider.spring for slider in self.sliders])

    @property
    def softest_stiffness(self) -> np.ndarray:
        """K where each slider has the least stiffness that it may have, shape (n, n)."""
        return self.elastic_stiffness + self.of_sliders([slider.softest for slider in self.sliders])

    def of_sliders(self, stiffness: Sequence[float]) -> np.ndarray:
        """Return the sum of k_j b_j b_j^T, shape (n, n)."""
        rows = self.slider_directions
        return rows.T @ (np.array(stiffness)[:, None] * rows)

    @property
    def slider_stiffness(self) -> np.ndarray:
        """k_j |b_j|^2 of every slider, shape (L,): the trace of what its spring adds to K."""
        return np.array([s.spring * float(np.square(s.direction).sum()) for s in self.sliders])

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """K, (3) of equal storeys, with the springs of all sliders, shape (n, n)."""
        if self.matrices is not None:
            return frozen(self.elastic_stiffness + self._springs)
        storeys = np.array(self._floors(self.storey_stiffness))
        return frozen(_of_storeys(storeys - self.weight_stiffness if self.p_delta else storeys))

    @property
    def weight_stiffness(self) -> np.ndarray:
        """P / h of each storey, which P-Delta takes from its stiffness, shape (n,)."""
        storeys = self._floors(self.storey_stiffness)
        return weight_stiffness(storeys, self.weight, self.storey_height)

    @cached_property
    def n_rigid(self) -> int:
        """Number of motions that neither springs nor sliders oppose: modes of frequency 0."""
        if self.is_uniform:
            return 0
        name = "storey_stiffness" if self.matrices is None else "matrices.stiffness"
        return rigid_motions(name, self.stiffness_matrix)

    @cached_property
    def storey_dashpots(self) -> np.ndarray:
        """Damping matrix of the dashpots of storeys alone, shape (n, n)."""
        damping = 0.0 if self.matrices is not None else self.storey_damping
        return frozen(_of_storeys(np.array(self._floors(damping))))

    @cached_property
    def sliders(self) -> tuple[Slider, ...]:
        """Sliders of the matrices, or of the storeys that yield."""
        if self.matrices is not None:
            return self.matrices.sliders
        yields = self.yield_force, self.yield_drift, self.hardening, self.flag_height
        return storey_sliders(self._floors(self.storey_stiffness), *yields, self.backbones)

    @property
    def backbones(self) -> tuple[Backbone | None, ...]:
        """Backbone of each storey, None of one that does not degrade."""
        return read_backbones("backbone", self.backbone, self.n_floors)

    @cached_property
    def drift_limits(self) -> np.ndarray:
        """Drift of each of `drift_rows` beyond which a motion has collapsed, inf: none."""
        limits = math.inf if self.collapse_drift is None else self.collapse_drift
        return frozen(np.array(np.broadcast_to(limits, len(self.drift_rows)), float))

    @cached_property
    def slider_directions(self) -> np.ndarray:
        """b_j of every slider, shape (L, n)."""
        listed = [slider.direction for slider in self.sliders]
        return frozen(np.array(listed, float).reshape(-1, self.n_floors))

    @property
    def slider_names(self) -> tuple[str, ...]:
        """Name of each slider: as given, or its number."""
        return tuple(slider.name or str(j) for j, slider in enumerate(self.sliders, 1))

    @cached_property
    def all_contacts(self) -> dict[int, Contact]:
        """Contacts by their numbers from 1, with those that are left out.

        Of a floor's stops the one on the right has its number, the one on the left n + that.
        """
        if self.matrices is not None:
            return dict(enumerate(self.matrices.contacts, 1))
        n, storeys = self.n_floors, self._floors(self.storey_stiffness)
        ratios = self._floors(self.stiffness_ratio)
        kappa = [r if r == math.inf else r * k for r, k in zip(ratios, storeys, strict=True)]
        stops = self._floors(self.restitution), kappa, self._floors(self.mass)
        damping = [
            0.0 if stop[1] == math.inf else damping_of_restitution(*stop, self.tension)
            for stop in zip(*stops, strict=True)
        ]
        rebounds = [None] * n if self.restitution is None else self._floors(self.restitution)
        contacts = {}
        for k, gap in enumerate((*self._floors(self.gap), *self._floors(self.gap_left))):
            if gap < math.inf:
                sign, floor = (1.0, k) if k < n else (-1.0, k - n)
                direction = tuple(sign if i == floor else 0.0 for i in range(n))
                c, stiffness = damping[floor], kappa[floor]
                e = rebounds[floor] if stiffness == math.inf else None
                contacts[k + 1] = Contact(
                    direction, gap, stiffness, c, self.tension and c > 0, restitution=e
                )
        return contacts

    @cached_property
    def contact_numbers(self) -> tuple[int, ...]:
        """Number of each contact."""
        return tuple(number for number in self.all_contacts if number not in self.unreached)

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Stops of the floors, right ones first, or contacts of the matrices; one bit each."""
        return tuple(self.all_contacts[number] for number in self.contact_numbers)

    @cached_property
    def forcing_vector(self) -> np.ndarray:
        """b, shape (n,)."""
        if self.matrices is not None and self.matrices.forcing is not None:
            return frozen(np.array(self.matrices.forcing))
        return frozen(-(self.mass_matrix * self.influence).sum(axis=1))

    @property
    def influence(self) -> np.ndarray:
        """r, displacements that a base gives the coordinates where it moves by 1, shape (n,)."""
        influence = None if self.matrices is None else self.matrices.influence
        return np.ones(self.n_floors) if influence is None else np.array(influence)

    @property
    def load(self) -> dict[str, Any]:
        """The forcing as an argument of `Structure.from_matrices`."""
        if self.matrices is not None and self.matrices.influence is not None:
            return {"influence": self.influence}
        return {"forcing": self.forcing_vector}

    @cached_property
    def drift_rows(self) -> np.ndarray:
        """Rows whose |row . u| are the drifts: between neighbouring floors, shape (any, n)."""
        n = self.n_floors
        if self.matrices is None:
            return frozen(np.eye(n) - np.eye(n, k=-1))
        return frozen(np.eye(n) if self.matrices.drift is None else np.array(self.matrices.drift))

    @cached_property
    def buildings(self) -> np.ndarray:
        """Number, from 0, of the building of each coordinate, shape (n,).

        Buildings are what contacts alone join: the parts that M, K and a given C connect.
        """
        linked = (self.mass_matrix != 0.0) | (self.stiffness_matrix != 0.0)
        if self.matrices is not None and self.matrices.damping is not None:
            damping = np.abs(self.matrices.damping)
            linked = linked | (damping > LINKED * damping.max())
        for _ in range(self.n_floors.bit_length()):
            linked = linked @ linked
        return np.unique(linked.argmax(axis=1), return_inverse=True)[1]

    @cached_property
    def base_rows(self) -> np.ndarray:
        """Row over the masses of each building, of its base shear per mass; see `buildings`."""
        is_of_building = self.buildings == np.arange(self.buildings.max() + 1)[:, None]
        rows = (is_of_building * self.influence) @ self.mass_matrix
        return frozen(rows / (rows * self.influence).sum(axis=1, keepdims=True))

    @property
    def base_masses(self) -> np.ndarray:
        """Mass of each building that its base moves."""
        of_rows = self.influence * (self.mass_matrix * self.influence).sum(axis=1)
        return np.bincount(self.buildings, of_rows)

    @property
    def building_names(self) -> tuple[str, ...]:
        """Name of each building: how the names of its floors begin, or its number.

        A single one without a name is ``building``. Coordinates of a model have names of their own.
        """
        floors: list[list[str]] = [[] for _ in range(self.buildings.max() + 1)]
        for i, name in zip(self.buildings.tolist(), self.floor_names, strict=True):
            floors[i].append(name)
        names = tuple(begin.rstrip("0123456789 ") for begin in map(commonprefix, floors))
        if all(names) and len(set(names)) == len(names) and self.reduction is None:
            return names
        return tuple(map(str, range(1, len(names) + 1))) if len(names) > 1 else ("building",)

    @property
    def floor_names(self) -> tuple[str, ...]:
        """Name of each floor: as given, e.g. A3, or its number."""
        return self.names.floors or tuple(map(str, range(1, self.n_floors + 1)))

    @property
    def storey_names(self) -> tuple[str, ...]:
        """Name of each drift: as given, that of the floor where all have one, or its number."""
        n_drifts = len(self.drift_rows)
        numbers = tuple(map(str, range(1, n_drifts + 1)))
        return self.names.storeys or (self.floor_names if n_drifts == self.n_floors else numbers)

    def contact_bits(self, key: int) -> int:
        """Return the contact set as in files, bit k - 1 for contact number k, from a key."""
        if self.contact_numbers == tuple(range(1, len(self.contact_numbers) + 1)):
            return key
        return sum(1 << (k - 1) for i, k in enumerate(self.contact_numbers) if key >> i & 1)

    @cached_property
    def contact_labels(self) -> tuple[str, ...]:
        """Label of every contact number, e.g. 2 or 2L (left); '' where there is no such contact."""
        labels = {k: self._label(k) for k in self.contact_numbers}
        return tuple(labels.get(k, "") for k in range(1, max(labels, default=0) + 1))

    def _label(self, number: int) -> str:
        left = self.matrices is None and number > self.n_floors
        return f"{number - self.n_floors}L" if left else str(number)

    @property
    def contact_names(self) -> dict[int, str]:
        """Name of each of `all_contacts`, by its number: as given, e.g. A3-B3, or its label."""
        names = self.names.contacts or tuple(map(self._label, self.all_contacts))
        return dict(zip(self.all_contacts, names, strict=True))
