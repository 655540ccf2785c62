r"""Follow a branch of periodic orbits by pseudo-arclength, with its special points.

A step goes along the tangent and is corrected across it. Its length follows the angle by which the
tangent turns: `ANGLE` is the target, `MAX_ANGLE` is refused. A step is also refused where the
corrected point is farther from the predicted one than `ASTRAY` of the step, where the numbers of
unstable multipliers change otherwise than the special points found on it explain, or where a
multiplier has a pole: it leaves the real axis at +infinity and comes back from -infinity, as it
does between two branches, so that prod (1 + mu) and prod (1 - mu) change their signs at one place.

At a grazing of a sharp stop the tangent turns with the square root of the distance s past it, at a
first contact of Figure 3 by 1 rad within s = 1e-7: the steps there go down to 1e-9. Of a stop so
stiff that it is a corner for the shortest step the branch ends there, and says so (`GRAZES`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation import events
from hpcsweep.dynamics.continuation.cycle import Curve, Solution, largest, length, solve_at
from hpcsweep.dynamics.continuation.events import Kind, Special, special_points
from hpcsweep.dynamics.stability import TangentMaps

ANGLE, MAX_ANGLE = 0.12, 0.5
ASTRAY = 0.5
GROWTH = 2.0
ON_DIVISOR = 1e-3
"""Share of its distance from an orbit of a period that divides its own, below which it is one."""
ON_A_STEP = 1e-8
"""Largest last move to an ordinary point of a branch: multipliers are accurate to about that."""
OF_A_STEP, MIN_MOVE = 0.01, 1e-10
"""The same as a share of the step, where that is less, and the least that is asked of it."""
CLOSED = 1e-3
"""Share of a step within which a closed branch comes back to its start."""
PRIMES = (2, 3, 5, 7)
COLLAPSED = 1e-4
"""Step within which an orbit comes to one of a period that divides its own, or to a crossing."""
GRAZES = 1e-6
"""Distance from a grazing, in units of y, within which a branch that is not followed on ends at it:
beside a stop that is stiff enough the tangent turns by a radian within less than a step."""


class Limits(NamedTuple):
    """Limits and resolution of branches.

    Attributes
    ----------
    low, high : float
        Span of the parameter.
    most_steps : int
        Most points of a branch on either side of its start.
    largest, smallest : float
        Length of a step, in units of y.
    reach : float
        Largest component of a state, in its units.
    """

    low: float
    high: float
    most_steps: int = 400
    largest: float = 0.05
    smallest: float = 1e-11
    reach: float = 1e3


@dataclass
class Arc:
    """A branch, or a piece of it.

    Attributes
    ----------
    curve : Curve or Locus
    points : list of Solution
        In branch order, including folds, so that the parameter is monotone between neighbours.
    specials : list of (int, Special)
        Each with the index in `points` of the point after it, a fold with its own index.
    ends : (str, str)
        Why it stops at its beginning and at its end.
    parent : int
        In a catalogue, the branch that it leaves, -1 if it was found by an orbit.
    searched : bool
        Whether that orbit was found by the search.
    """

    curve: Any
    points: list[Solution]
    specials: list[tuple[int, Special]] = field(default_factory=list)
    ends: tuple[str, str] = ("", "")
    parent: int = -1
    searched: bool = False

    @cached_property
    def heights(self) -> np.ndarray:
        """The last component of y of all points, once they are found."""
        return np.array([point.y[-1] for point in self.points])


Step = tuple[Solution, list[Special], float, str]
"""Point, special points before it, angle, and why the branch ends there or ""."""
Stepper = Callable[[Any, Solution, np.ndarray, float, Limits], Step | None]


def follow(
    curve, start: Solution, limits: Limits, born: bool = False, step: Stepper | None = None
) -> Arc:
    """Follow a branch from a point on it.

    Parameters
    ----------
    curve : Curve
    start : Solution
    limits : Limits
    born : bool
        Whether the branch begins there: then it is followed only along the tangent of `start`,
        otherwise to both sides.
    step : callable, optional
        As `step_of_branch`, the default: takes a step on another kind of curve.
    """
    step = step or step_of_branch
    ahead = _walk(curve, start, limits, step)
    if born or ahead.ends[1] == "closed":
        begin = "birth" if born else "closed"
        return Arc(curve, ahead.points, ahead.specials, (begin, ahead.ends[1]))
    back = _walk(curve, start._replace(tangent=-start.tangent), limits, step)
    points = [turned(point) for point in reversed(back.points[1:])] + ahead.points
    offset, count = len(back.points) - 1, len(back.points)
    specials = [
        (count - place - (special.kind in events.CORNERS), _turned_special(special))
        for place, special in reversed(back.specials)
    ] + [(place + offset, special) for place, special in ahead.specials]
    return Arc(curve, points, specials, (back.ends[1], ahead.ends[1]))


def turned(point: Solution) -> Solution:
    """Return the same point with reversed direction of the branch."""
    return point._replace(tangent=-point.tangent)


def _turned_special(special: Special) -> Special:
    return special._replace(at=turned(special.at), change=tuple(-c for c in special.change))


def _walk(curve, start: Solution, limits: Limits, take: Stepper) -> Arc:
    """Follow a branch from a point on it along its tangent."""
    arc = Arc(curve, [start])
    step, last, bend = limits.largest / 8, start, np.zeros_like(start.y)
    why = "most steps"
    while len(arc.points) <= limits.most_steps:
        taken = take(curve, last, bend, step, limits)
        if taken is None:
            step *= 0.5
            if step < limits.smallest:
                grazes = take is step_of_branch and _grazes(curve, last)
                why = "grazing" if grazes else "not followed on"
                break
            continue
        point, specials, angle, end = taken
        share, shift = passes_start(curve.sizes, start, last, point)
        jumps = length(point.y - last.y) > 2.0 * limits.largest  # see `borders`
        if share > 0.0 and len(arc.points) > 2 and not jumps:
            point, end = _shifted(curve, start, shift), "closed"
            specials = [special for special in specials if special.fraction <= share]
        for special in specials:
            if special.kind in events.CORNERS:
                arc.points.append(special.at)
                arc.specials.append((len(arc.points) - 1, special))
            else:
                arc.specials.append((len(arc.points), special))
        if point is not last:
            arc.points.append(point._replace(inverse=None))
        if end == "halving":  # there the branch turns round, which rounding can show as a fold
            arc.specials = [
                (place, special)
                for place, special in arc.specials
                if special.kind is not Kind.FOLD or np.abs(special.at.y - last.y).max() > COLLAPSED
            ]
        if end:
            why = end
            break
        bend = (point.tangent - last.tangent) / length(point.y - last.y)
        last = point
        step *= min(GROWTH, ANGLE / max(angle, 1e-12))
        step = min(max(step, limits.smallest), limits.largest)
    arc.ends = ("", why)
    return arc


def step_of_branch(
    curve: Curve,
    last: Solution,
    bend: np.ndarray,
    step: float,
    limits: Limits,
    point: Solution | None = None,
) -> Step | None:
    """Take a step, to `point` or along a tangent that turns by `bend` a length; None if too far."""
    try:
        ahead = ahead_of(last, bend, step)
        point = point or sought(curve, last, ahead, step)
        angle = angle_of(last, ahead, point, step)
        if angle is None:
            return None
        if collapses(curve, last, point):
            return None if step > COLLAPSED else (last, [], 0.0, "halving")
        value, end = curve.split(point.y)[1], ""
        if not limits.low <= value <= limits.high:
            border = limits.low if value < limits.low else limits.high
            share = (border / curve.scale - last.y[-1]) / (point.y[-1] - last.y[-1])
            points = curve.split(last.y + share * (point.y - last.y))[0]
            way = np.sign(point.tangent[-1])
            point, end = solve_at(curve, points, border), "end of the span"
            if point.tangent[-1] * way < 0:
                point = turned(point)
            if not length(point.y - last.y) > 0:
                return last, [], 0.0, end
        elif largest(point.y[:-1]) > limits.reach:
            end = "out of reach"
        specials = special_points(curve, last, point)
    except ArithmeticError:  # not converged, or the map has no image
        return None
    # a step that jumps to a branch nearby seems to cross it
    crosses = any(special.kind is Kind.BRANCH_POINT for special in specials)
    if _has_pole(specials) or (step > COLLAPSED and crosses):
        return None
    if not _explained(specials, last, point) and step > 16 * limits.smallest:
        return None
    return point, specials, angle, end


def ahead_of(last: Solution, bend: np.ndarray, step: float) -> np.ndarray:
    """Return where a step leads along a tangent that turns by `bend` a length."""
    return last.y + step * (last.tangent + 0.5 * step * bend)


def sought(curve: Curve, last: Solution, ahead: np.ndarray, step: float) -> Solution:
    """Return the point of a curve where a step from another one leads."""
    reached = min(ON_A_STEP, max(OF_A_STEP * step, MIN_MOVE))
    return curve.solve(ahead, curve.border(last.tangent), last, reached)


def _grazes(curve: Curve, last: Solution) -> bool:
    """Return whether a contact closes, or closes no more, just ahead of a point."""
    try:
        ahead = curve.map.signature(*curve.split(last.y + GRAZES * last.tangent))
        return ahead != curve.signature(last)
    except ArithmeticError:
        return False


def _explained(specials: list[Special], last: Solution, point: Solution) -> bool:
    """Return whether special points explain how many multipliers leave the unit circle, or enter.

    Outside it a complex pair can take the place of two real ones, but not on the step of a special
    point: there a neutral saddle may hide a torus.
    """
    kinds = [special.kind for special in specials]
    real, paired = (b - a for a, b in zip(last.maps.outside, point.maps.outside, strict=True))
    n_real, n_pairs = sum(kind in events.REAL for kind in kinds), kinds.count(Kind.TORUS)
    if n_real + n_pairs == 0:
        return real + paired == 0
    return abs(real) <= n_real and abs(paired) <= 2 * n_pairs


def _has_pole(specials: list[Special]) -> bool:
    """Return whether a multiplier goes from +infinity to -infinity among special points."""
    flips = [special.fraction for special in specials if special.kind is Kind.DOUBLING]
    folds = [
        special.fraction for special in specials if special.kind in (Kind.FOLD, Kind.BRANCH_POINT)
    ]
    return any(abs(flip - fold) <= 2.0 * events.PRECISION for flip in flips for fold in folds)


def angle_of(last: Solution, guess: np.ndarray, point: Solution, step: float) -> float | None:
    """Return the angle by which a step turns the tangent, None if it is too long."""
    angle = math.acos(min(float(point.tangent.dot(last.tangent)), 1.0))
    astray = length(point.y - guess) > ASTRAY * step
    return None if angle > MAX_ANGLE or astray else angle


def on_cubic(
    first: Solution, last: Solution, component: int, value: float
) -> tuple[np.ndarray, float]:
    """Return y where one component of it, monotone between two points, has a value; and the share.

    Between them a curve is Hermite's cubic through both, with their tangents.
    """
    from scipy.optimize import brentq  # reading results does not need it

    chord = length(last.y - first.y)
    rows = first.y, last.y, chord * first.tangent, chord * last.tangent
    along = [float(row[component]) for row in rows]
    s = float(brentq(lambda s: events.cubic(s, *along) - value, 0.0, 1.0))
    return events.cubic(s, *rows), s


def _shifted(curve, point: Solution, shift: int) -> Solution:
    """Return the same orbit, its points counted from another one of them."""
    y, tangent = (_counted_from(each, shift, curve.sizes) for each in (point.y, point.tangent))
    maps = TangentMaps(np.roll(point.maps.matrices, -shift, axis=0))
    return point._replace(y=y, tangent=tangent, maps=maps, inverse=None)


def passes_start(
    sizes: tuple[int, int], start: Solution, last: Solution, point: Solution
) -> tuple[float, int]:
    """Find where a step passes the start of the branch.

    A branch is closed where it comes back to the orbit from which it began, from whichever of its
    points that is counted: the curve of the chains goes round as many times more. Between two
    points the branch is a parabola, as far as the chord's sag.

    Returns
    -------
    share : float
        Of the step, 0 if it does not.
    shift : int
        Number of the start's point that is counted first.
    """
    n, size = sizes
    step = point.y - last.y
    square = float(step.dot(step))
    for shift in range(n // size):
        away = _counted_from(start.y, shift, sizes) - last.y
        share = float(away.dot(step))
        if 0.0 < share <= square:
            sag = max(0.25 * length(point.tangent - last.tangent), CLOSED)
            along = _counted_from(start.tangent, shift, sizes) @ step
            near = away @ away - share**2 / square <= sag**2 * square
            if near and along >= 0.5 * math.sqrt(square):
                return share / square, shift
    return 0.0, 0


def _counted_from(vector: np.ndarray, shift: int, sizes: tuple[int, int]) -> np.ndarray:
    """Return y, or a tangent, of the same orbit, its points counted from another one of them."""
    n, size = sizes
    first = shift * size
    return np.concatenate((vector[first:n], vector[:first], vector[n:])) if shift else vector


def collapses(curve, last: Solution, point: Solution) -> bool:
    """Return whether an orbit passes, between two points, one of a period that divides its own.

    Or whether it comes to lie on the branch of that, whose orbits solve the same equations.
    """
    n, _ = curve.sizes
    for prime in PRIMES:
        if curve.period % prime == 0:
            before, now = (x[:n] - np.roll(x[:n], n // prime) for x in (last.y, point.y))
            if before @ now < ON_DIVISOR * (before @ before):
                return True
    return False
