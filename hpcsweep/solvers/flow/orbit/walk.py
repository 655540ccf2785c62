"""Walk along a branch of periodic orbits where nothing happens, in one compiled call.

The steps are those of `dynamics.continuation.branch`, along the amplitude, by the same rules
(`solvers.branch_rule`). A walk ends before the first step on which anything is to be told or
decided: at which a test of the multipliers, the number of them outside the unit circle, the
signature, or the direction of the branch changes, which comes to its own start or to an orbit of a
period that divides its own, or leaves the span. There the caller takes over, with the point that
was found. So no result depends on how many steps a call takes.
"""

import math

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, entry_point, type_of
from hpcsweep.solvers.branch_rule import (
    ANGLE,
    ASTRAY,
    CLOSED,
    GROWTH,
    MAX_ANGLE,
    MIN_MOVE,
    OF_A_STEP,
    ON_A_STEP,
    ON_DIVISOR,
)
from hpcsweep.solvers.flow.orbit.corrector import (
    correct_point,
    find_closings,
    find_point,
    read_trace,
)
from hpcsweep.solvers.flow.orbit.multipliers import find_multipliers
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state

PRIMES = (2, 3, 5, 7)
MORE, AT_EVENT, REFUSED = range(3)
"""Why `walk_branch` returns: to be called again; something happens on the next step; that is for
the caller to take, or too short."""
UNKNOWN = -1.0
ALONE, KNOWN, KEEPING = range(3)
"""How a point is sought: with the inverse of a neighbour; with that alone, if moves contract."""
FAILED, FOUND, WITH_MULTIPLIERS, KEPT = range(4)
"""What is found of a point; multipliers only where the product of the tangent maps has their
digits; the last: only y, with the inverse of the neighbour."""
SPAN = type_of((0.0, 0.0, 0.0, 0.0, 0.0))
"""Lowest and highest amplitude, largest and smallest step, reach."""


@entry_point((INT, INT), BYTES, BYTES, INT, FLOAT, specialises=True)
def solve_point(shared, packed, how, reached):
    """Find the point on a hyperplane; see `corrector.find_point`.

    Parameters
    ----------
    shared, packed : ndarray of bytes
        A packed `Shared` and a packed `Trace`.
    how : int
        See `ALONE`; `KEEPING` counts the closings, too, in place of the multipliers.
    reached : float
        Largest last move.

    Returns
    -------
    found : int
        See `FAILED`.
    n_periods : int
        Forcing periods integrated.
    """
    spent = read_trace(packed).n_periods
    spent[0] = 0
    kept = how == KEEPING and correct_point(shared, packed)
    if not kept and not find_point(shared, packed, how != ALONE, reached):
        return FAILED, spent[0]
    if how != KEEPING:
        return FOUND + find_multipliers(packed), spent[0]
    if not find_closings(shared, packed):
        return FAILED, spent[0]
    return KEPT if kept else FOUND, spent[0]


@entry_point((INT, INT, FLOAT, INT), BYTES, BYTES, SPAN, FLOAT, *(INT,) * 4, specialises=True)
def walk_branch(shared, packed, span, step, begins, known, n_points, n_periods):
    """Take steps from ``last`` along a branch that began at ``first``.

    Parameters
    ----------
    shared, packed
        As in `solve_point`.
    span : tuple
        See `SPAN`.
    step : float
        Length of the first step.
    begins : int
        1 where ``last`` is new, 0 after another call.
    known : int
        1 if the inverse of ``last`` is known, else 0.
    n_points, n_periods : int
        Most points; forcing periods after which to return.

    Returns
    -------
    why : int
        See `MORE`; at an event ``now`` is the point after it.
    n_done : int
        Points in ``walked``.
    step : float
        Length of the next step.
    n_periods : int
    """
    trace = read_trace(packed)
    now, last, spent = trace.now, trace.last, trace.n_periods
    spent[0] = 0
    low, high, largest, smallest, reach = span
    known = known == 1
    if begins == 1:
        copy_state(last.y, now.y)
        copy_matrix(last.matrices, now.matrices)
        if not (find_multipliers(packed) and find_closings(shared, packed)):
            return REFUSED, 0, step, spent[0]
        _keep_tests(packed)
    count = 0
    while True:
        angle = _try_step(shared, packed, step, known)
        if math.isnan(angle):
            if 0.5 * step < smallest:
                return REFUSED, count, step, spent[0]
            step *= 0.5
        elif angle == UNKNOWN:
            return REFUSED, count, step, spent[0]
        elif not _is_plain(packed, low / trace.scale, high / trace.scale, reach):
            return AT_EVENT, count, step, spent[0]
        else:
            _accept(packed, count)
            known = True
            count += 1
            step *= min(GROWTH, ANGLE / max(angle, 1e-12))
            step = min(max(step, smallest), largest)
        if count == n_points or spent[0] >= n_periods:
            return MORE, count, step, spent[0]


@kernel
def _keep_tests(packed):
    """Copy multipliers, their tests and the closings of ``now`` to ``last``."""
    trace = read_trace(packed)
    now, last = trace.now, trace.last
    copy_state(now.multipliers, last.multipliers)
    copy_state(now.tests, last.tests)
    copy_state(now.closings, last.closings)


@kernel
def _distance(one, other):
    square = 0.0
    for k in range(one.shape[0]):
        square += (one[k] - other[k]) ** 2
    return math.sqrt(square)


@kernel
def _try_step(shared, packed, step, known):
    """Take a step.

    Returns
    -------
    float
        Angle by which it turns the tangent, NaN if it is refused; `UNKNOWN` without multipliers.
    """
    trace = read_trace(packed)
    now, last, guess = trace.now, trace.last, trace.guess
    for k in range(guess.shape[0]):
        guess[k] = last.y[k] + step * (last.tangent[k] + 0.5 * step * trace.bend[k])
    copy_state(last.tangent, trace.border)
    copy_matrix(last.inverse, now.inverse)
    reached = min(ON_A_STEP, max(OF_A_STEP * step, MIN_MOVE))
    if not find_point(shared, packed, known, reached):
        return math.nan
    cosine = 0.0
    for k in range(guess.shape[0]):
        cosine += now.tangent[k] * last.tangent[k]
    angle = math.acos(min(cosine, 1.0))
    if angle > MAX_ANGLE or _distance(now.y, guess) > ASTRAY * step:
        return math.nan
    if not find_multipliers(packed):
        return UNKNOWN
    return angle if find_closings(shared, packed) else math.nan


@kernel
def _is_plain(packed, low, high, reach):
    """Return whether nothing happens between ``last`` and ``now``."""
    trace = read_trace(packed)
    now, last = trace.now, trace.last
    end = now.y.shape[0] - 1
    plain = low <= now.y[end] <= high
    plain = plain and (now.tangent[end] < 0.0) == (last.tangent[end] < 0.0)
    for k in range(end):
        plain = plain and abs(now.y[k]) <= reach
    for k in range(now.tests.shape[0]):
        plain = plain and (now.tests[k] < 0.0) == (last.tests[k] < 0.0)
    outside = 0
    for k in range(now.multipliers.shape[0]):
        outside += int(abs(now.multipliers[k]) > 1.0) - int(abs(last.multipliers[k]) > 1.0)
    for k in range(now.closings.shape[0]):
        plain = plain and now.closings[k] == last.closings[k]
    if not plain or outside != 0 or collapses(last, now, now.matrices.shape):
        return False
    return passes_start(trace.first, last, now, now.matrices.shape)[0] == 0.0


@kernel
def passes_start(start, last, now, sizes):
    """Find where a step from `last` to `now` passes the start of the branch, in Python too.

    A branch is closed where it comes back to the orbit from which it began, from whichever of its
    points that is counted: the curve of the chains goes round as many times more. Between two
    points the branch is a parabola, as far as the chord's sag.

    Parameters
    ----------
    start, last, now
        Points, with y and tangent.
    sizes : (int, int)
        p N and N.

    Returns
    -------
    share : float
        Of the step, 0 if it does not.
    shift : int
        Number of the start's point that is counted first.
    """
    end, size = sizes
    square = turn = 0.0
    for k in range(now.y.shape[0]):
        square += (now.y[k] - last.y[k]) ** 2
        turn += (now.tangent[k] - last.tangent[k]) ** 2
    sag = max(0.25 * math.sqrt(turn), CLOSED)
    for shift in range(0, end, size):
        share = apart = along = 0.0
        for k in range(now.y.shape[0]):
            place = (k + shift) % end if k < end else k
            step, away = now.y[k] - last.y[k], start.y[place] - last.y[k]
            share += away * step
            apart += away * away
            along += start.tangent[place] * step
        ahead = 0.0 < share <= square and along >= 0.5 * math.sqrt(square)
        if ahead and apart - share * share / square <= sag * sag * square:
            return share / square, shift // size
    return 0.0, 0


@kernel
def collapses(last, now, sizes):
    """Return whether an orbit passes, between two points, one of a period that divides its own.

    Or whether it comes to lie on the branch of that, whose orbits solve the same equations. The
    arguments are those of `passes_start`.
    """
    end, size = sizes
    for prime in PRIMES:
        shift = end // prime
        if shift % size != 0 or end % prime != 0:
            continue
        product = square = 0.0
        for k in range(end):
            before = last.y[k] - last.y[(k - shift) % end]
            product += before * (now.y[k] - now.y[(k - shift) % end])
            square += before * before
        if product < ON_DIVISOR * square:
            return True
    return False


@kernel
def _accept(packed, place):
    """Write ``now`` as a point of the walk, and make it the last one."""
    trace = read_trace(packed)
    now, last, walked = trace.now, trace.last, trace.walked
    length = _distance(now.y, last.y)
    for k in range(trace.bend.shape[0]):
        trace.bend[k] = (now.tangent[k] - last.tangent[k]) / length
    copy_state(now.y, last.y)
    copy_state(now.tangent, last.tangent)
    copy_matrix(now.inverse, last.inverse)
    _keep_tests(packed)
    copy_state(now.y, walked.y[place])
    copy_state(now.tangent, walked.tangent[place])
    copy_matrix(now.matrices, walked.matrices[place])
    copy_state(now.multipliers, walked.multipliers[place])
    copy_state(now.closings, walked.closings[place])
    walked.residual[place] = now.residual[0]
