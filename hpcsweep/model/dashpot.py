r"""Contacts with a dashpot (Kelvin-Voigt), and the coefficient of restitution of a collision.

At a distance x past its stop a contact pushes with F = kappa x + c x'. When it lets go there are
two rules, each a function of x and x' alone:

- with tension F acts until x = 0: on the way out it may pull;
- without, F = max(0, kappa x + c x') while x > 0: it never pulls, lets go beyond the stop where
  kappa x + c x' falls to 0, and pushes again, before x is 0, if that grows above 0.

One collision of a mass m that arrives with the speed v, alone: with omega^2 = kappa / m,
xi = c / (2 sqrt(kappa m)) and s = sqrt(1 - xi^2),

    x = v / (s omega) exp(-xi omega t) sin(s omega t).

With tension it leaves at s omega t = pi, with the speed e v, e = exp(-pi xi / s), so that

    xi = -ln e / sqrt(pi^2 + ln^2 e)

(Anagnostopoulos, Earthquake Eng. Struct. Dyn. 16 (1988) 443). Without, it leaves where x'' = 0,
which with xi = sin a is tan(s omega t) = -tan(2 a), s omega t = pi - 2 a, and

    e = exp(-(xi / s) (pi - 2 asin xi)),

with b = arcosh(xi) beyond critical damping exp(-2 b coth b): any e from 1 to 0, e^-2 at xi = 1. It
falls with xi, so that the xi of a given e is found by bisection. The mass of a collision in a
structure is that which the contact feels, m = 1 / (d . M^-1 d), all else at rest.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hpcsweep.model.arguments import number, wrong
from hpcsweep.model.modes import per_mass

MIN_RESTITUTION = 1e-6
"""A millionth of the speed: nothing bounces any more."""


def read_restitution(name: str, value: Any) -> float:
    """Read a coefficient of restitution, above 0 and at most 1."""
    return number(name, value, f"from {MIN_RESTITUTION:g} to 1", MIN_RESTITUTION, 1.0)


def refuse_smooth(contacts: Sequence, sharpness: float, said_by: tuple[str, Any] | None) -> None:
    """Refuse a dashpot behind a smooth stop, whose switch would multiply the whole force.

    `said_by` is by which name and value it was given; without it by the contact's damping.
    """
    damping = max((contact.damping for contact in contacts), default=0.0)
    if damping and sharpness != math.inf:
        name, value = said_by or ("contact.damping", damping)
        limit = f"= {value!r} needs sharpness = inf: a dashpot goes with a sharp stop"
        raise wrong(name, f"{limit}, sharpness is {sharpness:g}")


def restitution_of(ratio: float) -> float:
    """Return the restitution e at the damping ratio xi >= 0 of a contact that does not pull."""
    if ratio == 0.0:
        return 1.0
    if ratio < 1.0:
        return math.exp(-2.0 * ratio * math.acos(ratio) / math.sqrt(1.0 - ratio * ratio))
    if ratio == 1.0:
        return math.exp(-2.0)
    b = math.acosh(ratio)
    return math.exp(-2.0 * b / math.tanh(b))


def ratio_of_restitution(restitution: float, tension: bool = False) -> float:
    """Return the damping ratio xi of a collision with the coefficient of restitution e.

    Raises
    ------
    ValueError
        If it is below `MIN_RESTITUTION` or above 1.
    """
    e = read_restitution("restitution", restitution)
    if e == 1.0:
        return 0.0
    logarithm = -math.log(e)
    if tension:
        return logarithm / math.hypot(math.pi, logarithm)
    low, high = 0.0, 1.0
    while restitution_of(high) > e:
        low, high = high, 2.0 * high
    while low < (middle := 0.5 * (low + high)) < high:
        if restitution_of(middle) > e:
            low = middle
        else:
            high = middle
    return high


def felt_mass(direction: Any, mass: np.ndarray) -> float:
    """Return 1 / (d . M^-1 d), the mass that a contact feels; M may be its diagonal."""
    masses = np.asarray(mass, float)
    d = np.asarray(direction, float)
    return 1.0 / float(d @ per_mass(np.diag(masses) if masses.ndim == 1 else masses, d))


def damping_of_restitution(
    restitution: float, stiffness: float, felt: float, tension: bool = False
) -> float:
    """Return c = 2 xi sqrt(kappa m) of a contact that feels the mass m = `felt`."""
    return 2.0 * ratio_of_restitution(restitution, tension) * math.sqrt(stiffness * felt)
