"""Finite element models of beams."""

import numpy as np


def beam(n: int = 30, lumped: bool = False, free: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return M and K of a clamped beam of n elements, or free, coordinates 1.UY, 1.RZ, 2.UY, ..."""
    h, size = 1.0 / n, 2 * (n + 1)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    a, b = 6 * h, 2 * h * h
    bent = np.array([[12, a, -12, a], [a, 2 * b, -a, b], [-12, -a, 12, -a], [a, b, -a, 2 * b]])
    c, d, e = 22 * h, 13 * h, h * h
    moved = [[156, c, 54, -d], [c, 4 * e, d, -3 * e], [54, d, 156, -c], [-d, -3 * e, -c, 4 * e]]
    moved = np.diag([210.0, 0.0, 210.0, 0.0]) if lumped else np.array(moved)
    for i in range(0, size - 2, 2):
        mass[i : i + 4, i : i + 4] += moved * h / 420
        stiffness[i : i + 4, i : i + 4] += bent / h**3
    first = 0 if free else 2
    return mass[first:, first:], stiffness[first:, first:]
