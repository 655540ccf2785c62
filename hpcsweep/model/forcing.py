"""The forcing G(tau) = A sum_h a_h sin(h Omega tau + phi_h) that shakes a structure.

Its mean A a_0 is the harmonic of order 0, with phi_0 = pi / 2.
"""

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.model.arguments import finite, items, number, refused, wrong
from hpcsweep.model.vectors import vector

MAX_HARMONICS = 16
MAX_ORDER = 1000
MAX_PHASE = 1000.0
"""Beyond it radians are degrees, or angles lose digits."""
MEAN_PHASE = math.pi / 2
"""Of the harmonic of order 0, sin(phi) = 1; and of a cosine."""
ROUNDING = 1e-13
"""Share of the largest sample below which a harmonic of samples is none."""
TERM = ("order", "amplitude", "phase")
Terms = tuple[tuple[int, float, float], ...]
"""Order, amplitude and phase of each harmonic."""
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

    terms: Terms = ONE_HARMONIC

    @property
    def size(self) -> float:
        """Upper bound of |G| at A = 1."""
        return sum(abs(amplitude) for _, amplitude, _ in self.terms)

    def period(self, omega: float, n_periods: int = 1) -> float:
        """Return the duration of `n_periods` periods of order 1, whatever the orders."""
        return n_periods * 2 * math.pi / omega


def read_harmonics(harmonics: Any) -> Terms:
    """Validate the harmonics (order, amplitude, phase) of the forcing, a row each."""
    harmonics = items("harmonics", harmonics, "a list of (order, amplitude, phase)")
    if not 1 <= len(harmonics) <= MAX_HARMONICS:
        raise wrong("harmonics", f"must be 1 to {MAX_HARMONICS}, are {len(harmonics)}")
    terms = []
    for entry in harmonics:
        order, amplitude, phase = vector("harmonics", entry, 3, "numbers each", TERM)
        if not order.is_integer() or not 0 <= order <= MAX_ORDER:
            limit = f"a whole number from 0 to {MAX_ORDER}"
            tori = ": frequencies without a common period are not offered"
            raise refused("harmonics.order", limit + tori * (not order.is_integer()), entry[0])
        if order == 0 and phase != MEAN_PHASE:
            raise refused("harmonics.phase", "pi / 2 at order 0, the mean", entry[2])
        largest = f"finite, of a size up to {MAX_PHASE:g}"
        phase = number("harmonics.phase", phase, largest, -MAX_PHASE, MAX_PHASE)
        terms.append((int(order), finite("harmonics.amplitude", amplitude), phase))
    orders = [order for order, _, _ in terms]
    if len(set(orders)) < len(orders):
        raise wrong("harmonics.order", f"must not hold a value twice, is {orders}")
    if orders == [0]:
        raise wrong("harmonics.order", "must hold one above 0: a mean alone has no period")
    return tuple(terms)


def fourier_series(samples: np.ndarray, n_harmonics: int) -> tuple[Terms, float]:
    """Return the mean and the first harmonics of N samples at the times k T / N, shape (N,).

    And the largest difference of these to the samples, in units of the largest of the samples.
    Terms of the size of rounding are left out, and those of N / 2 and more, which samples do not
    tell apart. `samples` must not all be equal.
    """
    size = len(samples)
    coefficients = np.fft.rfft(samples)[: min(n_harmonics, (size - 1) // 2) + 1] / size
    coefficients[1:] *= 2
    largest = np.abs(samples).max()
    kept = np.flatnonzero(np.abs(coefficients) > ROUNDING * largest)
    left = np.zeros(size // 2 + 1, complex)
    left[kept] = coefficients[kept] * np.where(kept > 0, size / 2, size)
    error = float(np.abs(np.fft.irfft(left, size) - samples).max() / largest)
    terms = [
        (order, float(abs(coefficients[order])), cmath.phase(1j * coefficients[order]))
        for order in kept.tolist()
        if order
    ]
    mean = [(0, float(coefficients[0].real), MEAN_PHASE)] if 0 in kept else []
    return (*mean, *terms), error
