"""Multipliers of a point of a branch, and functions of them that vanish at special points.

As `dynamics.stability` has them. The eigenvalues are those of `linear.algebra.deflate`: 4 us for
three floors, 14 from Python.
"""

import math

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.branch_rule import MAX_PRODUCT
from hpcsweep.solvers.flow.linear.algebra import deflate
from hpcsweep.solvers.flow.orbit.corrector import read_trace
from hpcsweep.solvers.flow.state.state import copy_matrix, make_unit


@kernel
def find_multipliers(packed):
    """Find the multipliers of ``now``, and their tests.

    Returns
    -------
    bool
        Whether the product of the tangent maps has their digits.
    """
    trace = read_trace(packed)
    matrix, found = trace.product, trace.now.multipliers
    size = matrix.shape[0]
    if not _multiply(packed):
        return False
    scale = deflate(matrix)
    if scale == math.inf:
        return False
    for i in range(size):
        imaginary = 0.0 - matrix[i, i - 1] if i > 0 else 0.0
        if i + 1 < size and matrix[i + 1, i] != 0.0:
            imaginary = matrix[i + 1, i]
        value = scale * complex(matrix[i, i], imaginary)
        # largest modulus first, equal ones as they come
        place = i
        while place > 0 and abs(found[place - 1]) < abs(value):
            found[place] = found[place - 1]
            place -= 1
        found[place] = value
    tests = trace.now.tests
    tests[0], tests[1], tests[2] = tests_of(found)
    return True


@kernel
def tests_of(multipliers):
    """Evaluate functions of multipliers that vanish at special points, in Python too.

    Returns
    -------
    fold : float
        prod (1 - mu) / (1 + |mu|).
    doubling : float
        prod (1 + mu) / (1 + |mu|).
    torus : float
        Product over pairs of (1 - mu_i mu_j) / (1 + |mu_i mu_j|).
    """
    fold = doubling = torus = complex(1.0, 0.0)
    for i in range(len(multipliers)):
        mu = multipliers[i]
        size = 1.0 + abs(mu)
        fold *= (1.0 - mu) / size
        doubling *= (1.0 + mu) / size
        for k in range(i):
            pair = mu * multipliers[k]
            torus *= (1.0 - pair) / (1.0 + abs(pair))
    return fold.real, doubling.real, torus.real


@kernel
def _multiply(packed):
    """Write M_{p-1} ... M_0 to ``product``; return whether errors grow little; see `stability`.

    ``sizes`` receives the norms of M_{p-1} ... M_{i+1}.
    """
    trace = read_trace(packed)
    matrices, product, other, sizes = trace.now.matrices, trace.product, trace.other, trace.sizes
    p, size = sizes.shape[0], product.shape[0]
    make_unit(product)
    for i in range(p - 1, -1, -1):
        sizes[i] = _norm(product, 0, size)
        copy_matrix(product, other)
        _multiply_into(other, 0, matrices, i * size, product)
    if p == 1:
        return True
    make_unit(product)
    growth = 0.0
    for i in range(p):
        growth += sizes[i] * _norm(matrices, i * size, size) * _norm(product, 0, size)
        copy_matrix(product, other)
        _multiply_into(matrices, i * size, other, 0, product)
    return growth <= MAX_PRODUCT


@kernel
def _norm(matrix, first, size):
    """Return the norm of Frobenius of some rows."""
    square = 0.0
    for i in range(first, first + size):
        for k in range(size):
            square += matrix[i, k] * matrix[i, k]
    return math.sqrt(square)


@kernel
def _multiply_into(left, first, right, other, product):
    """Write the product of two square matrices, whose rows begin at `first` and `other`."""
    size = product.shape[0]
    for i in range(size):
        for j in range(size):
            product[i, j] = 0.0
            for k in range(size):
                product[i, j] += left[first + i, k] * right[other + k, j]
