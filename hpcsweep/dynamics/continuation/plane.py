"""Curves in the plane of two parameters through the special points of a catalogue, each once.

A catalogue knows all special points at one value of the second parameter, on a line of the plane.
Each is taken in turn: if a curve followed before passes it, which is tested by finding the point of
that curve on the line, it is on that curve; otherwise its curve is followed.
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.catalogue import Catalogue, passes
from hpcsweep.dynamics.continuation.cycle import Map
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.locus import Locus
from hpcsweep.dynamics.continuation.meetings import step_of_locus

SAME = 1e-6
"""Distance of special points that count as the same, in units of y."""
SMALLEST = 1e-7
"""Step from which a curve is not followed on, in units of y."""
SHORTEST = 3
"""Points for which a curve needs room."""
KINDS = {kind.name.lower(): kind for kind in (Kind.FOLD, Kind.DOUBLING, Kind.TORUS, Kind.GRAZING)}
"""Special points that have a curve in the plane, by name."""


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
        for k, (_, special) in enumerate(branch.arc.specials):
            if special.kind not in kinds or branch.arc.curve.period > longest:
                continue
            points, first = branch.arc.curve.split(special.at.y)
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
