"""Take a round of Newton's method for a chain of points of an orbit, in one compiled call.

This is what `hpcsweep.dynamics.continuation.cycle` repeats, which has the method and its notation:
y = (X, A / scale), G and the hyperplane. In Python a move costs 25 us, 3 of them the map of three
floors, and a point of a branch takes six.
"""

import math
from typing import NamedTuple

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    INT,
    MATRIX,
    entry_point,
    type_of,
)
from hpcsweep.kernels.simd.vectors import local_matrix, local_vector
from hpcsweep.solvers.flow.march.march import advance
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.flow.step.algebra import invert
from hpcsweep.solvers.outcome import COMPLETE


class Round(NamedTuple):
    """When moves end."""

    most: int
    """Most of them."""
    falls: float
    """Factor by which they must fall."""
    enough: float
    """The move that is enough."""
    least: float
    """The one before."""
    share: float
    """Of the amplitude, over which its slope is a difference."""


@entry_point(
    *((INT, FLOAT, FLOAT, INT), BYTES, MATRIX, MATRIX, MATRIX, FLOAT, FLOAT),
    type_of(Round(0, 0.0, 0.0, 0.0, 0.0)),
    specialises=True,
)
def take_round(shared, rows, inverse, matrices, scale, unit, rules):
    """Move y by a Jacobian that is kept while moves fall, then find the Jacobian there.

    Parameters
    ----------
    shared : ndarray of bytes
        A packed `Shared`.
    rows : ndarray, shape (6, S)
        y, which is moved; its guess and the border; receives G and the distance from the
        hyperplane, and the next move, which is not made; workspace.
    inverse : ndarray, shape (S, S)
        Of a bordered Jacobian, then of the one at y.
    matrices : ndarray, shape (p N, N) or (0, N)
        Receives the tangent maps at y; if empty, only the moves are made.
    scale, unit : float
        Units of the amplitude and of the points in y, over those of the kernels.
    rules : Round

    Returns
    -------
    outcome : int
    least : float
        Largest component of the last move that was made.
    largest : float
        That of the next one, inf where the Jacobian is singular.
    n_done : int
        Forcing periods integrated.
    """
    most, falls, enough, least, share = rules
    y, misses, ahead = rows[0], rows[3], rows[5]
    common = read_shared(shared)
    end, size = y.shape[0] - 1, matrices.shape[1]
    n_done, largest = 0, math.inf
    rows_of_state = common.work.step.z_end.shape[0]
    columns, nothing = local_matrix(rows_of_state, size), local_matrix(rows_of_state, 0)
    for _ in range(most):
        n_done += end // size
        outcome = _advance(shared, y, y[end] * scale, unit, misses, nothing, matrices)
        if outcome != COMPLETE:
            return outcome, least, largest, n_done
        largest = _find_move(rows, inverse, size)
        if not largest < least:
            break
        contracts = largest <= falls * least
        for k in range(end + 1):
            y[k] -= rows[4, k]
        least = largest
        if least <= enough or not contracts:
            break
    if matrices.shape[0] == 0:
        return COMPLETE, least, largest, n_done
    value = y[end] * scale
    high = value + share * (abs(value) if value != 0.0 else 1.0)
    n_done += 2 * (end // size)
    outcome = _advance(shared, y, value, unit, misses, columns, matrices)
    if outcome == COMPLETE:
        outcome = _advance(shared, y, high, unit, ahead, nothing, matrices)
    if outcome != COMPLETE:
        return outcome, least, largest, n_done
    inverse[:] = 0.0
    for row in range(end):
        inverse[row, (row + size) % end] = -1.0
        for k in range(size):
            inverse[row, row // size * size + k] += matrices[row, k]
        inverse[row, end] = (ahead[row] - misses[row]) / (high - value) * scale
    copy_state(rows[2], inverse[end])
    regular = invert(inverse)
    return COMPLETE, least, _find_move(rows, inverse, size) if regular else math.inf, n_done


@kernel
def _advance(shared, y, value, unit, images, columns, matrices):
    """Write the images of the points of y at an amplitude; with `columns` the tangent maps, too."""
    common = read_shared(shared)
    z = local_vector(common.work.step.z_end.shape[0])
    size, half = matrices.shape[1], z.shape[0] // 2
    n = size // 2
    for first in range(0, y.shape[0] - 1, size):
        columns[:] = 0.0
        for i in range(n):
            z[i] = y[first + i] * unit
            z[half + i] = y[first + n + i] * unit
            if columns.shape[1] > 0:
                columns[i, i] = columns[half + i, n + i] = 1.0
        _, outcome = advance(shared, z, value, 1, columns)
        if outcome != COMPLETE:
            return outcome
        for i in range(n):
            images[first + i] = z[i] / unit
            images[first + n + i] = z[half + i] / unit
            if columns.shape[1] > 0:
                copy_state(columns[i], matrices[first + i])
                copy_state(columns[half + i], matrices[first + n + i])
    return COMPLETE


@kernel
def _find_move(rows, inverse, size):
    """Replace images by G and the distance from the hyperplane; write the move, return the largest.

    It is NaN if any component is.
    """
    y, guess, border, misses, move = rows[0], rows[1], rows[2], rows[3], rows[4]
    end = y.shape[0] - 1
    misses[end] = 0.0
    for k in range(end + 1):
        misses[end] += border[k] * (y[k] - guess[k])
        if k < end:
            misses[k] -= y[(k + size) % end]
    largest = 0.0
    for i in range(end + 1):
        move[i] = 0.0
        for k in range(end + 1):
            move[i] += inverse[i, k] * misses[k]
        if i == end and abs(border[end]) == 1.0:
            move[i] = 0.0
        if not (abs(move[i]) <= largest or math.isnan(largest)):
            largest = abs(move[i])
    return largest
