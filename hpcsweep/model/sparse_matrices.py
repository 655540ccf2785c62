"""Sparse symmetric matrices of a model: what is accepted, and how many motions have no stiffness.

Signs of eigenvalues are those of pivots, by Sylvester's law of inertia, of factors without exchange
of pivots.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import sparse

from hpcsweep.model.arguments import refused, wrong
from hpcsweep.model.modes import RIGID

ASYMMETRY = 1e-6
"""Largest difference of a matrix from its transpose, over its largest entry: files round."""
FELT = 1e-9
"""Part of the largest displacement of rigid modes that contacts do not feel."""
SMALL = 512
"""Coordinates from which on modes are found by sparse shift-invert."""
SHIFT = 1e-9
"""Of the eigenvalues of a stiffness whose diagonal is 1, to find those that are 0."""
MAX_COORDINATES = 300_000
"""Of a model: factors of as many of a solid may take some 10 GB."""


def factors(matrix: Any) -> Any:
    """Factorise a sparse symmetric matrix without exchange of pivots.

    Raises
    ------
    RuntimeError
        If a pivot is 0.
    ValueError
        If there is not enough memory.
    """
    from scipy.sparse.linalg import splu

    kept = {"SymmetricMode": True}
    try:
        return splu(matrix.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=kept)
    except MemoryError:
        limit = "needs more memory than there is for its factors"
        raise wrong("stiffness", f"of {matrix.shape[0]} coordinates {limit}") from None


def motions_below(stiffness: Any, side: float) -> int:
    """Return the number of motions of a stiffness below 0 (side -1), or of 0 or less (1)."""
    diagonal = stiffness.diagonal()
    shift = RIGID * np.where(diagonal > 0, diagonal, diagonal.max())
    return negative(stiffness - side * sparse.diags_array(shift))


def sticking(
    mass: Any, stiffness: Any, slides: np.ndarray, sliders: Sequence[Any], hits: np.ndarray
) -> tuple[Any, np.ndarray]:
    """Return K with the springs of sliders, and the rigid modes N that it leaves free, (n, r).

    With N^T M N = 1. One that no row of a contact feels is a support that was forgotten.
    """
    springs = np.sqrt([slider.stiffness for slider in sliders])
    tied = sparse.csr_array(springs[:, None] * slides)
    held = sparse.csr_array(stiffness + tied.T @ tied)
    if not (n_free := motions_below(held, 1.0)):
        return held, np.zeros((held.shape[0], 0))
    free = _null_space(held, n_free)
    free = np.linalg.solve(np.linalg.cholesky(free.T @ (mass @ free)), free.T).T
    felt = hits @ free / np.abs(hits).sum(axis=1, keepdims=True)
    if lost := n_free - int(np.linalg.matrix_rank(felt, FELT * np.abs(free).max())):
        many = f"{lost} motion{'s' * (lost > 1)}"
        raise wrong(
            "stiffness", f"leaves {many} free, which no contact holds: fix some coordinates"
        )
    return held, free


def _null_space(stiffness: Any, size: int) -> np.ndarray:
    """Return motions that a stiffness leaves free, so many, (n, size)."""
    diagonal = stiffness.diagonal()
    scale = sparse.diags_array(1.0 / np.sqrt(np.where(diagonal > 0, diagonal, diagonal.max())))
    scaled = sparse.csr_array(scale @ stiffness @ scale)
    if stiffness.shape[0] <= SMALL:
        return scale @ np.linalg.eigh(scaled.toarray())[1][:, :size]
    from scipy.sparse.linalg import LinearOperator, eigsh

    solve = factors(scaled + SHIFT * sparse.eye_array(scaled.shape[0])).solve
    inverted = LinearOperator(scaled.shape, matvec=solve, dtype=float)
    first = np.cos(np.arange(scaled.shape[0]))  # any, but always the same
    return scale @ eigsh(scaled, size, sigma=-SHIFT, OPinv=inverted, v0=first)[1]


def elastic_solve(stiffness: Any, mass: Any, free: np.ndarray) -> tuple[Any, Any]:
    """Return what solves K u = f for the part of f that moves no rigid mode, and its factors.

    That is f - M N N^T f. It is in equilibrium: as many supports as there are rigid modes, springs
    of any stiffness where these differ most, take none of it. Of u no rigid mode is left.
    """
    from scipy.linalg import qr

    if not free.size:
        return (factorised := factors(stiffness)).solve, factorised
    places = qr(free.T, mode="r", pivoting=True)[1][: free.shape[1]]
    springs, diagonal = np.zeros(len(free)), stiffness.diagonal()
    springs[places] = np.where(diagonal[places] > 0, diagonal[places], diagonal.max())
    factorised = factors(stiffness + sparse.diags_array(springs))
    heavy = mass @ free

    def solve(load: np.ndarray) -> np.ndarray:
        moved = factorised.solve(load - heavy @ (free.T @ load))
        return moved - free @ (heavy.T @ moved)

    return solve, factorised


def negative(matrix: Any) -> int:
    """Count negative eigenvalues: by Sylvester's law those are negative pivots without exchange."""
    if matrix.nnz <= np.count_nonzero(matrix.diagonal()):
        return int((matrix.diagonal() <= 0).sum())
    try:
        factorised = factors(matrix)
    except RuntimeError:  # a pivot is 0
        return 1
    return int((factorised.U.diagonal() < 0).sum())


def symmetric(name: str, value: Any) -> Any:
    """Return a symmetric sparse matrix, of both triangles."""
    try:
        matrix: Any = value if sparse.issparse(value) else np.asarray(value)
        if sparse.issparse(matrix) and matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)  # products would read anywhere in memory
        if matrix.dtype.kind not in "iuf":
            raise TypeError
    except (TypeError, ValueError):
        raise refused(name, "a matrix of real numbers", value) from None
    shape = matrix.shape
    if max(shape, default=0) > MAX_COORDINATES:
        limit = f"must have {MAX_COORDINATES} rows at most, has {max(shape)}"
        raise wrong(name, f"{limit}: leave out, or condense, what does not move")
    is_row = len(shape) in (1, 2) and 0 not in shape and math.prod(shape) == max(shape)
    if is_row and (name == "mass" or max(shape) == 1):
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        matrix = sparse.diags_array(dense.ravel().astype(float))
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        sizes = " x ".join(map(str, shape)) or "a number"
        raise wrong(name, f"must be a square matrix, is {sizes}")
    matrix = sparse.csr_array(matrix, dtype=float)
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        raise wrong(name, f"must be finite, holds {matrix.data[~np.isfinite(matrix.data)][0]}")
    matrix.eliminate_zeros()
    if not matrix.nnz:
        raise wrong(name, "must not be 0")
    lower, upper = sparse.tril(matrix, -1), sparse.triu(matrix, 1)
    if (lower.nnz == 0) != (upper.nnz == 0):
        matrix = sparse.csr_array(matrix + lower.T + upper.T)
    off = abs(matrix - matrix.T).tocoo()
    if off.nnz and off.data.max() > ASYMMETRY * abs(matrix).max():
        i, j = (int(place[off.data.argmax()]) for place in off.coords)
        entries = f"({i + 1}, {j + 1}) is {matrix[i, j]:g}, ({j + 1}, {i + 1}) is {matrix[j, i]:g}"
        raise wrong(name, f"must be symmetric: entry {entries}")
    return sparse.csr_array((matrix + matrix.T) / 2.0)
