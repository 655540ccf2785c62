"""The tangent maps along a periodic orbit, and its Floquet multipliers."""

from functools import cached_property

import numpy as np

from hpcsweep.dynamics.stability import floquet_multipliers
from hpcsweep.solvers.branch_rule import MAX_PRODUCT


class TangentMaps:
    """The tangent maps along an orbit, shape (p, N, N), and what follows from them.

    Their multipliers, too, where they are known.
    """

    def __init__(self, matrices: np.ndarray, known: np.ndarray | None = None):
        self.matrices = matrices
        if known is not None:
            self.multipliers = known

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, largest modulus first, shape (N,)."""
        return multipliers(self.matrices)

    def rolled(self, shift: int) -> "TangentMaps":
        """Return those of the same orbit, its points counted from another one of them."""
        return TangentMaps(np.roll(self.matrices, shift, axis=0))


def multipliers(matrices: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of M_{p-1} ... M_0, largest modulus first, shape (N,).

    To first order a relative error of each M_i changes their product P by up to it times

        sum_i |M_{p-1} ... M_{i+1}| |M_i| |M_{i-1} ... M_0|.

    Where this is large they are the p-th powers of the eigenvalues of the block
    cyclic matrix of the M_i, which has each p times and is as well scaled as each M_i (Kressner,
    Numerical Methods for General and Structured Eigenvalue Problems, 2005, 3.3).

    Parameters
    ----------
    matrices : ndarray, shape (p, N, N)
    """
    p, n, _ = matrices.shape
    if p == 1:
        return floquet_multipliers(matrices[0])
    before, after = [np.eye(n)], [np.eye(n)]
    for first, last in zip(matrices, matrices[::-1], strict=True):
        before.append(first @ before[-1])
        after.append(after[-1] @ last)
    sizes = [np.linalg.norm(x, axis=(1, 2)) for x in (before[:-1], matrices, after[-2::-1])]
    if np.prod(sizes, axis=0).sum() <= MAX_PRODUCT:
        return floquet_multipliers(before[-1])
    cyclic = np.zeros((p * n, p * n))
    for i, matrix in enumerate(matrices):
        ahead = (i + 1) % p * n
        cyclic[ahead : ahead + n, i * n : (i + 1) * n] = matrix
    powers = np.linalg.eigvals(cyclic) ** p
    found = np.empty(n, complex)
    for k in range(n):
        largest = powers[np.argmax(np.abs(powers))]
        order = np.argsort(np.abs(powers - largest), kind="stable")
        found[k] = powers[order[:p]].mean()
        powers = powers[order[p:]]
    return found[np.argsort(-np.abs(found), kind="stable")]
