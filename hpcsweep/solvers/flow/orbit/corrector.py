r"""Points of a branch of periodic orbits along the amplitude: Newton's method, and workspace.

With p points of size N of an orbit there are S = p N + 1 components of y.
`dynamics.continuation.cycle` has the method, for any map and parameter; these are its rules
(`solvers.branch_rule`), compiled. There a move takes 35 us, of which 3 are the map of three floors.
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
    ROUNDING,
    STEPS,
)
from hpcsweep.solvers.flow.linear.algebra import invert
from hpcsweep.solvers.flow.period.march import march
from hpcsweep.solvers.flow.state.shared import IMPACTS, MAXIMA, NO_TALLY, clear, read_shared
from hpcsweep.solvers.flow.state.state import copy_state
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
    """See `multipliers.tests_of`."""
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
    """From which a step is taken."""
    first: Point = part(Point)
    """The start of the branch. Only y and tangent."""
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
    """Find the point near ``now`` by its Jacobian, as `cycle` does; return whether it contracts."""
    trace = read_trace(packed)
    copy_state(trace.guess, trace.now.y)
    least = math.inf
    for _ in range(STEPS):
        if not march_points(shared, packed, value_of(packed), NO_TALLY, False, trace.images):
            return False
        distance = _find_move(packed)
        if not (distance <= EXACT or distance <= CONTRACTS * least):
            return least <= ROUNDING
        _take_move(packed)
        if distance <= EXACT:
            return True
        least = distance
    return False


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
