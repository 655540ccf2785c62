"""First passage of a floor through a level, with a proof where there is none.

On an interval of length d let g be the distance past the level, g < 0 before it, and H the
cubic Hermite interpolant of g through values and slopes at both ends. Then

    |g - H| <= d^4 / 384 max|g''''|,       |g' - H'| <= sqrt(3)/216 d^3 max|g''''|

(Birkhoff and Priver, J. Math. Phys. 46 (1967) 440), and H lies below the largest of its
Bernstein coefficients g_0, g_0 + d g_0'/3, g_1 - d g_1'/3, g_1. If that plus the error is
negative, g has no root: the floor cannot have reached the level, however short the contact.
Otherwise the interval is halved, the left half first, until either every part is cleared, or a
part has exactly one root because the slope, bounded likewise from below, is positive there.
"""

from hpcsweep.flow.tables import N_COEFFICIENTS, ZERO
from hpcsweep.jit import LANES, combine, fma, kernel

HERMITE_VALUE = 1.0 / 384.0
HERMITE_SLOPE = 0.00802
"""sqrt(3) / 216, rounded up."""
LEAST_ADVANCE = 1e-9
"""Part of a step after which a floor that starts at the level, leaving it, is looked at again."""
EDGE_TOLERANCE = 1e-10
"""Accuracy of a passage time, in steps: it is where a finer search for the stop, or the
integration of the layer, begins."""
MAX_DEPTH = 48
"""Halvings; below h 2^-48 a tangency is within rounding of the level."""
MAX_PARTS = 20_000
"""Parts looked at in one search. A tangency takes some hundred; more are left where the rounding
of states beyond 1e16 hides the level."""
UNDECIDED = -2


@kernel
def expand_rows(poly, index, x, rows, expanded, count):
    """Write the polynomials of the first `count` components along a step from x into `rows`.

    Parameters
    ----------
    poly : ndarray
        Of `Tables`.
    rows : ndarray, shape (2n, N_COEFFICIENTS)
    expanded : ndarray of bool, shape (2n,)
        Which rows are valid already.
    """
    for row in range(count):
        if not expanded[row]:
            expand_row(poly, index, row, x, rows)
            expanded[row] = True


@kernel
def expand_row(poly, index, row, x, rows):
    """Write the polynomial of one component along a step from x into its row."""
    start = (index * poly.shape[1] + row) * poly.shape[2] * N_COEFFICIENTS
    for p in range(0, N_COEFFICIENTS, LANES):
        combine(
            rows,
            row * N_COEFFICIENTS + p,
            ZERO,
            0,
            1.0,
            poly,
            start + p,
            N_COEFFICIENTS,
            x,
            0,
            x.shape[0],
        )


@kernel
def evaluate_rows(rows, h, s, out):
    """Evaluate the state at time s of the step whose polynomials are `rows`."""
    sigma = 2.0 * s / h - 1.0
    for row in range(out.shape[0]):
        value = rows[row, N_COEFFICIENTS - 1]
        for p in range(N_COEFFICIENTS - 2, -1, -1):
            value = fma(value, sigma, rows[row, p])
        out[row] = value


@kernel
def value_and_slope(rows, row, h, s):
    """Evaluate polynomial `row` of a step and its time derivative at time s of the step.

    Parameters
    ----------
    rows : ndarray, shape (any, N_COEFFICIENTS)
        Coefficients in sigma = 2 s / h - 1, ascending.
    """
    sigma = 2.0 * s / h - 1.0
    value = rows[row, N_COEFFICIENTS - 1]
    slope = 0.0
    for p in range(N_COEFFICIENTS - 2, -1, -1):
        slope = fma(slope, sigma, value)
        value = fma(value, sigma, rows[row, p])
    return value, slope * (2.0 / h)


@kernel
def value_slope_bend(rows, row, h, s):
    """Evaluate as `value_and_slope`, and the second time derivative."""
    sigma = 2.0 * s / h - 1.0
    value = rows[row, N_COEFFICIENTS - 1]
    slope = 0.0
    half_bend = 0.0
    for p in range(N_COEFFICIENTS - 2, -1, -1):
        half_bend = fma(half_bend, sigma, slope)
        slope = fma(slope, sigma, value)
        value = fma(value, sigma, rows[row, p])
    return value, slope * (2.0 / h), half_bend * (8.0 / (h * h))


@kernel
def may_reach(d, g0, slope0, g1, slope1, bound4):
    """Tell whether g may reach 0 on an interval of length d; False is proved."""
    top = max(max(g0, g1), max(g0 + d * slope0 / 3.0, g1 - d * slope1 / 3.0))
    return top + HERMITE_VALUE * d**4 * bound4 >= 0.0


@kernel
def _rises_throughout(d, g0, slope0, g1, slope1, bound4):
    """Tell whether g' > 0 on the whole interval; True is proved."""
    middle = 3.0 * (g1 - g0) / d - slope0 - slope1
    lowest = min(min(slope0, slope1), middle)
    return lowest - HERMITE_SLOPE * d**3 * bound4 > 0.0


@kernel
def first_passage(rows, row, h, start, end, level, sign, bound4, stack):
    """Find the first time in [start, end] at which sign (u - level) reaches 0 from below.

    Parameters
    ----------
    rows : ndarray, shape (any, N_COEFFICIENTS)
    row : int
        u along the step is polynomial `row` of `rows`.
    h, start, end : float
        Length of the step; part of it that is searched.
    level, sign : float
        g = sign (u - level).
    bound4 : float
        Bound of |u''''| on the step.
    stack : ndarray, shape (MAX_DEPTH + 2, 3)
        Room for right ends.

    Returns
    -------
    float
        The time, -1 if there is none, `UNDECIDED` if rounding forbids to tell. If g > 0 at
        `start` and is falling (the floor is just leaving its layer) the search begins where g has
        become negative; if it is rising, `start` is returned.
    """
    a = start
    value, slope = value_and_slope(rows, row, h, a)
    ga = sign * (value - level)
    da = sign * slope
    if ga >= 0.0:
        if da >= 0.0:
            return a
        for _ in range(60):
            a += max(-1.02 * ga / da, LEAST_ADVANCE * h)
            if a >= end:
                return -1.0
            value, slope = value_and_slope(rows, row, h, a)
            ga = sign * (value - level)
            da = sign * slope
            if ga < 0.0:
                break
            if da >= 0.0:
                return a
        if ga >= 0.0:
            return a
    value, slope = value_and_slope(rows, row, h, end)
    depth = 0
    parts = 0
    stack[0, 0] = end
    stack[0, 1] = sign * (value - level)
    stack[0, 2] = sign * slope
    while depth >= 0:
        parts += 1
        if parts > MAX_PARTS:
            return float(UNDECIDED)
        b = stack[depth, 0]
        gb = stack[depth, 1]
        db = stack[depth, 2]
        d = b - a
        if not may_reach(d, ga, da, gb, db, bound4):
            a, ga, da = b, gb, db
            depth -= 1
            continue
        if gb >= 0.0 and _rises_throughout(d, ga, da, gb, db, bound4):
            return _root(rows, row, h, a, ga, b, gb, level, sign)
        if depth >= MAX_DEPTH:
            if gb >= 0.0:
                return b
            a, ga, da = b, gb, db
            depth -= 1
            continue
        middle = 0.5 * (a + b)
        value, slope = value_and_slope(rows, row, h, middle)
        depth += 1
        stack[depth, 0] = middle
        stack[depth, 1] = sign * (value - level)
        stack[depth, 2] = sign * slope
    return -1.0


@kernel
def _root(rows, row, h, a, ga, b, gb, level, sign):
    """Newton's method, kept inside [a, b], for the one root of a rising g."""
    s = a - ga * (b - a) / (gb - ga)
    for _ in range(60):
        value, slope = value_and_slope(rows, row, h, s)
        g = sign * (value - level)
        if g < 0.0:
            a = s
        else:
            b = s
        slope *= sign
        step = -g / slope if slope > 0.0 else 0.0
        following = s + step
        if not a < following < b:
            following = 0.5 * (a + b)
        if abs(following - s) <= EDGE_TOLERANCE * h:
            return following
        s = following
    return s
