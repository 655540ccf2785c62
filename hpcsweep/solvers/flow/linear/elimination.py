"""Solve linear equations and invert matrices in place, by elimination with row pivots."""

from hpcsweep.kernels.compile import inlined, kernel


@inlined
def _pivot_row(matrix, k):
    """Return the row of the largest entry of column k from the diagonal on; -1: it is 0 or NaN."""
    pivot = k
    for row in range(k + 1, matrix.shape[0]):
        if abs(matrix[row, k]) > abs(matrix[pivot, k]):
            pivot = row
    return pivot if abs(matrix[pivot, k]) > 0.0 else -1


@kernel
def solve(matrix, right):
    """Solve matrix x = right, both overwritten, x in `right`.

    Returns
    -------
    bool
        Whether the matrix is regular.
    """
    size = right.shape[0]
    for column in range(size):
        pivot = _pivot_row(matrix, column)
        if pivot < 0:
            return False
        if pivot != column:
            for k in range(column, size):
                matrix[column, k], matrix[pivot, k] = matrix[pivot, k], matrix[column, k]
            right[column], right[pivot] = right[pivot], right[column]
        for row in range(column + 1, size):
            factor = matrix[row, column] / matrix[column, column]
            for k in range(column + 1, size):
                matrix[row, k] -= factor * matrix[column, k]
            right[row] -= factor * right[column]
    for row in range(size - 1, -1, -1):
        value = right[row]
        for k in range(row + 1, size):
            value -= matrix[row, k] * right[k]
        right[row] = value / matrix[row, row]
    return True


@kernel
def invert(matrix, pivots):
    """Overwrite a matrix with its inverse.

    Returns
    -------
    bool
        Whether the matrix is regular.
    """
    size = matrix.shape[0]
    for k in range(size):
        pivot = _pivot_row(matrix, k)
        if pivot < 0:
            return False
        pivots[k] = pivot
        factor = 1.0 / matrix[pivot, k]
        matrix[pivot, k] = 1.0
        for j in range(size):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            matrix[k, j] *= factor
        for row in range(size):
            if row != k:
                factor = matrix[row, k]
                matrix[row, k] = 0.0
                for j in range(size):
                    matrix[row, j] -= factor * matrix[k, j]
    for k in range(size - 1, -1, -1):
        pivot = pivots[k]
        for row in range(size):
            matrix[row, k], matrix[row, pivot] = matrix[row, pivot], matrix[row, k]
    return True
