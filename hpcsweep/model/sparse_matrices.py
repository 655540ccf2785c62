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

ASYMMETRY = 1e-6
"""Largest difference of a matrix from its transpose, over its largest entry: files round."""
RIGID = 1e-13
"""Stiffness of a motion that is 0, where the diagonal of K is scaled to 1: so that penalty springs,
which hold supports, count as little as units do."""
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


def sticking(stiffness: Any, slides: np.ndarray, sliders: Sequence[Any]) -> Any:
    """Return K with the springs of sliders; refuse one that leaves motions free."""
    springs = np.sqrt([slider.stiffness for slider in sliders])
    tied = sparse.csr_array(springs[:, None] * slides)
    held = sparse.csr_array(stiffness + tied.T @ tied)
    if n_free := motions_below(held, 1.0):
        many = f"{n_free} motion{'s' * (n_free > 1)}"
        raise wrong("stiffness", f"leaves {many} free: fix some coordinates")
    return held


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
