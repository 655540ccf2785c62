r"""Curves of special points in the plane of two parameters: each once, and where they meet.

A catalogue knows all special points at one value of the second parameter, on a line of the plane.
Each is taken in turn: if a curve followed before passes it, which is tested by finding the point of
that curve on the line, it is on that curve; otherwise its curve is followed.

Along the locus of a kind the multiplier, or the pair, that it is about is set aside. Those that
remain pass 1, -1 or the unit circle where it meets the locus of another kind. A second multiplier
that passes 1 on a locus of folds, or -1 on one of doublings, is a strong resonance, 1:1 or 1:2, and
so is a pair of a torus that becomes real, where the locus ends; at 1:3 and 1:4 the angle of the
pair is 120 and 90 degrees (Kuznetsov, Elements of Applied Bifurcation Theory, ch. 9). A locus of
folds turns back in a cusp, where its tangent has no component along the parameters. Where the
signature changes a contact grazes.
"""

from collections.abc import Callable, Collection
from enum import Enum
from functools import partial
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation import events
from hpcsweep.dynamics.continuation.branch import Arc, Limits, Step, angle_of, collapses, follow
from hpcsweep.dynamics.continuation.catalogue import Catalogue, passes
from hpcsweep.dynamics.continuation.cycle import Map, Solution
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.locus import Locus
from hpcsweep.dynamics.stability import Tests

PRECISION, ROUGH = 1e-10, 1e-6
"""Share of a step to which a meeting is located, and a change of the signature."""
SAME = 1e-6
"""Distance of special points that count as the same, in units of y."""
SMALLEST = 1e-7
"""Step from which a curve is not followed on, in units of y."""
SHORTEST = 3
"""Points for which a curve needs room."""
KINDS = {kind.name.lower(): kind for kind in (Kind.FOLD, Kind.DOUBLING, Kind.TORUS, Kind.GRAZING)}
"""Special points that have a curve in the plane, by name."""


class Meeting(Enum):
    """Ends and meetings of loci."""

    CUSP = "cusp"
    RESONANCE_1 = "resonance 1:1"
    RESONANCE_2 = "resonance 1:2"
    RESONANCE_3 = "resonance 1:3"
    RESONANCE_4 = "resonance 1:4"
    FOLD_DOUBLING = "fold-doubling"
    FOLD_TORUS = "fold-torus"
    DOUBLING_TORUS = "doubling-torus"
    DOUBLE_TORUS = "double torus"
    GRAZING_FOLD = "grazing-fold"
    GRAZING_DOUBLING = "grazing-doubling"
    GRAZING_TORUS = "grazing-torus"
    DOUBLE_GRAZING = "double grazing"
    FOLD = "fold"
    DOUBLING = "doubling"
    TORUS = "torus"
    GRAZING = "grazing"


WITH: dict[Kind | None, tuple[Meeting, ...]] = {
    kind: tuple(Meeting(name) for name in names.split(", "))
    for kind, names in {
        Kind.FOLD: "resonance 1:1, fold-doubling, fold-torus, grazing-fold",
        Kind.DOUBLING: "fold-doubling, resonance 1:2, doubling-torus, grazing-doubling",
        Kind.TORUS: "fold-torus, doubling-torus, double torus, grazing-torus",
        Kind.GRAZING: "grazing-fold, grazing-doubling, grazing-torus, double grazing",
        None: "fold, doubling, torus, grazing",
    }.items()
}
"""What meets the locus of a kind, None for a level, where a fold, doubling, torus or grazing is."""
ANGLES = {
    Meeting.RESONANCE_1: 1.0,
    Meeting.RESONANCE_2: -1.0,
    Meeting.RESONANCE_3: -0.5,
    Meeting.RESONANCE_4: 0.0,
}
"""Cosine of the angle of a torus' pair at a resonance."""
ENDS = Meeting.RESONANCE_1, Meeting.RESONANCE_2
Test = Callable[[Solution], float]


def step_of_locus(
    locus: Locus, last: Solution, bend: np.ndarray, step: float, _limits: Limits
) -> Step | None:
    """Take one step along a locus, as `branch.step_of_branch` along a branch."""
    try:
        guess = last.y + step * (last.tangent + 0.5 * step * bend)
        point = locus.solve(guess, last.tangent, last)
        angle = angle_of(last, guess, point, step)
        if angle is None or collapses(locus, last, point):
            return None
        point, end = locus.clipped(last, point)
        if not np.linalg.norm(point.y - last.y) > 0:
            return last, [], 0.0, end
        specials = meetings(locus, last, point)
    except ArithmeticError:  # not converged, or the map has no image
        return None
    for place, special in enumerate(specials):
        if locus.kind is Kind.TORUS and special.kind in ENDS:
            return special.at, specials[: place + 1], angle, special.kind.value
    return point, specials, angle, end


def meetings(locus: Locus, first: Solution, last: Solution) -> list[Special]:
    """Find the ends and meetings between two neighbouring points of a locus, in their order."""
    specials = []
    for meeting, test in _tests(locus.kind, first, last).items():
        if (test(first) < 0) != (test(last) < 0):
            at, fraction = events.locate(locus, first, last, test, PRECISION)
            pair = meeting is WITH[locus.kind][2]
            if not pair or events.on_unit_circle(np.array(others(locus.kind, at.multipliers))):
                specials.append(Special(meeting, at, fraction))
    specials += events.grazings(locus, first, last, WITH[locus.kind][3], ROUGH)
    return sorted(specials, key=lambda special: special.fraction)


def others(kind: Kind | None, multipliers: np.ndarray) -> list[complex]:
    """Return the multipliers without the one, or the pair, that the locus of a kind is about."""
    rest = multipliers.tolist()
    if kind is Kind.TORUS:
        for multiplier in _pair(rest):
            rest.remove(multiplier)
    elif kind in (Kind.FOLD, Kind.DOUBLING):
        at = 1.0 if kind is Kind.FOLD else -1.0
        rest.remove(min(rest, key=lambda mu: abs(mu - at)))
    return rest


def _pair(multipliers: list[complex]) -> tuple[complex, complex]:
    """Return the two multipliers whose product is nearest to 1."""
    pairs = [(multiplier, mu) for i, mu in enumerate(multipliers) for multiplier in multipliers[:i]]
    return min(pairs, key=lambda pair: abs(pair[0] * pair[1] - 1.0))


def _again(at: float, point: Solution) -> float:
    """Return the sum over i of prod_(j != i) (1 - mu_j / at) / (1 + |mu_j|).

    It is the derivative of the characteristic polynomial, scaled: smooth where a second multiplier
    passes the value of the first one.
    """
    factors = (1.0 - point.multipliers / at) / (1.0 + np.abs(point.multipliers))
    return float(sum(np.prod(np.delete(factors, i)) for i in range(factors.size)).real)


def _off_angle(meeting: Meeting, point: Solution) -> float:
    """Return how far the cosine of the angle of a torus' pair is from that of a resonance."""
    multiplier, other = _pair(point.multipliers.tolist())
    return (multiplier + other).real / 2 - ANGLES[meeting]


def _tests(kind: Kind | None, first: Solution, last: Solution) -> dict[Meeting, Test]:
    """Return functions of a point that change their signs at meetings."""

    def test(name: str, point: Solution) -> float:
        return getattr(Tests.of(others(kind, point.multipliers)), name)

    tests: dict[Meeting, Test] = {
        meeting: partial(test, name)
        for meeting, name in zip(WITH[kind][:3], Tests._fields, strict=True)
    }
    if kind is Kind.FOLD:
        tests[Meeting.RESONANCE_1] = partial(_again, 1.0)
    elif kind is Kind.DOUBLING:
        tests[Meeting.RESONANCE_2] = partial(_again, -1.0)
    elif kind is Kind.TORUS:
        tests |= {meeting: partial(_off_angle, meeting) for meeting in ANGLES}
    turn = last.tangent[-2:] - first.tangent[-2:]
    if kind is Kind.FOLD and first.tangent[-2:] @ last.tangent[-2:] < 0:
        tests[Meeting.CUSP] = lambda p: float(p.tangent[-2:] @ turn)
    return tests


class Plane(NamedTuple):
    """A part of the plane of two parameters, and where special points on a line of it are known.

    Attributes
    ----------
    map : Map
        Its value is a pair.
    second : float
        Value of the second parameter on the line.
    spans : ((float, float), (float, float))
        Of both parameters.
    scale : ndarray, shape (2,)
        See `Locus`.
    """

    map: Map
    second: float
    spans: tuple[tuple[float, float], tuple[float, float]]
    scale: np.ndarray

    def locus(self, period: int, special: Special) -> Locus:
        """Return the locus of a special point."""
        return Locus(self.map, period, self.scale, self.spans, special.kind, special.change)


def curves_through(
    catalogue: Catalogue,
    plane: Plane,
    kinds: Collection[Kind],
    longest: int,
    limits: Limits,
    most_curves: int,
    most_points: int,
) -> tuple[list[Arc], dict[tuple[int, int], int]]:
    """Follow the curves through the special points of a catalogue.

    Parameters
    ----------
    catalogue : Catalogue
        Of branches along the first parameter, at `plane.second`.
    plane : Plane
    kinds : collection of Kind
        Of `KINDS`, those whose curves are followed.
    longest : int
        Longest period of orbits whose curves are followed.
    limits : Limits
        Its `low` and `high` do not matter.
    most_curves, most_points : int
        Room.

    Returns
    -------
    curves : list of Arc
        The curve of each is a `Locus`.
    on : dict of (int, int) to int
        Number of its curve, from the number of a branch and of a special point of it. What is
        missing is not followed: no curve was found there, or there is no room.
    """
    curves: list[Arc] = []
    on: dict[tuple[int, int], int] = {}
    for number, branch in enumerate(catalogue.branches):
        for k, (_, special) in enumerate(branch.specials):
            if special.kind not in kinds or branch.curve.period > longest:
                continue
            points, first = branch.curve.split(special.at.y)
            locus, value = plane.locus(len(points), special), (first, plane.second)
            passed = [
                c
                for c, arc in enumerate(curves)
                if (arc.curve.kind, arc.curve.period) == (locus.kind, locus.period)
                and passes(arc, points, value, SAME)
            ]
            room = most_points - sum(len(arc.points) for arc in curves)
            if not passed and len(curves) < most_curves and room >= SHORTEST:
                steps = min(limits.most_steps, (room - 1) // 2)
                try:
                    start = locus.start(points, value)
                    shorter = limits._replace(most_steps=steps, smallest=SMALLEST)
                    curves.append(follow(locus, start, shorter, step=step_of_locus))
                except ArithmeticError:
                    continue
                passed = [len(curves) - 1]
            if passed:
                on[number, k] = passed[0]
    return curves, on
