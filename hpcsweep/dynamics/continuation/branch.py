r"""Follow a branch of periodic orbits by pseudo-arclength, with its special points.

A step goes along the tangent and is corrected across it. Its length follows the angle by which the
tangent turns: `ANGLE` is the target, `LARGEST_ANGLE` is refused. A step is also refused where the
corrected point is farther from the predicted one than `ASTRAY` of the step, or where the number of
unstable multipliers changes by more than the special points found on it explain.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Curve, Solution, solve, solve_at
from hpcsweep.dynamics.continuation.events import (
    CODIMENSION_ONE,
    Kind,
    Special,
    n_unstable,
    special_points,
)

ANGLE = 0.12
LARGEST_ANGLE = 0.5
ASTRAY = 0.5
GROWTH = 2.0
COLLAPSED = 1e-4
"""Step within which an orbit comes to one of a period that divides its own."""
ON_A_STEP = 1e-6
"""Largest last move to an ordinary point of a branch: multipliers are accurate to about that."""
CLOSED = 1e-3
"""Share of a step within which a closed branch comes back to its start."""


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
    smallest: float = 1e-7
    reach: float = 1e3


@dataclass
class Arc:
    """A piece of a branch.

    Attributes
    ----------
    curve : Curve
    points : list of Solution
        In branch order, including folds, so that the parameter is monotone between neighbours.
    specials : list of (int, Special)
        Each with the index in `points` of the point after it, a fold with its own index.
    ends : (str, str)
        Why it stops at its beginning and at its end.
    """

    curve: Curve
    points: list[Solution]
    specials: list[tuple[int, Special]] = field(default_factory=list)
    ends: tuple[str, str] = ("", "")

    @cached_property
    def heights(self) -> np.ndarray:
        """The last component of y of all points, once they are found."""
        return np.array([one.y[-1] for one in self.points])


def follow(curve: Curve, start: Solution, limits: Limits, born: bool = False) -> Arc:
    """Follow a branch from a point on it.

    Parameters
    ----------
    curve : Curve
    start : Solution
    limits : Limits
    born : bool
        Whether the branch begins there: then it is followed only along the tangent of `start`,
        otherwise to both sides.
    """
    ahead = _walk(curve, start, limits)
    if born or ahead.ends[1] == "closed":
        begin = "birth" if born else "closed"
        return Arc(curve, ahead.points, ahead.specials, (begin, ahead.ends[1]))
    back = _walk(curve, start._replace(tangent=-start.tangent), limits)
    points = [turned(point) for point in reversed(back.points[1:])] + ahead.points
    offset, count = len(back.points) - 1, len(back.points)
    specials = [
        (count - place - (one.kind is Kind.FOLD), _turned_special(one))
        for place, one in reversed(back.specials)
    ] + [(place + offset, one) for place, one in ahead.specials]
    return Arc(curve, points, specials, (back.ends[1], ahead.ends[1]))


def turned(point: Solution) -> Solution:
    """Return the same point with reversed direction of the branch."""
    return point._replace(tangent=-point.tangent)


def _turned_special(one: Special) -> Special:
    change = tuple(-c for c in one.change)
    return one._replace(at=turned(one.at), change=change)


def _walk(curve: Curve, start: Solution, limits: Limits) -> Arc:
    """Follow a branch from a point on it along its tangent."""
    arc = Arc(curve, [start])
    starts = [_shifted(curve, start, shift) for shift in range(curve.period)]
    step, last, bend = limits.largest / 8, start, np.zeros_like(start.y)
    why = "most steps"
    while len(arc.points) <= limits.most_steps:
        found = _step(curve, last, bend, step, limits)
        if found is None:
            step *= 0.5
            if step < limits.smallest:
                why = "not followed on"
                break
            continue
        point, specials, angle, end = found
        passed = [(one, share) for one in starts if (share := _passes(one, last, point)) > 0.0]
        if passed and len(arc.points) > 2:
            (point, share), end = passed[0], "closed"
            specials = [one for one in specials if one.fraction <= share]
        for one in specials:
            if one.kind is Kind.FOLD:
                arc.points.append(one.at)
                arc.specials.append((len(arc.points) - 1, one))
            else:
                arc.specials.append((len(arc.points), one))
        if point is not last:
            arc.points.append(point._replace(inverse=None))
        if end:
            why = end
            break
        bend = (point.tangent - last.tangent) / np.linalg.norm(point.y - last.y)
        last = point
        step *= min(GROWTH, ANGLE / max(angle, 1e-12))
        step = min(max(step, limits.smallest), limits.largest)
    arc.ends = ("", why)
    return arc


def _step(curve: Curve, last: Solution, bend: np.ndarray, step: float, limits: Limits):
    """Take one step along the tangent, which turns by `bend` per length.

    Return point, specials, angle and why the branch ends there, or None if the step is too long.
    """
    try:
        guess = last.y + step * (last.tangent + 0.5 * step * bend)
        point = solve(curve, guess, last.tangent, last, ON_A_STEP)
        angle = float(np.arccos(min(float(point.tangent @ last.tangent), 1.0)))
        if angle > LARGEST_ANGLE or np.linalg.norm(point.y - guess) > ASTRAY * step:
            return None
        if _collapses(curve, last, point):
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
            if not np.linalg.norm(point.y - last.y) > 0:
                return last, [], 0.0, end
        elif np.abs(point.y[:-1]).max() > limits.reach:
            end = "out of reach"
        specials = special_points(curve, last, point)
    except ArithmeticError:  # not converged, or the map has no image
        return None
    explained = sum(CODIMENSION_ONE.get(one.kind, 0) for one in specials)
    change = abs(n_unstable(point.multipliers) - n_unstable(last.multipliers))
    if change > explained and step > 16 * limits.smallest:
        return None
    return point, specials, angle, end


def _shifted(curve: Curve, point: Solution, shift: int) -> Solution:
    """Return the same orbit, its points counted from another one of them."""
    turn, n = shift * curve.map.size, point.y.size - 1

    def turned_by(vector: np.ndarray) -> np.ndarray:
        return np.append(np.roll(vector[:n], -turn), vector[n])

    matrices = np.roll(point.matrices, -shift, axis=0)
    y, tangent = turned_by(point.y), turned_by(point.tangent)
    return point._replace(y=y, tangent=tangent, matrices=matrices, inverse=None)


def _passes(start: Solution, last: Solution, point: Solution) -> float:
    """Return where a step from `last` to `point` passes the start of the branch, 0 if nowhere.

    A branch is closed where it comes back to the orbit from which it began, from whichever of its
    points that is counted: the curve of the chains goes round as many times more.
    """
    step = point.y - last.y
    length = float(np.linalg.norm(step))
    if length == 0.0:
        return 0.0
    share = float((start.y - last.y) @ step) / length**2
    if not 0.0 < share <= 1.0 or float(start.tangent @ step) < 0.5 * length:
        return 0.0
    # a parabola between the two points, as far as the chord's sag
    sag = 0.25 * length * float(np.linalg.norm(point.tangent - last.tangent))
    away = float(np.linalg.norm(start.y - last.y - share * step))
    return share if away <= max(sag, CLOSED * length) else 0.0


def _collapses(curve: Curve, last: Solution, point: Solution) -> bool:
    """Return whether an orbit passes, between two points, one of a period that divides its own."""
    for prime in (2, 3, 5, 7):
        if curve.period % prime == 0:
            shift = curve.period // prime
            before, after = (curve.split(one.y)[0] for one in (last, point))
            first, second = (x - np.roll(x, shift, axis=0) for x in (before, after))
            if (first * second).sum() < 0:
                return True
    return False
