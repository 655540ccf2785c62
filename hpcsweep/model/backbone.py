"""Backbones of sliders that degrade: capping, residual strength, and what cycles take away."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from hpcsweep.model.arguments import number, refused, wrong
from hpcsweep.model.vectors import listed

SIZE = 37
"""Of the memory of a slider, see `hpcsweep.model.degrading`."""
RULES = BILINEAR, PEAK_ORIENTED, PINCHING = "bilinear", "peak-oriented", "pinching"
ABOVE_0 = math.ulp(0.0), math.inf
LIMITS = {
    "theta_p": ("above 0", *ABOVE_0),
    "theta_pc": ("above 0", *ABOVE_0),
    "theta_u": ("above 0 (inf: none)", *ABOVE_0),
    "residual": ("from 0 to below 1", 0.0, math.nextafter(1.0, 0.0)),
    "hardening": ("from 0 to below 1", 0.0, math.nextafter(1.0, 0.0)),
    "Lambda": ("above 0 (inf: none)", *ABOVE_0),
    "kappa_f": ("above 0, to 1", math.ulp(0.0), 1.0),
    "kappa_d": ("from 0 to below 1", 0.0, math.nextafter(1.0, 0.0)),
}
"""Words, least and most of each number."""
LENGTHS = "theta_p", "theta_pc", "theta_u", "Lambda"


@dataclass(frozen=True)
class Backbone:
    """The force of a slider beyond yielding, and how it comes back and degrades.

    The modified model of Ibarra, Medina and Krawinkler, see `hpcsweep.model.degrading`. Along a
    first loading the force rises from the strength F, with the part `hardening` of the stiffness
    k, over `theta_p` to the capping force F_c, and falls over `theta_pc` towards 0, but not below
    `residual` F. All force is lost at the elongation `theta_u`, where no residual strength is left,
    and where the energy Lambda F has been dissipated.

    Parameters
    ----------
    theta_p, theta_pc : float
        Plastic elongation from yielding to capping, and from capping to where the falling branch
        would reach 0; in the unit of the elongation: rotations of papers times the storey height.
    theta_u : float
    residual : float
        Over F, from 0 to below 1.
    hardening : float
        Over k, from 0 to below 1; that of a storey in a building.
    rule : str
        How it loads again: "bilinear", with kinematic hardening; "peak-oriented", towards the
        largest elongation so far, or that of the last cycle; "pinching", there by way of a point.
    Lambda : float
        Energy over F that strength, capping and unloading stiffness have until nothing is left;
        inf: they do not deteriorate.
    kappa_f, kappa_d : float, optional
        Of pinching: force of that point over the one on the line to the largest elongation, and
        part of the elongation that would be left after it by which the point is before that.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    References
    ----------
    Ibarra, Medina and Krawinkler, Earthquake Engineering & Structural Dynamics 34 (2005) 1489;
    Lignos and Krawinkler, Journal of Structural Engineering 137 (2011) 1291.

    Examples
    --------
    >>> hpcsweep.Backbone(theta_p=0.06, theta_pc=0.2, Lambda=1.2).rule
    'bilinear'
    """

    theta_p: float
    theta_pc: float
    theta_u: float = math.inf
    residual: float = 0.0
    hardening: float = 0.0
    rule: str = BILINEAR
    Lambda: float = math.inf
    kappa_f: float | None = None
    kappa_d: float | None = None

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise refused("backbone.rule", f"one of {', '.join(RULES)}", self.rule)
        for name, limits in LIMITS.items():
            value = getattr(self, name)
            if name.startswith("kappa") and (self.rule == PINCHING) != (value is not None):
                goes = "is missing: pinching needs it" if value is None else "goes with pinching"
                raise wrong(f"backbone.{name}", goes)
            if value is not None:
                object.__setattr__(self, name, number(f"backbone.{name}", value, *limits))

    def __str__(self) -> str:
        numbers = ((name, getattr(self, name)) for name in LIMITS)
        told = [f"{name} {value:g}" for name, value in numbers if value not in (None, math.inf)]
        return ", ".join((self.rule, *told))

    def measured_by(self, length: float) -> "Backbone":
        """Return it with its lengths in another unit."""
        return replace(self, **{name: getattr(self, name) / length for name in LENGTHS})

    def memory(self, limit: float) -> list[float]:
        """Return what a slider that yields at `limit` carries from rest, see `degrading`."""
        from hpcsweep.model import degrading  # reading results needs no kernels

        d, capping = limit, limit + self.hardening * self.theta_p
        fall = capping / self.theta_pc
        memory = [0.0] * SIZE
        for place, value in (
            (degrading.LOW, -d),
            (degrading.HIGH, d),
            (degrading.SLOPE, 1.0),
            (degrading.UNLOADS, 1.0),
            (degrading.RULE, RULES.index(self.rule)),
            (degrading.YIELD, d),
            (degrading.ULTIMATE, self.theta_u),
            (degrading.FLOOR, self.residual * d),
            (degrading.FALL, fall),
            (degrading.ENERGY, self.Lambda * d),
            (degrading.KAPPA_F, self.kappa_f or 0.0),
            (degrading.KAPPA_D, self.kappa_d or 0.0),
        ):
            memory[place] = value
        own = d, self.hardening, capping + fall * (d + self.theta_p), d, d, d, d
        for side in degrading.SIDES:
            memory[side : side + len(own)] = own
        return memory

    @staticmethod
    def modes(bit: int) -> list[tuple[tuple, list[tuple]]]:
        """Return the modes of a slider that degrades, see `hpcsweep.model.slider.Slider.modes`.

        Held between two elongations, with k or less, going up or down, and without force; and held
        where it rises from G = 0, of which the largest force is known by where it comes to rest.
        """
        from hpcsweep.model.degrading import HIGH, LOW

        high, low = (
            (0, s, 1.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, at) for s, at in ((1.0, HIGH), (-1.0, LOW))
        )
        stops = [(0, s, 0.0, 1.0, 0.0, 0.0, -1.0) for s in (-1.0, 1.0)]
        own = (0, bit, 0.0, 1.0)
        return [
            ((0, 0, 0.0, 1.0), [high, low]),
            (own, [high, low]),
            (own, [high, stops[0]]),
            (own, [low, stops[1]]),
            (own, []),
            (own, [high, low, stops[0]]),
            (own, [high, low, stops[1]]),
        ]


PARAMETERS = [field.name for field in fields(Backbone)]


def read_backbone(name: str, value: Any) -> Backbone | None:
    """Read a backbone, or a table of its parameters."""
    if not isinstance(value, Mapping):
        if value is not None and not isinstance(value, Backbone):
            raise refused(name, "a Backbone, or a table of its parameters", value)
        return value
    for key in value:
        if key not in PARAMETERS:
            raise wrong(name, f"must not have {key!r}")
    for key in PARAMETERS[:2]:
        if key not in value:
            raise wrong(f"{name}.{key}", "is missing")
    return Backbone(**value)


def read_backbones(name: str, value: Any, n: int) -> tuple[Backbone | None, ...]:
    """Read those of n storeys: one for all, a table whose values may be lists, or a list."""
    if isinstance(value, Mapping):
        columns = {key: listed(one) for key, one in value.items()}
        for key, column in columns.items():
            if column is not None and len(column) != n:
                limit = f"must have {n} numbers, one per storey, has {len(column)}"
                raise wrong(f"{name}.{key}", limit)
        value = [
            {key: value[key] if column is None else column[i] for key, column in columns.items()}
            for i in range(n)
        ]
    each = [value] * n if (entries := listed(value)) is None else entries
    if len(each) != n:
        raise wrong(name, f"must have {n} entries, one per storey, has {len(each)}")
    read = tuple(read_backbone(name, one) for one in each)
    if any(one is not None and one.hardening for one in read):
        raise wrong(f"{name}.hardening", "is given by the hardening of the storey")
    return read
