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
    found += _grazings(curve, first, last)
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


def _located(
    curve: Curve, first: Solution, last: Solution, test, ends: tuple[float, float]
) -> tuple[Solution, float]:
    """Find where a function vanishes between two points, by kernels where that is possible."""
    tracer = curve.tracer
    if tracer is None or 0.0 in ends:
        return locate(curve, first, last, lambda point: test(_read(point)))

    def value(fraction: float) -> float:
        found = tracer.along(fraction)
        if found is None:
            raise NotConvergedError("no point on a chord")
        return test(found)

    tracer.begin_chord(first, last)
    try:
        fraction = _root(value, *ends, PRECISION)
        if fraction != tracer.fraction:
            value(fraction)
    except NotConvergedError:  # or a product of tangent maps without the digits of its multipliers
        return locate(curve, first, last, lambda point: test(_read(point)))
    return tracer.point(), fraction


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
    at, place = last, 1.0

    def value(fraction: float) -> float:
        nonlocal at, place
        at, place = between(curve, first, last, fraction, at), fraction
        return test(at)

    fraction = _root(value, test(first), test(last), precision)
    if fraction != place:
        at = between(curve, first, last, fraction, at)
    return at, fraction


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
    near = last

    def label_at(fraction: float) -> tuple:
        nonlocal near
        near = between(curve, first, last, fraction, near, near is not last)
        return label(near)

    high, after = _bisected(label_at, low, own, label(last), precision)
    at = last if high == 1.0 else between(curve, first, last, high, near)
    return at, high, after


def _bisected(
    label_at: Callable[[float], tuple], low: float, own: tuple, after: tuple, precision: float
) -> tuple[float, tuple]:
    """Return up to where, from 1 where it is `after`, a label is no longer `own`; and that there.

    It is `own` at `low`.
    """
    high = 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high or high - low <= precision:
            break
        seen = label_at(middle)
        if seen == own:
            low = middle
        else:
            high, after = middle, seen
    return high, after


def on_unit_circle(multipliers: np.ndarray) -> bool:
    """Return whether the multipliers nearest to the unit circle are a complex pair on it."""
    nearest = multipliers[np.argmin(np.abs(np.abs(multipliers) - 1.0))]
    return bool(abs(abs(nearest) - 1.0) < COMPLEX < abs(nearest.imag))


def _grazings(curve: Curve, first: Solution, last: Solution) -> list[Special]:
    found: list[Special] = []
    low, own, end = 0.0, curve.signature(first), curve.signature(last)
    precision = PRECISION / min(1.0, float(np.linalg.norm(last.y - first.y)))
    while own != end:
        at, low, after = _changed(curve, first, last, low, own, end, precision)
        change = tuple(b - a for a, b in zip(own, after, strict=True))
        found.append(Special(Kind.GRAZING, at, low, change))
        own = after
    return found


def _changed(
    curve: Curve,
    first: Solution,
    last: Solution,
    low: float,
    own: tuple,
    end: tuple,
    precision: float,
) -> tuple[Solution, float, tuple]:
    """Find where the signature is no longer `own`, by kernels where that is possible."""
    tracer = curve.tracer
    if tracer is None:
        return locate_change(curve, first, last, curve.signature, low, own, precision)

    def label_at(fraction: float) -> tuple:
        found = tracer.along(fraction, counts=True)
        if found is None:
            raise NotConvergedError("no point on a chord")
        return found

    tracer.begin_chord(first, last)
    high, after = _bisected(label_at, low, own, end, precision)
    if high == 1.0:
        return last, high, after
    tracer.along(high)
    at = tracer.point()
    if at is None:
        raise NotConvergedError("no point on a chord")
    return at, high, after


def _root(function: Callable[[float], float], first: float, last: float, precision: float) -> float:
    """Return where a function on [0, 1] with known end values changes its sign."""
    from scipy.optimize import brentq  # takes a while to load

    ends = {0.0: first, 1.0: last}
    if first == 0.0 or last == 0.0:
        return 0.0 if first == 0.0 else 1.0
    try:
        return float(brentq(lambda s: ends.get(s) or function(s), 0.0, 1.0, xtol=precision))
    except (RuntimeError, ValueError) as error:
        raise NotConvergedError(str(error)) from None
