"""Newton's method for the periodic orbit that a motion approaches.

With F the period map over p forcing periods and M its tangent it solves F(z) = z from where the
last three points extrapolate to (Aitken's method along their differences). `transient` defines when
it is tried and when the orbit is that of the motion.
"""

import math

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.flow.march.march import advance
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state, make_unit
from hpcsweep.solvers.flow.step.algebra import solve, spectral_radius
from hpcsweep.solvers.outcome import COMPLETE
from hpcsweep.solvers.skip_rule import LINEAR_DEFECT, STABLE

NEWTON_STEPS = 6
NEWTON_SAME = 1e-7
"""Distance between points whose tangent maps are taken as equal."""
NEWTON_REACH = 0.01
"""Longest jump (gaps, gaps omega_0)."""
NEWTON_RESIDUAL = 1e-11


@kernel
def newton_orbit(shared, watch, period, amplitude):
    """Jump from the watched motion to the orbit that it approaches, if that is verified.

    Returns
    -------
    accepted : bool
        ``watch.point`` is then z*.
    n_periods : int
        Forcing periods integrated.
    multiplier : float
        Modulus of the largest Floquet multiplier.
    """
    long, since = watch.history.shape[0], watch.since[0]
    before = watch.history[(since - 2 * period) % long]
    state = watch.history[(since - period) % long]
    image = watch.history[since % long]
    _extrapolate(before, state, image, watch.point)
    is_orbit, n_periods = _find_orbit(shared, watch, period, amplitude, image)
    if not (is_orbit and _is_linear(watch.matrix, state, image, watch.point)):
        return False, n_periods, math.nan
    copy_matrix(watch.matrix, watch.factors)
    multiplier = spectral_radius(watch.factors)
    return multiplier <= STABLE, n_periods, multiplier


@kernel
def _find_orbit(shared, watch, period, amplitude, image):
    """Move ``watch.point`` to the orbit; its tangent map is left in ``watch.matrix``.

    The matrix is kept while it was computed within `NEWTON_SAME` of where it is used; the
    multiplier is then accurate to about that.

    Returns
    -------
    found : bool
        Whether there is one within `NEWTON_REACH` of `image`.
    n_periods : int
        Forcing periods integrated.
    """
    point, taken, matrix, left = watch.point, watch.taken, watch.matrix, watch.left
    size = point.shape[0]
    n_periods = 0
    residual = 0.0
    for step in range(NEWTON_STEPS):
        copy_state(point, left)
        if step > 0 and _largest_difference(point, taken) <= NEWTON_SAME:
            done, outcome = advance(shared, point, amplitude, period, None)
        else:
            copy_state(point, taken)
            make_unit(matrix)
            done, outcome = advance(shared, point, amplitude, period, matrix)
        n_periods += done
        if outcome != COMPLETE:
            return False, n_periods
        last_residual = residual
        residual = _largest_difference(point, left)
        # z - (M - I)^-1 (F(z) - z), z in `left` and F(z) in `point`
        copy_matrix(matrix, watch.factors)
        for k in range(size):
            watch.previous[k] = point[k] - left[k]
            watch.factors[k, k] -= 1.0
        if not solve(watch.factors, watch.previous):
            return False, n_periods
        for k in range(size):
            point[k] = left[k] - watch.previous[k]
        if not _largest_difference(point, image) <= NEWTON_REACH:
            return False, n_periods
        # the next residual falls at least by the factor by which this one has fallen. A last
        # correction in any case: with a multiplier near 1 a small residual may be far from the
        # orbit
        foretold = 10.0 * residual * residual <= NEWTON_RESIDUAL * last_residual
        if residual <= NEWTON_RESIDUAL or foretold:
            return True, n_periods
    return False, n_periods


@kernel
def _is_linear(matrix, state, image, orbit):
    """Return whether `matrix` takes `state` to `image`, as seen from a point of the orbit."""
    size_left = 0.0
    curved = 0.0
    for i in range(orbit.shape[0]):
        expected = 0.0
        for k in range(orbit.shape[0]):
            expected += matrix[i, k] * (state[k] - orbit[k])
        size_left = max(size_left, abs(image[i] - orbit[i]))
        curved = max(curved, abs(image[i] - orbit[i] - expected))
    return curved <= LINEAR_DEFECT * size_left + NEWTON_RESIDUAL


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
    """Sum the geometric series begun by the differences of three points, if it converges."""
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
