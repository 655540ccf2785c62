r"""Separation of two buildings that code rules ask for, from the peaks of each alone.

With u_1 and u_2 the peak displacements of two floors that face each other, the rules are

    ABS   u_1 + u_2,      SRSS   sqrt(u_1^2 + u_2^2),      DDC   sqrt(u_1^2 + u_2^2 - 2 r u_1 u_2).

The double difference combination takes r, the correlation of the displacements of two oscillators
under the same white noise, of frequencies w_i and damping ratios z_i, q = w_1 / w_2 = T_2 / T_1,

    r = 8 sqrt(z_1 z_2) (q z_1 + z_2) q^(3/2)
        / ((1 - q^2)^2 + 4 z_1 z_2 q (1 + q^2) + 4 (z_1^2 + z_2^2) q^2),

that of the complete quadratic combination: of a difference, so that its sign is the other one.
Of what yields w_i and z_i may be effective ones. Those published are fitted to oscillators, by a
ductility; a building has one for each storey, so that figures keep the elastic ones, and say so.
"""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import array, refused

TINY = float(np.finfo(float).tiny)


class Separation(NamedTuple):
    """Gaps by which two floors do not touch, by three rules; arrays of one shape."""

    absolute: np.ndarray
    """Sum of both peaks: always enough."""
    srss: np.ndarray
    """Square root of the sum of squares."""
    ddc: np.ndarray
    """Double difference combination."""


def separation(
    peak: Any,
    other_peak: Any,
    period: Any,
    other_period: Any,
    damping_ratio: Any = 0.05,
    other_ratio: Any = None,
) -> Separation:
    """Return the separation of two floors by the rules ABS, SRSS and DDC.

    Parameters
    ----------
    peak, other_peak : array_like
        Peak displacements of the floors that face each other, at least 0, in any unit.
    period, other_period : array_like
        Longest natural period of each building alone, above 0.
    damping_ratio, other_ratio : array_like
        Damping ratios of these modes, above 0 and below 1; one stands for both.

    Returns
    -------
    Separation
        Three arrays, of the shape to which the arguments broadcast.

    Raises
    ------
    ValueError
        If an argument is outside its range, or shapes do not fit.

    References
    ----------
    Der Kiureghian, Earthquake Engineering & Structural Dynamics 9 (1981) 419; Jeng, Kasai and
    Maison, Earthquake Spectra 8 (1992) 201. SRSS: Eurocode 8, 4.4.2.7; ASCE 7, 12.12.3.

    Examples
    --------
    Twins move together, buildings of periods far apart independently:

    >>> same = hpcsweep.separation(0.3, 0.4, 1.0, 1.0)
    >>> [round(float(gap), 6) for gap in same]
    [0.7, 0.5, 0.1]
    >>> apart = hpcsweep.separation(0.3, 0.4, period=0.2, other_period=[0.4, 2.0])
    >>> apart.ddc.round(4)
    array([0.4955, 0.4998])
    """
    u, other = _above("peak", peak, 0.0), _above("other_peak", other_peak, 0.0)
    q = _above("other_period", other_period) / _above("period", period)
    z = _above("damping_ratio", damping_ratio, below=1.0)
    y = z if other_ratio is None else _above("other_ratio", other_ratio, below=1.0)
    below = (1 - q**2) ** 2 + 4 * z * y * q * (1 + q**2) + 4 * (z**2 + y**2) * q**2
    r = 8 * np.sqrt(z * y) * (q * z + y) * q**1.5 / below
    squares = u**2 + other**2 + 0.0 * r
    difference = np.maximum(squares - 2 * r * u * other, 0.0)
    return Separation(u + other + 0.0 * r, np.sqrt(squares), np.sqrt(difference))


def _above(name: str, value: Any, least: float = TINY, below: float = np.inf) -> np.ndarray:
    """Return numbers of any shape within limits."""
    numbers = array(name, value)
    if not np.all((numbers >= least) & (numbers < below)):
        limit = "finite and at least 0" if least == 0.0 else "above 0 and finite"
        raise refused(name, "above 0 and below 1" if below == 1.0 else limit, value)
    return numbers
