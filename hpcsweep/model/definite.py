"""Refuse matrices that are not symmetric, or not definite."""

import numpy as np

from hpcsweep.model.arguments import wrong
from hpcsweep.model.modes import RIGID, scaled_stiffness

SYMMETRY = 1e-10
"""Largest difference of a symmetric matrix from its transpose, relative to its largest entry."""
MAX_SPREAD = 1e16
"""Largest ratio of two masses, or of the squares of two natural frequencies: beyond it the units
of the entries are mixed, or one of them is a typing error."""


def is_symmetric(array: np.ndarray) -> bool:
    """Return whether a matrix is symmetric, to rounding."""
    return bool(np.abs(array - array.T).max() <= SYMMETRY * np.abs(array).max())


def check_symmetric(name: str, array: np.ndarray) -> None:
    """Refuse a matrix that is not symmetric."""
    if not is_symmetric(array):
        off = np.abs(array - array.T)
        i, j = np.unravel_index(int(off.argmax()), off.shape)
        entries = f"({i + 1}, {j + 1}) is {array[i, j]:g}, ({j + 1}, {i + 1}) is {array[j, i]:g}"
        raise wrong(name, f"must be symmetric: entry {entries}")


def check_definite(name: str, array: np.ndarray, n_rigid: int = 0) -> None:
    """Refuse a matrix that is not symmetric and, but for rigid motions, positive definite."""
    check_symmetric(name, array)
    values = np.linalg.eigvalsh(array)[n_rigid:]
    if not values.min(initial=1.0) > 0:
        raise wrong(name, f"must be positive definite, has the eigenvalue {values[0]:.3g}")
    if values.size and values[-1] / MAX_SPREAD > values[0]:
        limit = f"has eigenvalues from {values[0]:.3g} to {values[-1]:.3g}"
        raise wrong(name, f"{limit}: a ratio above {MAX_SPREAD:g} looks like mixed units")


def rigid_motions(name: str, stiffness: np.ndarray) -> int:
    """Return how many motions no spring opposes; refuse a stiffness that drives some."""
    check_symmetric(name, stiffness)
    scaled = scaled_stiffness(stiffness)
    if scaled[0] < -RIGID:
        least = np.linalg.eigvalsh(stiffness)[0]
        raise wrong(name, f"must not be negative, has the eigenvalue {least:.3g}")
    n_rigid = int(np.count_nonzero(scaled <= RIGID))
    check_definite(name, stiffness, n_rigid)
    return n_rigid


def check_damping(array: np.ndarray) -> None:
    """Refuse a damping matrix that feeds energy in; what is skew of it does no work."""
    values = np.linalg.eigvalsh(0.5 * (array + array.T))
    if values[0] < -SYMMETRY * np.abs(array).max():
        limit = f"must not feed energy in, has the eigenvalue {values[0]:.3g}"
        raise wrong("matrices.damping", limit)
