"""Sliders: springs that yield, slip or degrade."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hpcsweep.model.arguments import finite, number, positive, refused, wrong
from hpcsweep.model.backbone import Backbone, read_backbone
from hpcsweep.model.flags import flag_modes
from hpcsweep.model.vectors import Vector, direction_of, vector

MAX_LABEL = 100
"""Characters of a name."""


@dataclass(frozen=True)
class Slider:
    """A spring in series with a slider, which slips where the force reaches its strength.

    The force is k (d - p), d = b . u, with |k (d - p)| <= F; while it slips p follows d, so that
    F stays. Rest is p = 0. Beside an elastic spring of stiffness alpha k0 a slider with k =
    (1 - alpha) k0 and F = (1 - alpha) f_y makes a bilinear spring of initial stiffness k0 that
    yields at the force f_y, with kinematic hardening; several in parallel, any backbone. See
    `hpcsweep.model.elements`. Units are those of the structure that it belongs to.

    Parameters
    ----------
    direction : sequence of n floats, str, int or dict
        b: the displacement that lengthens it by 1, not 0; of a model as that of a `Contact`.
    stiffness : float
        k > 0.
    strength : float
        F > 0.
    name : str, optional
    kinetic : float, optional
        Force with which it slips, above 0 and at most F, at which it begins to; F unless given.
    returns : float, optional
        Force R, from 0 to below F, at which p slips back to 0, see `hpcsweep.model.flags`.
    backbone : Backbone or dict, optional
        In place of these: what its force is beyond F, and how it degrades.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    References
    ----------
    Iwan, Journal of Applied Mechanics 33 (1966) 893, of several in parallel.

    Examples
    --------
    The second of two storeys yields at a drift of 20 mm:

    >>> slider = hpcsweep.Slider(direction=(-1.0, 1.0), stiffness=1e7, strength=2e5)
    >>> slider.strength / slider.stiffness
    0.02
    """

    direction: Vector
    stiffness: float
    strength: float
    name: str | None = None
    kinetic: float | None = field(default=None, metadata={"later": True})
    returns: float | None = field(default=None, metadata={"later": True})
    backbone: Backbone | None = field(default=None, metadata={"later": True})

    def __post_init__(self) -> None:
        direction = direction_of("slider.direction", self.direction, "such a slider is never moved")
        object.__setattr__(self, "direction", direction)
        for name in ("stiffness", "strength"):
            object.__setattr__(self, name, positive(f"slider.{name}", getattr(self, name)))
        kinetic = "kinetic", "above 0, and at most", math.ulp(0.0), self.strength
        returns = "returns", "from 0 to below", 0.0, math.nextafter(self.strength, 0.0)
        for name, limit, least, most in (kinetic, returns):
            if (value := getattr(self, name)) is not None:
                limits = f"{limit} strength, {self.strength:g}", least, most
                object.__setattr__(self, name, number(f"slider.{name}", value, *limits))
        rules = [
            name for name in ("returns", "kinetic", "backbone") if getattr(self, name) is not None
        ]
        if len(rules) > 1:
            raise wrong(f"slider.{rules[0]}", f"and {rules[1]} must not be given both")
        object.__setattr__(self, "backbone", read_backbone("slider.backbone", self.backbone))
        if self.backbone is not None and self.backbone.theta_u <= self.limit:
            limit = f"above the elongation at which it yields, {self.limit:.6g}"
            raise refused("slider.backbone.theta_u", limit, self.backbone.theta_u)
        name = self.name if isinstance(self.name, str) else ""
        if self.name is not None and not (name.isprintable() and 0 < len(name) <= MAX_LABEL):
            limit = f"a text of up to {MAX_LABEL} characters that can be printed"
            raise refused("slider.name", limit, self.name)

    @property
    def spring(self) -> float:
        """Stiffness that K has of it in its first mode."""
        return self.stiffness

    @property
    def limit(self) -> float:
        """Elongation F / k at which it first slips."""
        return self.strength / self.stiffness

    @property
    def softest(self) -> float:
        """Least stiffness that it has."""
        one = self.backbone
        if one is None:
            return 0.0
        return -(self.strength + one.hardening * self.stiffness * one.theta_p) / one.theta_pc

    def path(self, elongations: Sequence[float]) -> np.ndarray:
        """Return the forces of one with a backbone along a path between elongations, from rest.

        Examples
        --------
        It yields at 1, is capped at 3, and has lost half of its strength at 5:

        >>> backbone = hpcsweep.Backbone(theta_p=2.0, theta_pc=4.0)
        >>> slider = hpcsweep.Slider((1.0,), stiffness=2.0, strength=2.0, backbone=backbone)
        >>> slider.path([0.5, 3.0, 5.0, 4.5])
        array([1., 2., 1., 0.])
        """
        from hpcsweep.model.degrading import along  # reading jobs needs no kernels

        if self.backbone is None:
            raise wrong("slider.backbone", "is missing: others have no memory")
        elongations = vector("elongations", elongations, None, read=finite)
        return self.stiffness * np.array(along(np.array(self.memory(1.0)), elongations))

    def memory(self, length: float) -> list[float]:
        """Return what it carries from rest besides p, see `hpcsweep.model.backbone.Backbone`."""
        backbone = self.backbone and self.backbone.measured_by(length)
        return backbone.memory(self.limit / length) if backbone else []

    @property
    def slips(self) -> float:
        """Force with which it slips."""
        return self.strength if self.kinetic is None else self.kinetic

    @property
    def shares(self) -> tuple[float, float]:
        """Energy that it takes for each unit of its path, and holds for each of p."""
        back = -self.slips if self.returns is None else self.returns
        return 0.5 * (self.slips - back), 0.5 * (self.slips + back)

    @property
    def lost(self) -> float:
        """Energy (F - F_k)^2 / 2 k that it takes besides F_k times its path, when it slips."""
        return (self.strength - self.slips) ** 2 / (2.0 * self.stiffness)

    @property
    def taken(self) -> float:
        """Stiffness that its bit takes out of that matrix, and unit of its loads."""
        return self.stiffness

    def modes(self, bit: int, length: float) -> list[tuple[tuple, list[tuple]]]:
        """Return its modes with their guards, see `hpcsweep.model.elements`.

        Of each mode past, key, and the load, a constant and the share of p; of each guard the mode
        to which it leads, s, a, b, c, r, and where p is taken 1 and the shift.

        Parameters
        ----------
        bit : int
            Of the key, where it slips.
        length : float
            Unit of length.
        """
        limit, delta = self.limit / length, self.slips / self.stiffness / length
        up = (0, -1.0, 0.0, 1.0 / limit, 0.0, 0.0, 1.0, -delta)
        down = (0, 1.0, 0.0, 1.0 / limit, 0.0, 0.0, 1.0, delta)
        sticks = [(1, 1.0, 1.0, 0.0, limit, 1.0), (2, -1.0, 1.0, 0.0, -limit, 1.0)]
        if self.backbone is not None:
            return self.backbone.modes(1 << bit)
        if self.returns is not None:
            return flag_modes(1 << bit, limit, self.returns / self.stiffness / length)
        return [
            ((0, 0, 0.0, 1.0), sticks),
            ((0, 1 << bit, -delta, 0.0), [up]),
            ((0, 1 << bit, delta, 0.0), [down]),
        ]


def storey_sliders(
    stiffness: Sequence[float],
    yield_force: Any,
    yield_drift: Any,
    hardening: Any,
    flag_height: Any,
    backbones: Sequence[Backbone | None],
) -> tuple[Slider, ...]:
    """Return the sliders of the storeys that yield, named by the number of the storey.

    A storey of stiffness k keeps the elastic spring alpha k; the slider has the rest of k, and of
    the force at which the storey yields 1 - alpha. One with a backbone is all slider.

    Parameters
    ----------
    stiffness : sequence of n floats
        Of the storeys, from the lowest on.
    yield_force, yield_drift, hardening, flag_height, backbones
        Of `hpcsweep.model.structure.Structure`.

    Raises
    ------
    ValueError
        If they do not go together; the message names one.
    """
    n, by_force = len(stiffness), yield_force is not None
    if by_force and yield_drift is not None:
        raise wrong("yield_force", "and yield_drift must not be given both")
    shares, flags = (np.broadcast_to(each, n).tolist() for each in (hardening, flag_height))
    if not by_force and yield_drift is None:
        for key, given in ("hardening", shares), ("flag_height", flags), ("backbone", backbones):
            if any(given):
                raise wrong(key, "goes with yield_force or yield_drift")
        return ()
    forces = np.broadcast_to(yield_force if by_force else np.multiply(yield_drift, stiffness), n)
    steps = (np.eye(n) - np.eye(n, k=-1)).tolist()
    if any(k == 0.0 and force < math.inf for k, force in zip(stiffness, forces, strict=True)):
        raise wrong("storey_stiffness", "must be above 0 of a storey that yields")
    storeys = zip(steps, stiffness, shares, flags, forces.tolist(), backbones, strict=True)
    sliders = []
    for i, (row, k, share, flag, force, backbone) in enumerate(storeys, 1):
        if backbone is not None and flag:
            raise wrong("flag_height", "and backbone must not be given both")
        if backbone is not None:
            backbone, share = replace(backbone, hardening=share), 0.0
        strength = (1.0 - share) * force
        back = (1.0 - flag) * strength if flag else None
        if force < math.inf:
            spring, rules = (1.0 - share) * k, {"returns": back, "backbone": backbone}
            sliders.append(Slider(tuple(row), spring, strength, str(i), **rules))
    return tuple(sliders)
