r"""Newton's method for a point of a branch along the amplitude, compiled.

`dynamics.continuation.cycle` has the method, for any map and parameter; these are its rules
(`solvers.branch_rule`). There a move takes 35 us, of which 3 are the map of three floors.
"""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.branch_rule import CONTRACTS, DIFFERENCE, EXACT, REACHED, ROUNDING, STEPS
from hpcsweep.solvers.flow.linear.elimination import invert
from hpcsweep.solvers.flow.period.march import march
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.flow.state.tally import NO_TALLY
from hpcsweep.solvers.flow.state.trace import read_trace
from hpcsweep.solvers.outcome import COMPLETE


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
