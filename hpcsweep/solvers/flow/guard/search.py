"""First passage of a floor through a level, with a proof where there is none.

On an interval of length d let g be the distance past the level, g < 0 before it, H the cubic
Hermite interpolant of g through values and slopes at both ends, M a bound of |g''''|, and y from 0
to 1 the place in the interval. Then

    |g - H| <= d^4 / 24 M y^2 (1 - y)^2,
    |g' - H'| <= sqrt(3)/216 d^3 M,        |g'' - H''| <= d^2 / 12 M

(Birkhoff and Priver, J. Math. Phys. 46 (1967) 440). So g lies below a quartic B, whose Bernstein
coefficients are those of H, raised to degree four, the middle one greater by d^4 M / 144:

    g_0,  g_0 + d g_0'/4,  (g_0 + g_1)/2 + d (g_0' - g_1')/6 + d^4 M / 144,  g_1 - d g_1'/4,  g_1.

If the largest is negative, g has no root: the floor cannot have reached the level, however short
the contact. Otherwise the interval is cut into `LANES` parts, which are tested together, and the
first part not cleared is cut again, until either every part is cleared, or a part has exactly one
root because the slope, likewise bounded from below, is positive there.

A floor that is leaving its layer starts with g_0 >= 0, g_0' < 0. If all other coefficients of B are
negative, B falls below 0 once, before y = g_0 / (g_0 - 4 (g_0 + d g_0'/4)), and stays there. If g'
is negative up to there, the floor leaves its layer and does not come back. As |g' - H'| grows from
0 no faster than y d^3 M / 12, g' lies below the parabola with the coefficients

    g_0',   3 (g_1 - g_0) / d - g_0' - g_1' + d^3 M / 24,   g_1' + d^3 M / 12.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import (
    LANES,
    first_not_negative,
    fma,
    greatest,
    lane,
    load,
    local_matrix,
    negative,
    shifted,
)
from hpcsweep.solvers.flow.step.polynomials import (
    value_and_slope,
    value_slope_bend,
    values_and_slopes,
)

HERMITE_MIDDLE = 1.0 / 144.0
HERMITE_SLOPE = 0.00802
"""sqrt(3) / 216, rounded up."""
HERMITE_BEND = 1.0 / 12.0
MIN_ADVANCE = 1e-9
"""Fraction of a step after which a floor that starts at the level, leaving it, is tested again."""
LAST_STEP = 1e-6
"""Of the search for a root, in steps h: one more cubes the error."""
TOUCH = 5e-16
"""Excess over the level (gaps) that rounding hides: a floor that rests there has not passed it."""
SAME = 1e-17
"""Error of a displacement at a root (gaps)."""
MAX_DEPTH = 16
"""Cuts of a step that is searched for a contact."""
SHORTEST = float(LANES) ** -MAX_DEPTH
"""Part of a step, after `MAX_DEPTH` cuts, on which a tangency is within rounding of the level."""
PATIENCE = 1_000
"""Parts tested before `TOUCH` is quadrupled. A tangency takes some hundred; more remain where
a floor rests at the level and the rounding of all others moves it."""
MAX_TOUCH = 4.0**5 * TOUCH
MAX_PARTS = 20 * PATIENCE
"""Most parts tested in one search. The rounding of states beyond 1e4 may take more."""
SAME_INSTANT = 2.0**-40
"""Part of a step within which what happens does so at one instant."""
UNDECIDED = -2
NEGATIVE, AT_ROOT, NO_ROOT = range(3)
ENDS = np.arange(1.0, LANES + 1.0) / LANES
"""Ends of the parts of an interval."""


class Trace(NamedTuple):
    """A displacement along a step of length h: polynomial `row` of `rows`."""

    rows: np.ndarray
    """(any, N_COEFFICIENTS): coefficients in sigma = 2 s / h - 1, ascending."""
    row: int
    h: float


class Level(NamedTuple):
    """A level, and the sign of the way through it."""

    sign: float
    value: float


class Stretch(NamedTuple):
    """Ends of a part of a step, with g and its slopes there."""

    a: float
    ga: float
    da: float
    b: float
    gb: float
    db: float


class Bracket(NamedTuple):
    """Ends of an interval on which g rises through a root, and g there."""

    a: float
    ga: float
    b: float
    gb: float


@kernel
def _inner(d, g0, slope0, g1, slope1, bound4):
    """Return the three inner coefficients of the quartic B above g."""
    square = d * d
    middle = fma(d * (1.0 / 6.0), slope0 - slope1, 0.5 * (g0 + g1))
    return (
        fma(0.25 * d, slope0, g0),
        fma(HERMITE_MIDDLE * bound4, square * square, middle),
        fma(-0.25 * d, slope1, g1),
    )


@kernel
def _top(d, g0, slope0, g1, slope1, bound4):
    """Bound g on an interval of length d from above."""
    early, middle, late = _inner(d, g0, slope0, g1, slope1, bound4)
    return max(max(max(g0, g1), max(early, late)), middle)


@kernel
def may_reach(d, g0, slope0, g1, slope1, bound4):
    """Return whether g may reach 0 on an interval of length d; False is proved."""
    return _top(d, g0, slope0, g1, slope1, bound4) >= 0.0


@inlined
def reaching(d, g0, slope0, g1, slope1, bound4):
    """Return which g of `Lanes` `may_reach` 0, as bits."""
    early, middle, late = _inner(d, g0, slope0, g1, slope1, bound4)
    top = greatest(greatest(greatest(g0, g1), greatest(early, late)), middle)
    return ~negative(top) & ((1 << LANES) - 1)


@inlined
def may_exceed(size, d, g0, slope0, g1, slope1, bound4):
    """Return whether |g| may reach `size` on an interval of length d; False is proved."""
    early, middle, late = _inner(d, g0, slope0, g1, slope1, 0.0)
    square = d * d
    more = HERMITE_MIDDLE * bound4 * (square * square)
    top = max(max(max(g0, g1), max(early, late)), middle + more)
    bottom = min(min(min(g0, g1), min(early, late)), middle - more)
    return max(top, -bottom) >= size


@kernel
def leaves(d, g0, slope0, g1, slope1, bound4):
    """Return whether g >= 0 falls below 0 within d, to stay there up to d; True is proved."""
    early, middle, late = _inner(d, g0, slope0, g1, slope1, bound4)
    if not (g0 >= 0.0 and slope0 < 0.0 and max(max(early, middle), max(late, g1)) < 0.0):
        return False
    y = g0 / (g0 - 4.0 * early)
    bend = HERMITE_BEND * d * d * d * bound4
    middle = max(0.0, 3.0 * (g1 - g0) / d - slope0 - slope1 + 0.5 * bend)
    last = max(0.0, slope1 + bend)
    return y <= 0.5 and slope0 * (1.0 - y) * (1.0 - y) + y * (2.0 * middle + y * last) < 0.0


@kernel
def rises_throughout(d, g0, slope0, g1, slope1, bound4):
    """Return whether g' > 0 on the whole interval; True is proved."""
    middle = 3.0 * (g1 - g0) / d - slope0 - slope1
    lowest = min(min(slope0, slope1), middle)
    return lowest - HERMITE_SLOPE * d * d * d * bound4 > 0.0


@kernel
def _turn(curve, level, a, b):
    """Return where g, falling at a and rising at b, turns."""
    for _ in range(60):
        middle = 0.5 * (a + b)
        _, slope = value_and_slope(curve.rows, curve.row, curve.h, middle)
        if level.sign * slope < 0.0:
            a = middle
        else:
            b = middle
    return b


@inlined
def _where_negative(curve, part, level):
    """Find where g becomes negative, if it is not at the start: the floor leaves its layer.

    Returns
    -------
    where : int
        `NEGATIVE` if the search begins there, `AT_ROOT` if g = 0 there and rises, or where it turns
        before it is negative; `NO_ROOT` if it stays above 0 to the end.
    a, ga, da : float
        Time, g and its slope.
    """
    a, ga, da = part.a, part.ga, part.da
    if 0.0 <= ga <= TOUCH and da > 0.0:
        return AT_ROOT, a, ga, da
    if ga > TOUCH:
        if da >= 0.0:
            return AT_ROOT, a, ga, da
        for _ in range(60):
            before = a
            a += max(-1.02 * ga / da, MIN_ADVANCE * curve.h)
            if a >= part.b:
                if part.gb >= 0.0 and part.db >= 0.0:
                    return AT_ROOT, _turn(curve, level, before, part.b), ga, da
                return NO_ROOT, a, ga, da
            value, slope = value_and_slope(curve.rows, curve.row, curve.h, a)
            ga = level.sign * (value - level.value)
            da = level.sign * slope
            if ga < 0.0:
                break
            if da >= 0.0:
                return AT_ROOT, _turn(curve, level, before, a), ga, da
        if ga >= 0.0:
            return AT_ROOT, a, ga, da
    return NEGATIVE, a, ga, da


@inlined
def _first_uncleared(curve, part, level, bound4, touch):
    """Cut a part into `LANES` and find the first in which g may reach `touch`.

    Returns
    -------
    place : int
        Number of the part; `LANES` if there is none (proved).
    Stretch
        The part.
    """
    a, ga, da, b, gb, db = part
    d = (b - a) * (1.0 / LANES)
    values, slopes = values_and_slopes(curve.rows, curve.row, curve.h, fma(load(ENDS, 0), b - a, a))
    g, slope = (values - level.value) * level.sign, slopes * level.sign
    before, slope_before = shifted(ga, g), shifted(da, slope)
    early, middle, late = _inner(d, before, slope_before, g, slope, bound4)
    top = greatest(greatest(greatest(before, g), greatest(early, late)), middle)
    place = first_not_negative(top - touch)
    if place == LANES:
        return place, part
    start = a + place * d
    left, left_slope = lane(before, place), lane(slope_before, place)
    if place == LANES - 1:
        return place, Stretch(start, left, left_slope, b, gb, db)
    return place, Stretch(start, left, left_slope, start + d, lane(g, place), lane(slope, place))


@kernel
def first_passage(curve, part, level, bound4):
    """Find where g = sign (u - level) first reaches 0 from below in a part of a step.

    Parameters
    ----------
    curve : Trace
        u along the step.
    part : Stretch
        Where it is searched.
    level : Level
    bound4 : float
        Bound of |u''''| on the step.

    Returns
    -------
    Bracket
        Bracket of the first root, where g rises; a = b at a root known to rounding. a = -1 if there
        is no root, `UNDECIDED` if rounding prevents a decision. If g > 0 at the start and is
        falling (the floor is just leaving its layer) the search begins where g has become negative;
        if it is rising, the root is at the start.
    """
    where, a, ga, da = _where_negative(curve, part, level)
    if where == AT_ROOT:
        return Bracket(a, ga, a, ga)
    if where == NO_ROOT:
        return Bracket(-1.0, ga, a, ga)
    depth, stack = 0, local_matrix(MAX_DEPTH + 2, 3)  # right ends
    parts = 0
    touch = TOUCH
    b, gb, db = part.b, part.gb, part.db
    while True:
        parts += 1
        if parts % PATIENCE == 0:
            touch = min(4.0 * touch, MAX_TOUCH)
            if parts == MAX_PARTS:
                return Bracket(float(UNDECIDED), ga, a, ga)
        d = b - a
        cleared = _top(d, ga, da, gb, db, bound4) < touch
        shortest = not d > SHORTEST * curve.h
        if not cleared and gb >= 0.0:
            if rises_throughout(d, ga, da, gb, db, bound4):
                return Bracket(a, ga, b, gb)
            # a fall is no root: there rounding has moved a g that starts from 0
            if shortest and not (da < 0.0 and db < 0.0):
                return Bracket(b, gb, b, gb)
        if not (cleared or shortest):
            whole = Stretch(a, ga, da, b, gb, db)
            place, uncleared = _first_uncleared(curve, whole, level, bound4, touch)
            if place < LANES - 1:
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = b, gb, db
                depth += 1
            if place < LANES:
                a, ga, da, b, gb, db = uncleared
                continue
        a, ga, da = b, gb, db
        if depth == 0:
            return Bracket(-1.0, ga, a, ga)
        depth -= 1
        b, gb, db = stack[depth, 0], stack[depth, 1], stack[depth, 2]


@kernel
def rising_root(curve, bracket, level):
    """Find the one root of a g that rises, by Halley's method kept inside [a, b]; a if a = b."""
    a, ga, b, gb = bracket
    if not a < b:
        return a
    s = a - ga * (b - a) / (gb - ga)
    for _ in range(60):
        value, slope, bend = value_slope_bend(curve.rows, curve.row, curve.h, s)
        g = level.sign * (value - level.value)
        slope *= level.sign
        bend *= level.sign
        if g < 0.0:
            a = s
        else:
            b = s
        below = 2.0 * slope * slope - g * bend
        step = -2.0 * g * slope / below
        if not (slope > 0.0 and below > 0.0 and a <= s + step <= b):
            step = 0.5 * (a + b) - s
        s += step
        # the remainder, g''' step^3 / 6 and (step g'' / g')^2 g / 4, is below rounding
        square = step * step
        if (
            square <= LAST_STEP * LAST_STEP * curve.h * curve.h
            and square * bend * bend * abs(g) <= SAME * slope * slope
        ):
            return s
    return s
