"""The end of a transient: the orbit a motion has reached, or is proved to go to.

`settle` watches a motion until its orbit has closed on itself, or is approached. `newton_orbit`
then jumps to the orbit, with Newton's method on F(z) = z, F the period map over p forcing periods
with tangent M, from where the last three points extrapolate to (Aitken's method along their
differences). The orbit z* is accepted if

- it is a fixed point to `NEWTON_RESIDUAL`, found or foretold from the fall of the residual;
- it attracts: the spectral radius of M(z*) is below `NEWTON_STABLE`;
- F is linear between the last points and it: F(z) - z* differs from M(z*) (z - z*) by no more
  than `NEWTON_LINEAR` of itself. The present state is then attracted as the linear map says, to
  z* and to nothing else.

`approach` does the one and the other, until the orbit is known or the transient is over.

What `march` is not to do is given as None rather than left out: calls with the same types share
their compiled code with those of `flow_map`, and it takes half a minute to compile.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import jit, kernel
from hpcsweep.solvers.flow.march import march
from hpcsweep.solvers.flow.packed import read_shared, read_watch

ROUNDING = 2e-14
"""Points closer than this (relative) are the same to rounding."""
NEARER = 0.03
"""Factor of the distance from which on a jump is tried, after one that was not proved."""
NEWTON_STEPS = 6
NEWTON_SAME = 1e-7
"""Distance between points whose tangent maps are taken for the same."""
NEWTON_REACH = 0.01
"""Longest jump (gaps, gaps omega_0)."""
NEWTON_RESIDUAL = 1e-11
NEWTON_STABLE = 0.9999
NEWTON_LINEAR = 0.05


@kernel
def settle(shared, watch, no_points, z, amplitude, n_periods, max_period, settled, same, near):
    """Advance z until its orbit has closed on itself, for `n_periods` at most.

    Let e_k(p) be the largest difference of z(kT) and z((k - p)T). The orbit has period p, and
    distance e r / (1 - r) to go with r = e_k / e_(k-p), once that is at most `settled` at every
    point of two orbits in a row. An orbit that closes after p also closes after multiples of p,
    and may be seen to do so earlier: the answer is the smallest divisor of p for which the last
    two points are the `same`.

    Before that, once e_k(p) is at most `near` and has fallen at every point of two orbits in a
    row, the orbit is approached: the period is returned with a minus sign.

    Returns
    -------
    n_done, period, outcome : int
        `period` is 0 if the orbit has not closed, negative if it is only approached.
    """
    size = z.shape[0]
    history = watch.history
    distance = watch.distance
    close = watch.close
    falling = watch.falling
    ring = max_period + 1
    long = history.shape[0]
    first = watch.since[0]
    if first == 0:
        for k in range(size):
            history[0, k] = z[k]
        for p in range(ring):
            close[p] = 0
            falling[p] = 0
    for period in range(first + 1, first + n_periods + 1):
        _, outcome = march(shared, z, amplitude, 1, no_points, -1.0, None, None, None)
        if outcome != 1:
            return period - 1 - first, 0, outcome
        watch.since[0] = period
        slot = period % ring
        largest = 0.0
        for k in range(size):
            history[period % long, k] = z[k]
            largest = max(largest, abs(z[k]))
        for p in range(1, min(max_period, period) + 1):
            past = (period - p) % ring
            e = 0.0
            for k in range(size):
                e = max(e, abs(z[k] - history[(period - p) % long, k]))
            to_go = math.inf
            approached = False
            if period >= 2 * p:
                before = distance[p, past]
                approached = e <= near and e < before
                if e <= ROUNDING * (1.0 + largest):
                    to_go = 0.0
                elif e < before:
                    to_go = e * e / (before - e)
            distance[p, slot] = e
            close[p] = close[p] + 1 if to_go <= settled else 0
            if close[p] >= 2 * p + 1:
                for divisor in range(1, p):
                    if p % divisor == 0 and distance[divisor, slot] <= same:
                        return period - first, divisor, 1
                return period - first, p, 1
            falling[p] = falling[p] + 1 if approached else 0
            if falling[p] >= 2 * p + 1:
                return period - first, -p, 1
    return n_periods, 0, 1


@kernel
def newton_orbit(shared, watch, no_points, period, amplitude):
    """Jump from the motion that is watched to the orbit it approaches, if that is proved.

    The matrix is kept while it was taken within `NEWTON_SAME` of where it is used; what an orbit's
    matrix tells, its multiplier too, is then right to about that.

    Returns
    -------
    accepted : bool
        ``watch.point`` is then z*.
    n_periods : int
        Forcing periods integrated.
    multiplier : float
        Modulus of the largest Floquet multiplier.
    """
    point, taken, matrix, left = watch.point, watch.taken, watch.matrix, watch.left
    size = point.shape[0]
    long = watch.history.shape[0]
    since = watch.since[0]
    before = watch.history[(since - 2 * period) % long]
    state = watch.history[(since - period) % long]
    image = watch.history[since % long]
    _extrapolate(before, state, image, point)
    n_periods = 0
    found = False
    residual = 0.0
    for step in range(NEWTON_STEPS):
        moved = math.inf if step == 0 else _largest_difference(point, taken)
        for k in range(size):
            left[k] = point[k]
        if moved <= NEWTON_SAME:
            done, outcome = march(
                shared, point, amplitude, period, no_points, -1.0, None, None, None
            )
        else:
            for i in range(size):
                taken[i] = point[i]
                for k in range(size):
                    matrix[i, k] = 1.0 if i == k else 0.0
            done, outcome = march(
                shared, point, amplitude, period, no_points, -1.0, None, matrix, None
            )
        n_periods += done
        if outcome != 1:
            return False, n_periods, math.nan
        last_residual = residual
        residual = _largest_difference(point, left)
        if residual <= NEWTON_RESIDUAL:
            found = True
            break
        # z - (M - I)^-1 (F(z) - z), z in `left` and F(z) in `point`
        for k in range(size):
            watch.previous[k] = point[k] - left[k]
        for i in range(size):
            for k in range(size):
                watch.factors[i, k] = matrix[i, k] - (1.0 if i == k else 0.0)
        if not _solve(watch.factors, watch.previous):
            return False, n_periods, math.nan
        for k in range(size):
            point[k] = left[k] - watch.previous[k]
        if not _largest_difference(point, image) <= NEWTON_REACH:
            return False, n_periods, math.nan
        if 10.0 * residual * residual <= NEWTON_RESIDUAL * last_residual:
            # the next one: it falls at least by the factor by which it has just fallen
            for k in range(size):
                left[k] = point[k]
            found = True
            break
    if not found:
        return False, n_periods, math.nan
    size_left = 0.0
    curved = 0.0
    for i in range(size):
        expected = 0.0
        for k in range(size):
            expected += matrix[i, k] * (state[k] - left[k])
        size_left = max(size_left, abs(image[i] - left[i]))
        curved = max(curved, abs(image[i] - left[i] - expected))
    if not curved <= NEWTON_LINEAR * size_left + NEWTON_RESIDUAL:
        return False, n_periods, math.nan
    multiplier = _spectral_radius(matrix)
    return multiplier <= NEWTON_STABLE, n_periods, multiplier


@kernel
def approach(shared, watch, z, amplitude, n_periods, max_period, settled, same, near):
    """Advance z to the end of its transient: until its orbit is known, for `n_periods` at most.

    Parameters
    ----------
    shared, watch : ndarray of bytes
        A packed `Shared` and a packed `Watch`.
    z : ndarray, shape (2n,)
        Changed in place; after a jump the point of the orbit.
    settled, same : float
        Distance (gaps, gaps omega_0) from the orbit, and between points that count as one.
    near : float
        Distance between points a period apart from which on a jump is tried; 0: never.

    Returns
    -------
    n_done : int
        Forcing periods of the motion until then.
    n_newton : int
        Forcing periods that Newton's method has integrated.
    period : int
        Of the orbit, 0 if it is not known.
    multiplier : float
        Modulus of the largest Floquet multiplier if a jump was made, else NaN.
    near : float
        Distance from which on to try next.
    outcome : int
    """
    no_points = read_shared(shared).no_points
    kept = read_watch(watch)
    n_done = 0
    n_newton = 0
    while True:
        more, period, outcome = settle(
            shared,
            kept,
            no_points,
            z,
            amplitude,
            n_periods - n_done,
            max_period,
            settled,
            same,
            near,
        )
        n_done += more
        if outcome != 1 or period >= 0:
            return n_done, n_newton, period, math.nan, near, outcome
        # an orbit may be seen to approach after a multiple of its period first
        slot = kept.since[0] % (max_period + 1)
        for divisor in range(1, 1 - period):
            if period % divisor != 0 or kept.distance[divisor, slot] > near:
                continue
            accepted, more, multiplier = newton_orbit(shared, kept, no_points, divisor, amplitude)
            n_newton += more
            if accepted:
                for k in range(z.shape[0]):
                    z[k] = kept.point[k]
                return n_done, n_newton, divisor, multiplier, near, outcome
        near *= NEARER
        kept.since[0] = 0


@kernel
def _largest_difference(a, b):
    """Return max |a_k - b_k|, NaN if any of them is."""
    largest = 0.0
    for k in range(a.shape[0]):
        difference = abs(a[k] - b[k])
        if not difference <= largest:
            largest = difference
    return largest


@kernel
def _extrapolate(before, state, image, out):
    """Sum the geometric series that the differences of three points begin, if it converges."""
    square = 0.0
    product = 0.0
    for k in range(out.shape[0]):
        first = state[k] - before[k]
        square += first * first
        product += first * (image[k] - state[k])
    ratio = product / max(square, 1e-300)
    factor = ratio / (1.0 - ratio) if abs(ratio) < 1.0 else 0.0
    for k in range(out.shape[0]):
        out[k] = image[k] + factor * (image[k] - state[k])


@kernel
def _solve(matrix, right):
    """Solve matrix x = right by elimination with row pivots, both overwritten, x in `right`.

    Returns
    -------
    bool
        Whether the matrix is regular.
    """
    size = right.shape[0]
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if not abs(matrix[pivot, column]) > 0.0:
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


@jit
def _spectral_radius(matrix):
    """Return the largest modulus of the eigenvalues, inf if the matrix is not finite."""
    if not np.all(np.isfinite(matrix)):
        return math.inf
    return np.abs(np.linalg.eigvals(matrix.astype(np.complex128))).max()
