r"""Find the special points of a branch between two neighbouring points, and locate them.

With the multipliers mu of the orbit and the tangent t of the branch,

- a *fold*: the component of t along the parameter changes its sign;
- a *period doubling*: prod (1 + mu) does, so that a real multiplier passes -1;
- a *torus* (Neimark-Sacker): prod over pairs (1 - mu_i mu_j) does, and the pair is complex (a real
  pair of product 1 is a neutral saddle, and nothing happens);
- a *branch point*: prod (1 - mu) and the component along the parameter do not change their signs
  together, as they do at a fold;
- a *grazing*: the signature, which counts the impacts, changes;
- a *slip*: that changes in the excursions of sliders (`hpcsweep.dynamics.continuation.borders`);
- a *chatter*: a rigid contact comes to rest in infinitely many impacts on one side alone.

All are functions along the arc, found by false position, the last one by bisection; each evaluation
is a point of the branch. A point is known to about `PRECISION` of the step.
"""

import contextlib
import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution, length
from hpcsweep.dynamics.stability import TangentMaps

PRECISION = 1e-12
BISECTIONS, MOVES = 44, 100
FALLS = 1e-2
SINGULAR, BESIDE = 1e-2, 1e-4
"""Length of a chord on which a branch point is interpolated: next to one the Jacobian is singular,
and rounding can be all that Newton's method finds; and how far beside it, from both sides."""
COMPLEX = 1e-6
"""Imaginary part from which a multiplier is no real one, and distance from the unit circle up to
which it is on it."""


class Kind(IntEnum):
    """Kinds of special points."""

    FOLD = 1
    DOUBLING = 2
    TORUS = 3
    BRANCH_POINT = 4
    GRAZING = 5
    SLIP = 6
    CHATTER = 7


CORNERS = Kind.FOLD, Kind.SLIP
"""Special points that are points of the branch, since the parameter may turn there."""
REAL = Kind.FOLD, Kind.DOUBLING, Kind.BRANCH_POINT
"""Special points at which one real multiplier crosses the unit circle; at a torus a pair does."""


class Special(NamedTuple):
    """A special point.

    Attributes
    ----------
    kind : Kind, or on a locus Meeting
    at : Solution
    fraction : float
        Position between its two neighbouring points, from 0 to 1.
    change : tuple of int
        At a grazing, the change of the signature along the branch; otherwise ().
    criticality : int
        1 if the orbits of twice the period are on the side where these are unstable
        (supercritical), -1 if they are where they are stable (subcritical), 0 if unknown.
    leaving : Solution or None
        An orbit on the branch that leaves at a doubling or a branch point, if one was found.
    leads_to : int
        Number of that branch in a catalogue, -1 for none.
    """

    kind: Any
    at: Solution
    fraction: float
    change: tuple[int, ...] = ()
    criticality: int = 0
    leaving: Solution | None = None
    leads_to: int = -1


def n_unstable(multipliers: np.ndarray) -> int:
    """Count the multipliers outside the unit circle."""
    return int((np.abs(multipliers) > 1.0).sum())


def cubic(s: float, first, last, first_slope, last_slope):
    """Evaluate Hermite's cubic at s from 0 to 1."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * first + s * first_slope) + s * s * (
        (1.0 + 2.0 * r) * last - r * last_slope
    )


def special_points(curve: Curve, first: Solution, last: Solution) -> list[Special]:
    """Find the special points between two neighbouring points of a branch, in their order.

    Raises
    ------
    NotConvergedError
        If the branch between the two cannot be followed: they are too far apart.
    """
    specials = []
    for kind, test in FUNCTIONS.items():
        if (test(first) < 0) != (test(last) < 0):
            singular = SINGULAR if kind is Kind.BRANCH_POINT else 0.0
            at, fraction = locate(curve, first, last, test, singular=singular)
            if kind is not Kind.TORUS or on_unit_circle(at.multipliers):
                specials.append(Special(kind, at, fraction))
    precision = PRECISION / min(1.0, length(last.y - first.y))
    specials += grazings(curve, first, last, Kind.GRAZING, precision)
    return sorted(specials, key=lambda special: special.fraction)


FUNCTIONS: dict[Kind, Callable[[Solution], float]] = {
    Kind.FOLD: lambda point: float(point.tangent[-1]),
    Kind.BRANCH_POINT: lambda point: point.tests.fold * math.copysign(1.0, point.tangent[-1]),
    Kind.DOUBLING: lambda point: point.tests.doubling,
    Kind.TORUS: lambda point: point.tests.torus,
}
"""Functions that vanish at special points of a branch."""


class Chord:
    """Points of a curve near the chord between two of its points, each sought from the one before.

    The first one from the cubic through both ends: the tangent of the last may lead to another
    branch from there.
    """

    def __init__(self, curve: Curve, first: Solution, last: Solution):
        self._curve, self._first, self._last, self.near = curve, first, last, last
        self._chord = last.y - first.y
        self.length = float(np.linalg.norm(self._chord))
        self._border = curve.border(self._chord / self.length, first.tangent, last.tangent)

    def ahead(self, fraction: float) -> np.ndarray:
        """Predict y at a fraction of the chord."""
        first, last, near = self._first, self._last, self.near
        on, way = near.y, near.tangent
        if near is last:
            slopes = self.length * first.tangent, self.length * last.tangent
            on, way = cubic(fraction, first.y, last.y, *slopes), self._border
        off = first.y + fraction * self._chord - on
        predicted: np.ndarray = on + self._border.dot(off) / self._border.dot(way) * way
        return predicted

    def along(self, fraction: float, keeps: bool = False) -> Solution:
        """Move to a fraction of the chord; `keeps`: with the Jacobian of the point before."""
        keeps = keeps and self.near is not self._last
        self.near = self._curve.solve(self.ahead(fraction), self._border, self.near, keeps=keeps)
        return self.near


def locate(
    curve: Curve,
    first: Solution,
    last: Solution,
    test: Callable[[Solution], float],
    precision: float = PRECISION,
    singular: float = 0.0,
) -> tuple[Solution, float]:
    """Find where a function of the points of a curve changes its sign between two of them.

    By the rule of false position with the weights of Anderson and Bjorck (BIT 13 (1973) 253), of
    order 1.7: where moves fall as fast as `FALLS`, what is left is less than their product. It
    takes 7 points where Brent's method, which closes in from both sides, takes 12. Return the
    point, and its fraction of the chord, which is known to `precision`; where Newton's method does
    not converge, on a chord of the length `singular` at most, both by interpolation.
    """
    chord, (low, high), move = Chord(curve, first, last), (0.0, 1.0), 1.0
    low_value, high_value = test(first), test(last)
    for _ in range(MOVES):
        place = high - high_value * (high - low) / (high_value - low_value)
        before, move = move, abs(place - high)
        try:
            point = chord.along(place)
        except NotConvergedError:
            if chord.length > singular:
                raise
            whole = Chord(curve, first, last)
            y = whole.ahead(place)
            with contextlib.suppress(NotConvergedError):
                y = _root_beside(curve, whole, place, test)
            return last._replace(y=y), place
        value = test(point)
        if (value < 0) != (high_value < 0):
            low, low_value = high, high_value
        else:
            rest = 1.0 - value / high_value if high_value else 0.0
            low_value *= rest if rest > 0.0 else 0.5
        high, high_value = place, value
        falls = move <= FALLS * before and move * before <= precision
        if value == 0.0 or move <= precision or falls:
            return point, place
    raise NotConvergedError("no point on a chord")


def _root_beside(
    curve: Curve, chord: Chord, near: float, test: Callable[[Solution], float]
) -> np.ndarray:
    """Return y where a function of a chord vanishes, by its inverse from four points beside.

    Their tangent maps are taken anew: those of Newton's method are of before its last move.
    """
    away = BESIDE / chord.length
    points = [chord.along(near + share * away) for share in (-1.0, -0.5, 0.5, 1.0)]
    maps = [TangentMaps(curve.linearise(point.y)[1]) for point in points]
    values = np.array([test(p._replace(maps=m)) for p, m in zip(points, maps, strict=True)])
    others = [np.delete(values, i) for i in range(len(values))]
    shares = [np.prod(o / (o - value)) for o, value in zip(others, values, strict=True)]
    return np.array(shares) @ np.array([point.y for point in points])


def locate_change(
    curve: Curve,
    first: Solution,
    last: Solution,
    label: Callable[[Solution], tuple],
    low: float,
    before: tuple,
    precision: float = PRECISION,
) -> tuple[Solution, float, tuple]:
    """Find by bisection where a label of the points of a curve is no longer `before`.

    It is that at the fraction `low` of the chord, and another at its end. Return the point on the
    far side, its fraction, and its label.
    """
    chord, high, after = Chord(curve, first, last), 1.0, label(last)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high or high - low <= precision:
            break
        there = label(chord.along(middle, True))
        if there == before:
            low = middle
        else:
            high, after = middle, there
    return last if high == 1.0 else chord.along(high), high, after


def on_unit_circle(multipliers: np.ndarray) -> bool:
    """Return whether the multipliers nearest to the unit circle are a complex pair on it."""
    nearest = multipliers[np.argmin(np.abs(np.abs(multipliers) - 1.0))]
    return bool(abs(abs(nearest) - 1.0) < COMPLEX < abs(nearest.imag))


def grazings(
    curve: Curve, first: Solution, last: Solution, kind: Any, precision: float
) -> list[Special]:
    """Find where the signature changes between two points."""
    specials: list[Special] = []
    low, before, end = 0.0, curve.signature(first), curve.signature(last)
    while before != end:
        at, low, after = locate_change(curve, first, last, curve.signature, low, before, precision)
        change = tuple(b - a for a, b in zip(before, after, strict=True))
        specials.append(Special(kind, at, low, change))
        before = after
    return specials
