"""Small dense linear algebra without a library: elimination with row pivots, eigenvalues.

Eigenvalues of a small real matrix, and the largest modulus, without calling a library
--------------------------------------------------------------------------------------
Householder's reflections take the matrix to Hessenberg form, Francis' double-shifted QR steps
deflate it from below (Golub, Van Loan, Matrix Computations, 4th ed., sections 7.4 and 7.5; the
shifts of Martin, Peters, Wilkinson, Numer. Math. 14 (1970) 219). Both are orthogonal: the
eigenvalues are those of a matrix that differs by rounding. For the six of three floors that takes
3.3 us, against 28 us of numpy, most of it the call.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_vector


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
def invert(matrix):
    """Overwrite a matrix with its inverse.

    Returns
    -------
    bool
        Whether the matrix is regular.
    """
    size = matrix.shape[0]
    pivots = local_vector(size)
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
        pivot = int(pivots[k])
        for row in range(size):
            matrix[row, k], matrix[row, pivot] = matrix[row, pivot], matrix[row, k]
    return True


EPSILON = 2.0**-52
SMALL = 1e-70
MAX_STEPS = 60
"""Most QR steps without a deflation; three are usual."""
UNUSUAL = 10
"""Steps between exceptional shifts, which break cycles of the usual shifts."""


@kernel
def spectral_radius(matrix):
    """Return the largest modulus of the eigenvalues; the matrix is overwritten.

    Returns
    -------
    float
        inf if the matrix is not finite, or the steps do not converge.
    """
    size = matrix.shape[0]
    norm = 0.0
    for i in range(size):
        for j in range(size):
            norm += abs(matrix[i, j])
    if not norm < math.inf:
        return math.inf
    scale = 1.0 if SMALL < norm < 1.0 / SMALL or norm == 0.0 else norm
    if scale != 1.0:
        # squares beyond this range overflow or underflow
        for i in range(size):
            for j in range(size):
                matrix[i, j] /= scale
    _to_hessenberg(matrix)
    if not _deflate(matrix, norm / scale):
        return math.inf
    largest = 0.0
    for i in range(size):
        corner, below = matrix[i, i], matrix[i + 1, i] if i + 1 < size else 0.0
        modulus = abs(corner) if below == 0.0 else math.sqrt(corner * corner + below * below)
        largest = max(largest, modulus)
    return scale * largest


@kernel
def _to_hessenberg(a):
    """Make all entries below the first subdiagonal 0 by reflections of rows and columns."""
    size = a.shape[0]
    for k in range(size - 2):
        square = 0.0
        for i in range(k + 2, size):
            square += a[i, k] * a[i, k]
        if square == 0.0:
            continue
        # v = x + sign(x_1) |x| e_1 takes x to a multiple of e_1; kept where x was
        head = a[k + 1, k]
        length = math.copysign(math.sqrt(head * head + square), head)
        a[k + 1, k] = head + length
        scale = 1.0 / (length * (head + length))
        for j in range(k + 1, size):
            product = 0.0
            for i in range(k + 1, size):
                product += a[i, k] * a[i, j]
            product *= scale
            for i in range(k + 1, size):
                a[i, j] -= product * a[i, k]
        for i in range(size):
            product = 0.0
            for j in range(k + 1, size):
                product += a[i, j] * a[j, k]
            product *= scale
            for j in range(k + 1, size):
                a[i, j] -= product * a[j, k]
        a[k + 1, k] = -length
        for i in range(k + 2, size):
            a[i, k] = 0.0


@kernel
def _deflate(h, norm):
    """Overwrite a Hessenberg matrix with its eigenvalues; return whether the steps converge.

    On the diagonal are the real parts. The imaginary part of a complex pair, which is that of two
    neighbours, is between them below the diagonal; elsewhere there are zeros. `shifted` has been
    taken off the diagonal.
    """
    shifted = 0.0
    end = h.shape[0] - 1
    steps = 0
    while end >= 0:
        first = _first_of_block(h, end, norm)
        corner = h[end, end]
        if first == end:
            h[end, end] = corner + shifted
            end -= 1
            steps = 0
            continue
        above = h[end - 1, end - 1]
        product = h[end, end - 1] * h[end - 1, end]
        if first == end - 1:
            # of the last two rows: corner + half +- sqrt(half^2 + product)
            half = 0.5 * (above - corner)
            square = half * half + product
            root = math.sqrt(abs(square))
            middle = corner + shifted + half
            apart = root if square >= 0.0 else 0.0
            h[end - 1, end - 1] = middle + apart
            h[end, end] = middle - apart
            h[end, end - 1] = 0.0 if square >= 0.0 else root
            end -= 2
            steps = 0
            continue
        if steps == MAX_STEPS:
            return False
        steps += 1
        if steps % UNUSUAL == 0:
            shifted += corner
            for i in range(end + 1):
                h[i, i] -= corner
            corner = 0.75 * (abs(h[end, end - 1]) + abs(h[end - 1, end - 2]))
            above = corner
            product = -0.4375 * corner * corner / 0.5625
        _double_step(h, first, end, corner, above, product)
    return True


@kernel
def _first_of_block(h, end, norm):
    """Return the first row of the undivided block that ends with row `end`."""
    row = end
    while row > 0:
        around = abs(h[row - 1, row - 1]) + abs(h[row, row])
        if abs(h[row, row - 1]) <= EPSILON * (around if around > 0.0 else norm):
            h[row, row - 1] = 0.0
            return row
        row -= 1
    return 0


@kernel
def _double_step(h, first, end, corner, above, product):
    """Take a QR step with the two eigenvalues of the last two rows as shifts.

    The first column of (H - s_1)(H - s_2) is chased down the diagonal as a bulge by reflections of
    three rows and columns.
    """
    # s_1 + s_2 and s_1 s_2
    total = corner + above
    determinant = corner * above - product
    top = h[first, first]
    p = top * top + h[first, first + 1] * h[first + 1, first] - total * top + determinant
    q = h[first + 1, first] * (top + h[first + 1, first + 1] - total)
    r = h[first + 1, first] * h[first + 2, first + 1]
    for k in range(first, end):
        last = k == end - 1
        if k > first:
            p = h[k, k - 1]
            q = h[k + 1, k - 1]
            r = 0.0 if last else h[k + 2, k - 1]
        scale = abs(p) + abs(q) + abs(r)
        if scale == 0.0:
            continue
        p /= scale
        q /= scale
        r /= scale
        length = math.copysign(math.sqrt(p * p + q * q + r * r), p)
        if k > first:
            h[k, k - 1] = -length * scale
            h[k + 1, k - 1] = 0.0
            if not last:
                h[k + 2, k - 1] = 0.0
        # I - v w', v = (1, q, r) / ..., w = (p + length, ...) / length
        p += length
        first_weight = p / length
        second_weight = q / length
        third_weight = r / length
        q /= p
        r /= p
        for j in range(k, end + 1):
            part = first_weight * (h[k, j] + q * h[k + 1, j])
            if not last:
                part += first_weight * r * h[k + 2, j]
                h[k + 2, j] -= part * r
            h[k, j] -= part
            h[k + 1, j] -= part * q
        for i in range(first, min(k + 3, end) + 1):
            part = first_weight * h[i, k] + second_weight * h[i, k + 1]
            if not last:
                part += third_weight * h[i, k + 2]
                h[i, k + 2] -= part * r
            h[i, k] -= part
            h[i, k + 1] -= part * q
