"""Multilinear springs: force over elongation by a table, each change of slope a contact.

With the slope k_0 from 0 on and the points (d_i, F_i) the force along an elongation d = b . u is

    F(d) = k_0 d + sum_i kappa_i max(s_i (d - d_i), 0) s_i,    s_i = 1 for d_i > 0, else -1,

kappa_i the slope beyond d_i less the one before it, seen from 0: below 0 where the spring softens.
So k_0 b b^T joins K, and each point is a sharp contact in the direction s_i b with the gap |d_i|.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.model.arguments import finite, items, wrong
from hpcsweep.model.matrices import Contact
from hpcsweep.model.vectors import Vector, matrix, vector

SAME = 1e-12
"""Part of the largest slope by which slopes on both sides of a point differ."""


class Kink(Contact):
    """A change of slope of a spring, of either sign."""

    def _read_stiffness(self) -> float:
        return finite("spring.table", self.stiffness)


@dataclass(frozen=True)
class Spring:
    """A spring whose force is linear between the points of a table, and goes on beyond them.

    Parameters
    ----------
    direction : sequence of n floats
        b: the displacement that lengthens it by 1, not 0.
    table : sequence of (d, F)
        Elongations, ascending, with the force at each; from (0, 0) on that of an odd spring, else
        through (0, 0).

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it.

    Examples
    --------
    It softens beyond 1, and hardens beyond 2:

    >>> spring = hpcsweep.Spring((1.0,), [(0.0, 0.0), (1.0, 2.0), (2.0, 2.5), (3.0, 6.5)])
    >>> [(kink.gap, kink.stiffness) for kink in spring.kinks]
    [(1.0, -1.5), (2.0, 3.5), (1.0, -1.5), (2.0, 3.5)]
    """

    direction: Vector
    table: tuple[Vector, ...]

    def __post_init__(self) -> None:
        direction = vector("spring.direction", self.direction, None, read=finite)
        if not any(direction):
            raise wrong("spring.direction", "must not be 0: such a spring is never moved")
        object.__setattr__(self, "direction", direction)
        points = np.array(matrix("spring.table", self.table, (None, 2)))
        if points[0, 0] == 0.0:
            points = np.vstack((-points[:0:-1], points))
        d, force = points.T
        if len(points) < 2 or np.any(np.diff(d) <= 0.0):
            raise wrong("spring.table", "must have at least 2 points whose elongations ascend")
        at_rest = float(np.interp(0.0, d, force))
        if not d[0] < 0.0 < d[-1] or abs(at_rest) > SAME * np.abs(force).max():
            raise wrong("spring.table", "must begin at (0, 0), or pass through it")
        object.__setattr__(self, "table", tuple(map(tuple, points.tolist())))

    @property
    def slopes(self) -> np.ndarray:
        """Of each part."""
        d, force = np.array(self.table).T
        return np.diff(force) / np.diff(d)

    @property
    def stiffness(self) -> float:
        """k_0, that from 0 on."""
        d = np.array(self.table)[:, 0]
        return float(self.slopes[np.searchsorted(d, 0.0, "right") - 1])

    @property
    def kinks(self) -> list[Contact]:
        """The contacts."""
        found, slopes, b = [], self.slopes.tolist(), np.array(self.direction)
        least = SAME * max(map(abs, slopes))
        for below, above, (d, _) in zip(slopes, slopes[1:], self.table[1:], strict=False):
            if abs(above - below) > least:
                side, bend = (1.0, above - below) if d > 0.0 else (-1.0, below - above)
                found.append(Kink(tuple((side * b).tolist()), abs(d), bend))
        return sorted(found, key=lambda kink: (kink.direction != self.direction, kink.gap))


def add_springs(stiffness: Any, springs: Any, n: int) -> tuple[Any, list[Contact]]:
    """Return K with the slopes of springs from 0 on, and their other contacts.

    Raises
    ------
    ValueError
        If motions beyond the tables are not held.
    """
    array = np.array(matrix("matrices.stiffness", stiffness, (n, n)))
    beyond, kinks = array.copy(), list[Contact]()
    for spring in items("springs", springs, "a list of Spring"):
        if not isinstance(spring, Spring):
            raise wrong("springs", "must be a list of Spring")
        b = np.array(vector("spring.direction", spring.direction, n))
        array = array + spring.stiffness * np.outer(b, b)
        beyond += spring.slopes[[0, -1]].min() * np.outer(b, b)
        kinks += spring.kinks
    least = np.linalg.eigvalsh(beyond).min()
    if kinks and least < -SAME * np.abs(beyond).max():
        limit = f"must not leave a stiffness below 0 beyond its points, has eigenvalue {least:.3g}"
        raise wrong("spring.table", limit)
    return array.tolist(), kinks
