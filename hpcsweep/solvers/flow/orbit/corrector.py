r"""Points of a branch of periodic orbits: Newton's method, multipliers, and workspace.

With p points of size N of an orbit there are S = p N + 1 components of y.

Newton's method for a point of a branch along the amplitude, compiled
---------------------------------------------------------------------
`dynamics.continuation.cycle` has the method, for any map and parameter; these are its rules
(`solvers.branch_rule`). There a move takes 35 us, of which 3 are the map of three floors.

Multipliers of a point of a branch and functions of them, and the closings of its contacts
------------------------------------------------------------------------------------------
As `dynamics.continuation` has them, in `stability`, `events` and `forced`. The eigenvalues are
those of `linear.spectrum`: 4 us for three floors, 14 from Python.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import Arena, as_long_as
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.places import allocate, part, zeros
from hpcsweep.solvers.branch_rule import (
    CONTRACTS,
    DIFFERENCE,
    EXACT,
    MAX_PRODUCT,
    REACHED,
    ROUNDING,
    STEPS,
)
from hpcsweep.solvers.flow.linear.algebra import deflate, invert
from hpcsweep.solvers.flow.period.march import march
from hpcsweep.solvers.flow.state.shared import IMPACTS, MAXIMA, NO_TALLY, clear, read_shared
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state, make_unit
from hpcsweep.solvers.measures import CLOSINGS
from hpcsweep.solvers.outcome import COMPLETE


class Point(NamedTuple):
    """A point of a branch; states are without the rows beyond n."""

    y: np.ndarray = zeros("S")
    tangent: np.ndarray = zeros("S")
    inverse: np.ndarray = zeros("S", "S")
    """Of the bordered Jacobian."""
    matrices: np.ndarray = zeros("p N", "N")
    """Tangent maps, N rows each."""
    multipliers: np.ndarray = zeros("N", dtype=complex)
    tests: np.ndarray = zeros(3)
    """See `FOLD`."""
    closings: np.ndarray = zeros("m", dtype=int)
    """Of each contact."""
    residual: np.ndarray = zeros(1)


class Trace(NamedTuple):
    """Points of a branch and workspace."""

    scale: float
    """Of the amplitude: the last component of y is A / scale."""
    length: float
    """Of a unit of the points in y, in kernel units."""
    amplitude_unit: float
    walked: Point
    """Points that a walk has accepted, each array with one more axis, and none of `inverse` and
    `tests`."""
    now: Point = part(Point)
    """Result of Newton's method, and where it begins."""
    last: Point = part(Point)
    """From which a step is taken; the end of a chord."""
    first: Point = part(Point)
    """The start of the branch; the beginning of a chord. Only y and tangent."""
    guess: np.ndarray = zeros("S")
    border: np.ndarray = zeros("S")
    """The hyperplane border . (y - guess) = 0."""
    bend: np.ndarray = zeros("S")
    """Turn of the tangent per length, at `last`."""
    move: np.ndarray = zeros("S")
    misses: np.ndarray = zeros("S")
    images: np.ndarray = zeros("S")
    ahead: np.ndarray = zeros("S")
    """Workspace; of the images the last one is not used."""
    pivots: np.ndarray = zeros("S", dtype=int)
    n_periods: np.ndarray = zeros(1, dtype=int)
    """Forcing periods integrated."""
    z: np.ndarray = zeros("2R")
    columns: np.ndarray = zeros("2R", "N")
    product: np.ndarray = zeros("N", "N")
    other: np.ndarray = zeros("N", "N")
    sizes: np.ndarray = zeros("p")


def new_trace(
    shape: tuple[int, int, int], size: int, k: int, units: tuple[float, float, float]
) -> Trace:
    """Allocate for shape (p, N, m), m contacts, kernel states of a size, k points of a walk.

    `units` are the first three values.
    """
    p, n, m = shape
    sizes = {"p": p, "N": n, "m": m, "p N": p * n, "S": p * n + 1, "2R": size}
    walked = {
        name: zeros(k, *array.shape, dtype=array.dtype)
        for name, array in allocate(Point, sizes)._asdict().items()
    }
    walked |= {"inverse": zeros(0, 0), "tests": zeros(0), "residual": zeros(k)}
    scale, length, unit = map(float, units)
    return allocate(
        Trace, sizes, scale=scale, length=length, amplitude_unit=unit, walked=Point(**walked)
    )


TRACE = Arena(new_trace((1, 2, 1), 2, 1, (1.0, 1.0, 1.0)))
read_trace = TRACE.read


@kernel
def march_points(shared, packed, value, wanted, tangents, images):
    """Integrate the points of ``now`` over one forcing period each.

    Parameters
    ----------
    value : float
        A.
    wanted : int
        Of the tally, see `tally`.
    tangents : bool
        Whether to write ``now.matrices``.
    images : ndarray, shape (S,)
        Receives the states.

    Returns
    -------
    bool
        Whether the solver has succeeded.
    """
    common, trace = read_shared(shared), read_trace(packed)
    now, amplitude = trace.now, value / trace.amplitude_unit
    z = as_long_as(trace.z, common.previous)
    size, half = now.matrices.shape[1], z.shape[0] // 2
    n = size // 2
    tangent = trace.columns if tangents else common.no_tangent
    for first in range(0, now.matrices.shape[0], size):
        if tangents:
            tangent[:] = 0.0
        for i in range(n):
            z[i] = now.y[first + i] * trace.length
            z[half + i] = now.y[first + n + i] * trace.length
            if tangents:
                tangent[i, i] = tangent[half + i, n + i] = 1.0
        trace.n_periods[0] += 1
        no_points, no_growth = common.no_points, common.no_growth
        _, outcome = march(shared, z, amplitude, 1, no_points, wanted, tangent, no_growth)
        if outcome != COMPLETE:
            return False
        for i in range(n):
            images[first + i] = z[i] / trace.length
            images[first + n + i] = z[half + i] / trace.length
            if tangents:
                copy_state(tangent[i], now.matrices[first + i])
                copy_state(tangent[half + i], now.matrices[first + n + i])
    return True


@kernel
def value_of(packed):
    """Return the amplitude of ``now``."""
    trace = read_trace(packed)
    return trace.now.y[trace.now.y.shape[0] - 1] * trace.scale


@kernel
def _linearise(shared, packed):
    """Compute images, tangent maps and the inverse of the bordered Jacobian; return whether."""
    trace = read_trace(packed)
    now, whole, scale = trace.now, trace.now.inverse, trace.scale
    last, size = now.matrices.shape
    value = value_of(packed)
    high = value + DIFFERENCE * (abs(value) if value != 0.0 else 1.0)
    if not march_points(shared, packed, value, NO_TALLY, True, trace.images):
        return False
    if not march_points(shared, packed, high, NO_TALLY, False, trace.ahead):
        return False
    whole[:] = 0.0
    for row in range(last):
        whole[row, (row + size) % last] = -1.0
        for k in range(size):
            whole[row, row // size * size + k] += now.matrices[row, k]
        whole[row, last] = (trace.ahead[row] - trace.images[row]) / (high - value) * scale
    copy_state(trace.border, whole[last])
    return invert(whole, trace.pivots)


@kernel
def _find_move(packed):
    """Write by how much ``now`` misses the branch, and the move by its inverse.

    Returns
    -------
    float
        Largest component of the move, NaN if any is.
    """
    trace = read_trace(packed)
    y, misses, move = trace.now.y, trace.misses, trace.move
    last, size = trace.now.matrices.shape
    for k in range(last):
        misses[k] = trace.images[k] - y[(k + size) % last]
    misses[last] = 0.0
    for k in range(last + 1):
        misses[last] += trace.border[k] * (y[k] - trace.guess[k])
    largest = 0.0
    for i in range(last + 1):
        move[i] = 0.0
        for k in range(last + 1):
            move[i] += trace.now.inverse[i, k] * misses[k]
        if i == last and abs(trace.border[last]) == 1.0:
            move[last] = 0.0
        if not abs(move[i]) <= largest:
            largest = abs(move[i])
    return largest


@kernel
def _take_move(packed):
    trace = read_trace(packed)
    for k in range(trace.move.shape[0]):
        trace.now.y[k] -= trace.move[k]


@kernel
def find_point(shared, packed, known, reached):
    """Find the point on the hyperplane, from its guess, as `cycle.solve` does.

    Parameters
    ----------
    known : bool
        Whether ``now.inverse`` is that of a neighbour.
    reached : float
        Largest last move.

    Returns
    -------
    bool
        Whether ``now`` is the point: y, tangent, inverse, matrices and residual.
    """
    trace = read_trace(packed)
    now, last = trace.now, trace.now.matrices.shape[0]
    copy_state(trace.guess, now.y)
    least = fresh_least = math.inf
    for step in range(STEPS + 1):
        ends = step == STEPS or least <= reached
        fresh = ends or not known
        if fresh:
            done = _linearise(shared, packed)
        else:
            done = march_points(shared, packed, value_of(packed), NO_TALLY, False, trace.images)
        if not done:
            return False
        distance = _find_move(packed)
        if ends:
            if not distance <= reached:
                return False
            break
        if fresh:
            if not distance < fresh_least:
                return False
            least = fresh_least = distance
        known = fresh or distance <= CONTRACTS * least
        if fresh or distance < least:
            _take_move(packed)
            least = distance
    _take_move(packed)
    square = now.residual[0] = 0.0
    for k in range(last + 1):
        square += now.inverse[k, last] ** 2
        if k < last:
            now.residual[0] = max(now.residual[0], abs(trace.misses[k]))
    for k in range(last + 1):
        now.tangent[k] = now.inverse[k, last] / math.sqrt(square)
    return True


@kernel
def correct_point(shared, packed):
    """Find the point near ``now``, sought across the same border, as `cycle.correct` does."""
    trace = read_trace(packed)
    copy_state(trace.guess, trace.now.y)
    least = math.inf
    for _ in range(STEPS):
        if not march_points(shared, packed, value_of(packed), NO_TALLY, False, trace.images):
            break
        distance = _find_move(packed)
        if distance <= EXACT:
            _take_move(packed)
            return True
        if not distance <= CONTRACTS * least:
            if least <= ROUNDING:
                return True
            break
        _take_move(packed)
        least = distance
    return find_point(shared, packed, True, REACHED)


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
