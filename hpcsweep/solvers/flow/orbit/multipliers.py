"""Multipliers of a point of a branch and functions of them, and the closings of its contacts.

As `dynamics.continuation` has them, in `tangent_maps`, `events` and `forced`. The eigenvalues are
those of `linear.spectrum`: 4 us for three floors, 14 from Python.
"""

import math

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.branch_rule import MAX_PRODUCT
from hpcsweep.solvers.flow.linear.spectrum import deflate
from hpcsweep.solvers.flow.orbit.corrector import march_points, value_of
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_matrix, make_unit
from hpcsweep.solvers.flow.state.tally import IMPACTS, MAXIMA, clear
from hpcsweep.solvers.flow.state.trace import read_trace
from hpcsweep.solvers.measures import CLOSINGS

FOLD, DOUBLING, TORUS = range(3)
"""Entries of `Point.tests`: those of `dynamics.continuation.events.Tests`."""


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
    fold = doubling = torus = complex(1.0, 0.0)
    for i in range(size):
        fold *= (1.0 - found[i]) / (1.0 + abs(found[i]))
        doubling *= (1.0 + found[i]) / (1.0 + abs(found[i]))
        for k in range(i):
            pair = found[i] * found[k]
            torus *= (1.0 - pair) / (1.0 + abs(pair))
    tests = trace.now.tests
    tests[FOLD], tests[DOUBLING], tests[TORUS] = fold.real, doubling.real, torus.real
    return True


@kernel
def _multiply(packed):
    """Write M_{p-1} ... M_0 to ``product``; return whether errors grow little; see `tangent_maps`.

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


@kernel
def find_closings(shared, packed):
    """Count the closings of each contact along ``now``; return whether the solver succeeds."""
    trace, tally = read_trace(packed), read_shared(shared).tally
    clear(tally)
    if not march_points(*(shared, packed, value_of(packed), MAXIMA + IMPACTS, False, trace.ahead)):
        return False
    for k in range(trace.now.closings.shape[0]):
        trace.now.closings[k] = round(tally.impacts[CLOSINGS, k])
    return True
