r"""Find the special points of a branch between two neighbouring points, and locate them.

With the multipliers mu of the orbit and the tangent t of the branch,

- a *fold*: the component of t along the parameter changes its sign;
- a *period doubling*: prod (1 + mu) does, so that a real multiplier passes -1;
- a *torus* (Neimark-Sacker): prod over pairs (1 - mu_i mu_j) does, and the pair is complex (a real
  pair of product 1 is a neutral saddle, and nothing happens);
- a *branch point*: prod (1 - mu) and the component along the parameter do not change their signs
  together, as they do at a fold;
- a *grazing*: the signature, which counts the impacts, changes.

All are functions along the arc, found by Brent's method, the last one by bisection; each evaluation
is a point of the branch. A point is known to about `PRECISION` of the step.
"""

import contextlib
from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution

PRECISION = 1e-12
BISECTIONS = 44
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


class Tests(NamedTuple):
    """Functions of a point's multipliers that vanish at special points.

    Attributes
    ----------
    fold : float
        prod (1 - mu) / (1 + |mu|).
    doubling : float
        prod (1 + mu) / (1 + |mu|).
    torus : float
        Product over pairs of (1 - mu_i mu_j) / (1 + |mu_i mu_j|).
    """

    fold: float
    doubling: float
    torus: float


def tests_of(point: Solution) -> Tests:
    """Evaluate the functions that vanish at special points."""
    return tests_of_multipliers(point.multipliers.tolist())  # Python numbers: there are few


def tests_of_multipliers(multipliers: list[complex]) -> Tests:
    """Evaluate the functions for some multipliers."""
    fold = doubling = torus = complex(1.0)
    for i, mu in enumerate(multipliers):
        size = 1.0 + abs(mu)
        fold *= (1.0 - mu) / size
        doubling *= (1.0 + mu) / size
        for other in multipliers[:i]:
            pair = mu * other
            torus *= (1.0 - pair) / (1.0 + abs(pair))
    return Tests(fold.real, doubling.real, torus.real)


def n_unstable(multipliers: np.ndarray) -> int:
    """Count the multipliers outside the unit circle."""
    return int((np.abs(multipliers) > 1.0).sum())


def between(
    curve: Curve,
    first: Solution,
    last: Solution,
    fraction: float,
    near: Solution | None = None,
    corrects: bool = False,
) -> Solution:
    """Find the point at a fraction of the chord between two points.

    The point is sought along the tangent of `near`, a third point, if given; `corrects` if that was
    found by this function, so that its Jacobian is kept. If `near` is `last`, it is sought from the
    cubic through both ends: the tangent may lead to another branch from there.
    """
    chord = last.y - first.y
    border = curve.border(chord / np.linalg.norm(chord), first.tangent, last.tangent)
    guess = first.y + fraction * chord
    if near is last:
        size = np.linalg.norm(chord)
        on = cubic(fraction, first.y, last.y, size * first.tangent, size * last.tangent)
        guess = on + border @ (guess - on) / (border @ border) * border
    elif near is not None:
        guess = near.y + border @ (guess - near.y) / (border @ near.tangent) * near.tangent
    if near is not None and corrects:
        return curve.correct(guess, border, near)
    return curve.solve(guess, border, near)


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
    found = []
    one, other = _read(first), _read(last)
    for kind, test in FUNCTIONS.items():
        ends = test(one), test(other)
        if (ends[0] < 0) != (ends[1] < 0):
            at, fraction = _located(curve, first, last, test, ends)
            if kind is not Kind.TORUS or on_unit_circle(at.multipliers):
                found.append(Special(kind, at, fraction))
    precision = PRECISION / min(1.0, float(np.linalg.norm(last.y - first.y)))
    found += grazings(curve, first, last, Kind.GRAZING, precision)
    return sorted(found, key=lambda one: one.fraction)


Reading = tuple[float, float, float, float]
"""Component of the tangent along the parameter, and the values of `Tests`."""
FUNCTIONS: dict[Kind, Callable[[Reading], float]] = {
    Kind.FOLD: lambda read: read[0],
    Kind.BRANCH_POINT: lambda read: read[1] * np.sign(read[0]),
    Kind.DOUBLING: lambda read: read[2],
    Kind.TORUS: lambda read: read[3],
}
"""Functions that vanish at special points of a branch."""


def _read(point: Solution) -> Reading:
    return float(point.tangent[-1]), *tests_of(point)


class Chord:
    """Points of a curve near the chord between two of its points, each sought from the one before.

    As of a curve's tracer (`begin_chord`), which gives readings of points or signatures for points.
    """

    def __init__(self, curve: Curve, first: Solution, last: Solution):
        self._ends, self._point, self.fraction = (curve, first, last), last, 1.0

    def along(self, fraction: float, counts: bool = False) -> Solution:
        """Move to a fraction of the chord; `counts`: with the Jacobian of the point before."""
        corrects = counts and self._point is not self._ends[2]
        self._point = between(*self._ends, fraction, self._point, corrects)
        self.fraction = fraction
        return self._point

    def point(self) -> Solution:
        """Return the point to which a move has led."""
        return self._point


def _need(found: Any) -> Any:
    if found is None:
        raise NotConvergedError("no point on a chord")
    return found


def _located(
    curve: Curve, first: Solution, last: Solution, test, ends: tuple[float, float]
) -> tuple[Solution, float]:
    """Find where a function vanishes between two points, by kernels where that is possible."""
    tracer = curve.tracer
    if tracer is not None and 0.0 not in ends:
        tracer.begin_chord(first, last)
        # there may be no point, or a product of tangent maps without its multipliers' digits
        with contextlib.suppress(NotConvergedError):
            return _root(tracer, test, ends, PRECISION)
    return locate(curve, first, last, lambda point: test(_read(point)))


def locate(
    curve: Curve,
    first: Solution,
    last: Solution,
    test: Callable[[Solution], float],
    precision: float = PRECISION,
) -> tuple[Solution, float]:
    """Find where a function of the points of a curve vanishes between two of them.

    Return the point, and its fraction of the chord, which is known to `precision`.
    """
    return _root(Chord(curve, first, last), test, (test(first), test(last)), precision)


def _root(
    chord: Any, test: Callable[[Any], float], ends: tuple[float, float], precision: float
) -> tuple[Solution, float]:
    """Return the point of a chord where a function with known end values changes its sign."""
    from scipy.optimize import brentq  # takes a while to load

    known = dict(zip((0.0, 1.0), ends, strict=True))
    if 0.0 in ends:
        fraction = float(ends.index(0.0))
    else:
        try:
            fraction = float(
                brentq(
                    lambda s: known.get(s) or test(_need(chord.along(s))), 0.0, 1.0, xtol=precision
                )
            )
        except (RuntimeError, ValueError) as error:
            raise NotConvergedError(str(error)) from None
    if fraction != chord.fraction:
        _need(chord.along(fraction))
    return chord.point(), fraction


def locate_change(
    curve: Curve,
    first: Solution,
    last: Solution,
    label: Callable[[Solution], tuple],
    low: float,
    own: tuple,
    precision: float = PRECISION,
) -> tuple[Solution, float, tuple]:
    """Find by bisection where a label of the points of a curve is no longer `own`.

    It is that at the fraction `low` of the chord, and another at its end. Return the point on the
    far side, its fraction, and its label.
    """
    return _change(Chord(curve, first, last), last, label, low, own, label(last), precision)


def _change(
    chord: Any,
    last: Solution,
    label: Callable[[Any], tuple],
    low: float,
    own: tuple,
    after: tuple,
    precision: float,
) -> tuple[Solution, float, tuple]:
    """Find by bisection where a label is no longer `own`; at the end of the chord it is `after`."""
    high = 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high or high - low <= precision:
            break
        there = label(chord.along(middle, True))
        if there == own:
            low = middle
        else:
            high, after = middle, there
    if high == 1.0:
        return last, high, after
    chord.along(high)
    return _need(chord.point()), high, after


def on_unit_circle(multipliers: np.ndarray) -> bool:
    """Return whether the multipliers nearest to the unit circle are a complex pair on it."""
    nearest = multipliers[np.argmin(np.abs(np.abs(multipliers) - 1.0))]
    return bool(abs(abs(nearest) - 1.0) < COMPLEX < abs(nearest.imag))


def grazings(
    curve: Curve, first: Solution, last: Solution, kind: Any, precision: float
) -> list[Special]:
    """Find where the signature changes between two points, by kernels where that is possible."""
    specials: list[Special] = []
    low, own, end, tracer = 0.0, curve.signature(first), curve.signature(last), curve.tracer
    while own != end:
        if tracer is None:
            at, low, after = locate_change(curve, first, last, curve.signature, low, own, precision)
        else:
            tracer.begin_chord(first, last)
            at, low, after = _change(tracer, last, _need, low, own, end, precision)
        change = tuple(b - a for a, b in zip(own, after, strict=True))
        specials.append(Special(kind, at, low, change))
        own = after
    return specials
