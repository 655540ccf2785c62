"""Base isolation: a slab on bearings beneath a building, between the walls of a moat.

The bearings are a bilinear spring between the ground and the slab: their stiffness after yielding k
is an elastic spring, beside which a slider of the strength Q has the rest of their initial
stiffness. Of lead-rubber bearings Q is the strength of the lead; a friction pendulum of radius R
and friction mu has k = W / R and Q = mu W, W the weight of the slab and all floors.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hpcsweep.model.arguments import number, wrong
from hpcsweep.model.matrices import Contact
from hpcsweep.model.modes import longest_period
from hpcsweep.model.slider import Slider
from hpcsweep.model.structure import Structure

RANGE = 1e-12, 1e12
POSITIVE = "finite and positive, from {:g} to {:g}".format(*RANGE)
"""Of quantities in whatever units."""
SLAB = "isolation"
"""Name of the slab among the floors, and of the bearings among the sliders."""
WALLS = "wall right", "wall left"
STIFFNESS = ("period", "stiffness", "radius")
STRENGTH = ("strength", "yield_drift", "friction")
INITIAL, OF_FRICTION = 10.0, 100.0
"""Initial stiffness over that after yielding by default: of lead-rubber bearings, which have 5 to
15, and of those that slide, which are rigid until then."""
LIMITS: dict[str, tuple[str, float, float]] = {
    **dict.fromkeys(("slab_mass", *STIFFNESS, *STRENGTH), (POSITIVE, *RANGE)),
    **dict.fromkeys(("initial_stiffness", "gravity"), (POSITIVE, *RANGE)),
    "friction": ("above 0, and at most 1", 1e-12, 1.0),
    "damping_ratio": ("from 0 to 100", 0.0, 100.0),
    "gap": ("at least 0 (inf: no walls)", 0.0, math.inf),
    "wall_stiffness": ("from 0 to 1e+12", 0.0, 1e12),
}


@dataclass(frozen=True)
class Isolation:
    """Bearings beneath the slab of a `Building`, and the moat walls beside it.

    Attributes
    ----------
    slab_mass : float
        Of the floor on the bearings, above 0.
    period, stiffness, radius : float, optional
        One of the three gives the stiffness of all bearings after yielding, k: itself, the period
        2 pi sqrt(m / k) of the whole mass m on it, or the radius of a friction pendulum, m g / k.
    strength, yield_drift, friction : float, optional
        One of the three gives the force Q of all bearings at which their slider slips: itself, the
        displacement at which they yield, or the coefficient of friction, Q / (m g).
    initial_stiffness : float, optional
        Of all bearings before they yield, above k. Default: 10 k, with `friction` 100 k.
    damping_ratio : float
        Of a dashpot beside the bearings, 2 zeta sqrt(k m).
    gap : float
        Distance of the slab at rest from the walls on both sides, at least 0; inf: none.
    wall_stiffness : float
        Of each wall, above 0 where there is a gap.
    gravity : float
        g in the units of the building, for `radius` and `friction`.

    Examples
    --------
    Sliding bearings of radius 2 m beneath 400 t, and the force at which they slide:

    >>> isolation = hpcsweep.Isolation(slab_mass=1e5, radius=2.0, friction=0.05)
    >>> round(isolation.bearings(mass=4e5)[2])
    196133
    """

    slab_mass: float
    period: float | None = None
    stiffness: float | None = None
    radius: float | None = None
    strength: float | None = None
    yield_drift: float | None = None
    friction: float | None = None
    initial_stiffness: float | None = None
    damping_ratio: float = 0.0
    gap: float = math.inf
    wall_stiffness: float = 0.0
    gravity: float = 9.80665

    def __post_init__(self) -> None:
        for name, limits in LIMITS.items():
            if (value := getattr(self, name)) is not None or name == "gap":
                object.__setattr__(self, name, number(_key(name), value, *limits))
        for names in (STIFFNESS, STRENGTH):
            self._one_of(names)
        if not self.wall_stiffness and self.gap < math.inf:
            raise wrong(_key("wall_stiffness"), "must be given with gap, and above 0")

    def _one_of(self, names: tuple[str, ...]) -> tuple[str, float]:
        """Return the one attribute given out of several, and its value."""
        pairs = [(name, value) for name in names if (value := getattr(self, name)) is not None]
        if len(pairs) > 1:
            raise wrong(_key(pairs[0][0]), f"and {pairs[1][0]} must not be given both")
        if not pairs:
            raise wrong(_key(names[0]), f", {names[1]} or {names[2]} must be given")
        return pairs[0]

    def bearings(self, mass: float) -> tuple[float, float, float]:
        """Return k, the initial stiffness and Q beneath a whole mass."""
        after, initial = springs(vars(self), mass)
        by, value = self._one_of(STRENGTH)
        if initial <= after:
            limit = f"above that after yielding, {after:g}, is {initial:g}"
            raise wrong(_key("initial_stiffness"), f"must be {limit}")
        of_drift, of_weight = value * (initial - after), value * (mass * self.gravity)
        force = {"strength": value, "yield_drift": of_drift, "friction": of_weight}[by]
        return after, initial, force

    def beneath(self, fixed: Structure) -> Structure:
        """Return the structure on slab and bearings, from that on a fixed base."""
        slab = np.eye(1, fixed.n_floors + 1)[0]
        relative = np.hstack((np.full((fixed.n_floors, 1), -1.0), np.eye(fixed.n_floors)))
        mass = np.append(self.slab_mass, np.diag(fixed.mass_matrix))
        after, initial, strength = self.bearings(float(mass.sum()))
        drag = 2.0 * self.damping_ratio * math.sqrt(after * mass.sum())

        def on_slab(matrix: np.ndarray, of_bearings: float) -> np.ndarray:
            return relative.T @ matrix @ relative + of_bearings * np.outer(slab, slab)

        storeys = [replace(s, direction=np.dot(s.direction, relative)) for s in fixed.sliders]
        signs = (1.0, -1.0) if self.gap < math.inf else ()
        made = Structure.from_matrices(
            mass,
            on_slab(fixed.elastic_stiffness, after),
            [Contact(sign * slab, self.gap, self.wall_stiffness) for sign in signs],
            damping=on_slab(fixed.damping_matrix, drag),
            drift=fixed.drift_rows @ relative,
            sliders=[Slider(slab, initial - after, strength, SLAB), *storeys],
            collapse_drift=fixed.collapse_drift,
        )
        return made.named((SLAB, *fixed.floor_names), WALLS[: len(signs)])


def springs(bearings: Mapping[str, Any], mass: Any) -> tuple[Any, Any]:
    """Return k and the initial stiffness beneath whole masses, of attributes of `Isolation`.

    Numbers, or arrays with an entry for each of several isolations.
    """
    by = next(name for name in STIFFNESS if bearings.get(name) is not None)
    value = bearings[by]
    of_period, of_radius = mass * (2.0 * math.pi / value) ** 2, mass * bearings["gravity"] / value
    after = {"period": of_period, "stiffness": value, "radius": of_radius}[by]
    initial = bearings.get("initial_stiffness")
    by_default = OF_FRICTION if bearings.get("friction") is not None else INITIAL
    return after, after * by_default if initial is None else initial


def isolated_period(structure: Structure) -> float | None:
    """Return the longest period of what stands on bearings that slide; None without these.

    Storeys that may yield do not: this is the period by which isolation is designed, where the
    modes of the structure are those of stuck bearings.
    """
    named = zip(structure.slider_names, structure.sliders, strict=True)
    bearings = [slider for name, slider in named if name.endswith(SLAB)]
    if not bearings:
        return None
    rows = np.array([slider.direction for slider in bearings])
    sliding = structure.stiffness_matrix - (rows.T * [slider.spring for slider in bearings]) @ rows
    slabs = np.abs(rows).argmax(axis=1)
    isolated = np.ix_(*2 * [np.isin(structure.buildings, structure.buildings[slabs])])
    period = longest_period(structure.mass_matrix[isolated], sliding[isolated])
    return period if period < math.inf else None


def _key(name: str) -> str:
    return f"building.isolation.{name}"
