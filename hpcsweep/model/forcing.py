r"""The forcing G(tau) that shakes a structure, as the output of a linear system of its own.

A forcing is the output G = A c . s of a small state vector s, which obeys s' = B s between the
times at which it changes. Together with the structure, M u'' + C u' + K u + ... = b G, that is one
linear system, whose propagators are exact whatever B is. A solver needs four things: the generator
B, the output row c, the state s at a time, and the period, if there is one.

Harmonics, G = A sum_h a_h sin(h Omega tau + phi_h), have a rotating pair of sine and cosine each::

    s_h = a_h (sin(h Omega tau + phi_h), cos(h Omega tau + phi_h)),  B_h = h Omega [[0, 1], [-1, 0]]
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hpcsweep.model.arguments import finite, number, refused, shown
from hpcsweep.model.matrices import vector

MAX_HARMONICS = 16
MAX_ORDER = 1000
MAX_PHASE = 1000.0
"""Beyond it radians are degrees, or angles lose digits."""
TERM = ("order", "amplitude", "phase")
ONE_HARMONIC = ((1, 1.0, 0.0),)
"""sin(Omega tau)"""


class Forcing(Protocol):
    """Interface of a forcing at a frequency Omega; see the module."""

    def period(self, omega: float, n_periods: int = 1) -> float | None:
        """Return the duration of `n_periods` periods; None if the forcing is not periodic."""
        ...

    def generator(self, omega: float) -> np.ndarray:
        """Return B, shape (k, k)."""
        ...

    def output(self) -> np.ndarray:
        """Return c, shape (k,)."""
        ...

    def state(self, tau: float, omega: float) -> np.ndarray:
        """Return s at a time, shape (k,)."""
        ...

    def changes(self, omega: float) -> np.ndarray:
        """Return the times within a period, ascending, at which s jumps or B changes."""
        ...


@dataclass(frozen=True)
class Harmonics:
    """A sum of harmonics, a `Forcing`, from anything that `read_harmonics` accepts.

    Attributes
    ----------
    terms : tuple of (int, float, float)
        Order, amplitude and phase of each.
    """

    terms: tuple[tuple[int, float, float], ...] = ONE_HARMONIC

    @property
    def size(self) -> float:
        """Upper bound of |G| at A = 1."""
        return sum(abs(amplitude) for _, amplitude, _ in self.terms)

    def period(self, omega: float, n_periods: int = 1) -> float:
        """Return the duration of `n_periods` periods of order 1, whatever the orders."""
        return n_periods * 2 * math.pi / omega

    def generator(self, omega: float) -> np.ndarray:
        """Return B, shape (2H, 2H)."""
        found = np.zeros((2 * len(self.terms), 2 * len(self.terms)))
        for h, (order, _, _) in enumerate(self.terms):
            found[2 * h, 2 * h + 1] = order * omega
            found[2 * h + 1, 2 * h] = -order * omega
        return found

    def output(self) -> np.ndarray:
        """Return c, shape (2H,): the sines."""
        return np.tile([1.0, 0.0], len(self.terms))

    def state(self, tau: float, omega: float) -> np.ndarray:
        """Return s at a time, shape (2H,)."""
        found = []
        for order, amplitude, phase in self.terms:
            angle = order * omega * tau + phase
            found += [amplitude * math.sin(angle), amplitude * math.cos(angle)]
        return np.array(found)

    def changes(self, omega: float) -> np.ndarray:
        """Return no times: harmonics are smooth."""
        del omega
        return np.empty(0)


def read_harmonics(given: Any) -> tuple[tuple[int, float, float], ...]:
    """Validate the harmonics (order, amplitude, phase) of the forcing, a row each."""
    if isinstance(given, str | bytes) or not isinstance(given, Sequence | np.ndarray):
        raise ValueError(
            f"harmonics must be a list of (order, amplitude, phase), is {shown(given)}"
        )
    if not 1 <= len(given) <= MAX_HARMONICS:
        raise ValueError(f"harmonics must be 1 to {MAX_HARMONICS}, are {len(given)}")
    found = []
    for entry in given:
        order, amplitude, phase = vector("harmonics", entry, 3, "numbers each", TERM)
        if not order.is_integer() or not 1 <= order <= MAX_ORDER:
            limit = f"a whole number from 1 to {MAX_ORDER}"
            raise refused("harmonics.order", limit, entry[0])
        largest = f"finite, of a size up to {MAX_PHASE:g}"
        phase = number("harmonics.phase", phase, largest, -MAX_PHASE, MAX_PHASE)
        found.append((int(order), finite("harmonics.amplitude", amplitude), phase))
    orders = [order for order, _, _ in found]
    if len(set(orders)) < len(orders):
        raise ValueError(f"harmonics.order must not hold a value twice, is {orders}")
    return tuple(found)
