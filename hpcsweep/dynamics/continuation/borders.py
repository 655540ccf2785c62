r"""Steps on branches of structures that yield: up to a border, and across it.

*Families.* A slider that sticks over a whole orbit keeps its lasting elongation p, whatever that
is (`hpcsweep.dynamics.families`): the row of p in the tangent map is that of the identity. It is
taken as 0 over the last period of the orbit (`held`), as if the slider forgot its p. Newton's
method then leaves p as the guess has it, and a branch carries it from point to point, as a test
does whose amplitude rises slowly; of the multipliers the 1 of the family is a 0, as a slider that
slips has one too, and the others are those transverse to the family. So a branch has the same
unknowns, (u, u', p), all along.

*Borders.* The signature of an orbit counts, after the closings of each contact, the excursions of
each slider. Where a slider begins to slip within an orbit, or ceases, the map is continuous and its
tangent is not, however small the slip: it takes p from the elongation at its end. A branch has a
corner there, and may turn back: a fold without a multiplier of 1. So no step passes one. Up to it,
s along the tangent t, points of the old side are found with its tangent map alone, and the border
is the largest s at which that succeeds without another signature. A little ahead, at y + h t, the
motion slips (or no longer does); the tangent map there has the direction w of the other side, and
the branch goes on along w or -w, whichever leads to an orbit that is another one than before.

Where neither does, p is *dragged*: the slider comes to its strength at one end of its motion, and
gives way in each next test by as much as the motion has grown. Those orbits are the edges of their
families and have no tangent map; the branch ends there, at a border.

A contact that closes or opens is passed likewise: tangent maps of sliders are differences, which
see a contact that grazes within 1e-7.
"""

import contextlib
from collections.abc import Iterator
from itertools import product
from typing import Any, cast

import numpy as np

from hpcsweep.dynamics.continuation import branch
from hpcsweep.dynamics.continuation.catalogue import Catalogue, orbits_on
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import CLOSING

NEAR = 1e-4
"""Step, in units of y, from which on a border is sought within it."""
BISECTIONS = 40
BEYOND = 1e-5, 1e-4, 1e-3
"""Distances past a border, in units of y, at which its other side is sought."""

Regime = tuple[tuple[int, ...], tuple[int, ...]]


def check_hardening(structure: Structure) -> None:
    """Make sure that springs keep the place of a structure while its sliders slip.

    Raises
    ------
    ValueError
    """
    if not CLOSING.of(structure) and structure.mechanisms.size:
        raise ValueError(
            "structure must have hardening for branches: no spring keeps its place while sliders "
            "slip"
        )


def catalogue_of(forced: ForcedMap, *settings) -> Catalogue:
    """Return an empty catalogue of branches of a structure; `settings` as for `Catalogue`."""
    kind: Any = Catalogue if CLOSING.of(forced.structure) else YieldingCatalogue
    return kind(forced, *settings, costly=forced.is_costly)


def step_up_to_border(
    curve: Curve, last: Solution, bend: np.ndarray, step: float, limits: branch.Limits
) -> branch.Step | None:
    """Take a step like `step_of_branch`, or one to a border and across it; None if too far."""
    with contextlib.suppress(ArithmeticError):
        point = branch.sought(curve, last, branch.ahead_of(last, bend, step), step)
        if curve.signature(point) == curve.signature(last):
            taken = branch.step_of_branch(curve, last, bend, step, limits, point)
            if taken is not None:
                return taken
    if step > NEAR:
        return None
    try:
        return _across(curve, last, step, limits)
    except ArithmeticError:
        return None


class YieldingCatalogue(Catalogue):
    """Branches of a structure that yields, each family of orbits once."""

    step = staticmethod(step_up_to_border)

    def is_on(self, arc: branch.Arc, points: np.ndarray, value: float) -> bool:
        """Return whether an orbit lies on a branch, or is of the family of an orbit that does."""
        if super().is_on(arc, points, value):
            return True
        turns = [np.roll(points, k, axis=0) for k in range(len(points))]
        pairs = product(orbits_on(arc, value), turns)
        return any(_forced(arc.curve).joins(*both, value) for both in pairs)


def _across(curve: Curve, last: Solution, step: float, limits: branch.Limits) -> branch.Step | None:
    """Go to a border within two steps, and across it; None if there is none."""
    edge, share = _edge(curve, last, 2.0 * step)
    if share == 1.0:
        return None
    regime = _regime(curve, edge)
    for length in BEYOND:
        for point in _beyond(curve, edge, length):
            if not limits.low <= curve.split(point.y)[1] <= limits.high:
                return last, [], 0.0, "end of the span"
            there = _regime(curve, point)
            if there != regime:
                specials = _special(curve, edge, share, regime[0], there[0])
                turns = point.tangent[-1] * edge.tangent[-1] < 0.0
                if turns and [special.kind for special in specials] == [Kind.GRAZING]:
                    specials.append(Special(Kind.FOLD, edge, share))
                return point, specials, 0.0, ""
    ahead = curve.map.signature(*curve.split(edge.y + BEYOND[0] * edge.tangent))
    specials = _special(curve, edge, share, regime[0], ahead)
    return (last, specials, 0.0, "border") if specials else None


def _edge(curve: Curve, last: Solution, length: float) -> tuple[Solution, float]:
    """Return the last point along a tangent before another regime, and its share of a length."""
    near, regime = curve.solve(last.y, last.tangent), _regime(curve, last)
    low, high, edge = 0.0, 2.0, near
    for _ in range(BISECTIONS):
        place, same = 0.5 * (low + high), False
        with contextlib.suppress(ArithmeticError):
            ahead = near.y + place * length * near.tangent
            point = curve.solve(ahead, near.tangent, near, keeps=True)
            same = _regime(curve, point) == regime
        if same and place == 1.0:
            return point, place
        low, high, edge = (place, high, point) if same else (low, place, edge)
    return edge, low


def _beyond(curve: Curve, edge: Solution, length: float) -> Iterator[Solution]:
    """Go through orbits at a distance past a border, on whichever side."""
    try:
        _, matrices, slopes = curve.linearise(edge.y + length * edge.tangent)
        inverse = np.linalg.inv(curve.bordered(matrices, slopes, edge.tangent))
    except (ArithmeticError, np.linalg.LinAlgError):
        return
    way = inverse[:, -1] / np.linalg.norm(inverse[:, -1])
    for along in (way, -way):
        with contextlib.suppress(NotConvergedError):
            yield curve.solve(edge.y + length * along, along)


def _forced(curve: Curve) -> ForcedMap:
    return cast(ForcedMap, curve.map)


def _regime(curve: Curve, point: Solution) -> Regime:
    """Return the signature of an orbit, and how often each slider slips as a period ends."""
    forced = _forced(curve)
    seen = forced.observe(*curve.split(point.y))
    return forced.counted(seen), tuple(seen.slid["slipping"].tolist())


def _special(curve: Curve, edge: Solution, share: float, before, after) -> list[Special]:
    """Return the special point at a border; none where a slip begins as a period does."""
    change = tuple(b - a for a, b in zip(before, after, strict=True))
    kind = Kind.SLIP if any(change[len(_forced(curve).structure.contacts) :]) else Kind.GRAZING
    return [Special(kind, edge, share, change)] if any(change) else []
