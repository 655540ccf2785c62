"""Largest modulus of the eigenvalues of a small real matrix, without calling a library.

Householder's reflections take the matrix to Hessenberg form, Francis' double-shifted QR steps
deflate it from below (Golub, Van Loan, Matrix Computations, 4th ed., sections 7.4 and 7.5; the
shifts of Martin, Peters, Wilkinson, Numer. Math. 14 (1970) 219). Both are orthogonal: the
eigenvalues are those of a matrix that differs by rounding. For the six of three floors that takes
3.3 us, against 28 us of numpy, most of it the call.
"""

import math

from hpcsweep.kernels.compile import kernel

EPSILON = 2.0**-52
SMALL = 1e-70
MOST_STEPS = 60
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
    scale = 1.0 if SMALL < norm < 1.0 / SMALL else norm
    if norm == 0.0:
        return 0.0
    if scale != 1.0:
        # squares beyond this range overflow or underflow
        for i in range(size):
            for j in range(size):
                matrix[i, j] /= scale
    _to_hessenberg(matrix)
    return scale * _largest_modulus(matrix, norm / scale)


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
def _largest_modulus(h, norm):
    """Return the largest modulus of the eigenvalues of a Hessenberg matrix, inf if none is found.

    `shifted` has been taken off the diagonal.
    """
    largest = 0.0
    shifted = 0.0
    end = h.shape[0] - 1
    steps = 0
    while end >= 0:
        first = _first_of_block(h, end, norm)
        corner = h[end, end]
        if first == end:
            largest = max(largest, abs(corner + shifted))
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
            if square >= 0.0:
                largest = max(largest, abs(middle) + root)
            else:
                largest = max(largest, math.sqrt(middle * middle + root * root))
            end -= 2
            steps = 0
            continue
        if steps == MOST_STEPS:
            return math.inf
        steps += 1
        if steps % UNUSUAL == 0:
            shifted += corner
            for i in range(end + 1):
                h[i, i] -= corner
            corner = 0.75 * (abs(h[end, end - 1]) + abs(h[end - 1, end - 2]))
            above = corner
            product = -0.4375 * corner * corner / 0.5625
        _double_step(h, first, end, corner, above, product)
    return largest


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
