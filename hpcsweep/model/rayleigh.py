"""Rayleigh damping C = alpha M + beta K, by alpha and beta, or by a ratio at two frequencies.

A mode of the frequency w has the ratio (alpha / w + beta w) / 2. It is zeta at w and at v where

    alpha = 2 zeta w v / (w + v),    beta = 2 zeta / (w + v) ;

between the two it is less, beyond them more (Chopra, *Dynamics of Structures*, ch. 11).
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import count, not_negative, number, positive, refused, wrong
from hpcsweep.model.vectors import vector

FORM = "(alpha, beta), or ratio and modes, or ratio and periods"


class Rayleigh(NamedTuple):
    """A damping ratio, and the two modes, from 1, or the two periods, that have it."""

    ratio: float
    modes: tuple[int, int] | None = None
    periods: tuple[float, float] | None = None

    def factors(self, frequencies: np.ndarray) -> tuple[float, float]:
        """Return alpha and beta, from the natural frequencies of the structure, ascending."""
        if self.periods is not None:
            w, v = (2.0 * math.pi / period for period in self.periods)
        else:
            w, v = (float(frequencies[mode - 1]) for mode in self.modes or ())
        return 2.0 * self.ratio * w * v / (w + v), 2.0 * self.ratio / (w + v)


def read_rayleigh(name: str, damping: Any, n: int) -> tuple[float, float] | Rayleigh | None:
    """Read an argument that gives Rayleigh damping of n modes.

    Raises
    ------
    ValueError
    """
    if isinstance(damping, Rayleigh):
        damping = {key: value for key, value in damping._asdict().items() if value is not None}
    if damping is None:
        return None
    if not isinstance(damping, Mapping):
        alpha, beta = vector(name, damping, 2, "numbers: alpha, beta", read=not_negative)
        return alpha, beta
    for key in damping:
        if key not in Rayleigh._fields:
            raise wrong(name, f"must be {FORM}, has {key!r}")
    if "ratio" not in damping or ("modes" in damping) == ("periods" in damping):
        raise refused(name, FORM, dict(damping))
    ratio = number(f"{name}.ratio", damping["ratio"], "from 0 to 1, a share of critical", 0.0, 1.0)
    if "periods" in damping:
        return Rayleigh(ratio, periods=_two(f"{name}.periods", damping["periods"], positive))
    modes = _two(f"{name}.modes", damping["modes"], lambda key, mode: count(key, mode, 1, n))
    return Rayleigh(ratio, modes)


def _two(name: str, value: Any, read: Any) -> Any:
    """Read two different values."""
    pair = vector(name, value, 2, "numbers", read=read)
    if pair[0] == pair[1]:
        raise wrong(name, f"must differ, are both {pair[0]:g}")
    return pair
