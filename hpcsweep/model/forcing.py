"""The forcing G(tau) = A sum_h a_h sin(h Omega tau + phi_h) that shakes a structure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True)
class Harmonics:
    """A sum of harmonics, from anything that `read_harmonics` accepts.

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
