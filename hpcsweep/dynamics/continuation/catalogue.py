r"""Catalogue of all branches on which orbits lie, each once, with those that leave them.

Orbits are taken in turn: if one lies on a known branch, which is tested by computing the orbit of
that branch at the orbit's own value of the parameter, it is assigned to it; otherwise its branch is
followed. Then the branches that leave at period doublings and branch points are followed, in the
order in which they are found, unless they are known. Nothing is random: a catalogue depends only on
its orbits and their order.
"""

from dataclasses import dataclass

import numpy as np

from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.cycle import (
    Curve,
    Map,
    NotConvergedError,
    Solution,
    solve_at,
)
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.switching import criticality, switch
from hpcsweep.dynamics.orbit import smallest_period

SAME = 1e-9
"""Distance of orbits that count as the same, in units of the state."""
CHORDS = 3.0
"""Chords of a piece of a branch within which an orbit may lie on it."""


@dataclass
class Branch:
    """A branch of a catalogue.

    Attributes
    ----------
    arc : Arc
    parent : int
        Branch that it leaves, -1 if it was found by an orbit.
    """

    arc: Arc
    parent: int = -1


class Catalogue:
    """Branches of a map, each once.

    Parameters
    ----------
    map : Map
    limits : Limits
    scale : float
        Of the parameter; see `Curve`.
    most_period : int
        Of branches that leave others.
    most_branches : int
    """

    def __init__(
        self, map_: Map, limits: Limits, scale: float, most_period: int, most_branches: int
    ):
        self._map, self._limits, self._scale = map_, limits, scale
        self._most_period, self._most_branches = most_period, most_branches
        self.branches: list[Branch] = []
        self._grown = 0

    @property
    def is_full(self) -> bool:
        """Whether the catalogue has no room for another branch."""
        return len(self.branches) >= self._most_branches

    def add(self, points: np.ndarray, value: float) -> int:
        """Add an orbit, shape (p, N); return the branch on which it lies, -1 if there is no room.

        Raises
        ------
        NotConvergedError
            If there is no orbit at these points.
        """
        curve = Curve(self._map, len(points), self._scale)
        found = solve_at(curve, points, value)
        there = curve.split(found.y)[0]
        shortest = smallest_period(there, 1e-7)
        if shortest < len(points):
            return self.add(there[:shortest], value)
        known = self.branch_of(there, value)
        return known if known >= 0 else self._follow(curve, found, -1)

    def branch_of(self, points: np.ndarray, value: float) -> int:
        """Return the branch on which an orbit lies to `SAME`, -1 for none."""
        for number, branch in enumerate(self.branches):
            if branch.arc.curve.period == len(points) and _holds(branch.arc, points, value):
                return number
        return -1

    def grow(self) -> None:
        """Follow the branches that leave others."""
        while self._grown < len(self.branches):
            arc = self.branches[self._grown].arc
            for at, (place, special) in enumerate(arc.specials):
                if special.kind in (Kind.DOUBLING, Kind.BRANCH_POINT):
                    arc.specials[at] = place, self._leave(self._grown, place, special)
            self._grown += 1

    def _follow(self, curve: Curve, start: Solution, parent: int) -> int:
        if self.is_full:
            return -1
        arc = follow(curve, start, self._limits, born=parent >= 0)
        self.branches.append(Branch(arc, parent))
        return len(self.branches) - 1

    def _leave(self, parent: int, place: int, special: Special) -> Special:
        """Follow the branch that leaves at a special point; return it with its criticality."""
        arc = self.branches[parent].arc
        switched = switch(arc.curve, special)
        if switched is None:
            return special
        curve, start = switched
        around = arc.points[max(place - 1, 0)], arc.points[min(place, len(arc.points) - 1)]
        if special.kind is Kind.DOUBLING:
            side = criticality(arc.curve, *around, special, start)
            special = special._replace(criticality=side)
        special = special._replace(leaving=start)
        points, value = curve.split(start.y)
        inside = self._limits.low <= value <= self._limits.high
        if curve.period <= self._most_period and inside and self.branch_of(points, value) < 0:
            self._follow(curve, start, parent)
        return special


def _holds(arc: Arc, points: np.ndarray, value: float) -> bool:
    """Return whether an orbit, or one of its shifts, lies on a piece of a branch."""
    curve = arc.curve
    at = value / curve.scale
    ends = np.array([one.y[-1] for one in arc.points])
    passes = (ends[:-1] - at) * (ends[1:] - at) <= 0.0
    for piece in np.flatnonzero(passes).tolist():
        first, last = arc.points[piece].y, arc.points[piece + 1].y
        share = (at - first[-1]) / (last[-1] - first[-1]) if last[-1] != first[-1] else 0.0
        there = curve.split(first + share * (last - first))[0]
        chord = float(np.abs(last - first).max())
        shifts = [np.roll(points, shift, axis=0) for shift in range(len(points))]
        near = [z for z in shifts if np.abs(z - there).max() <= CHORDS * chord + SAME]
        if not near:
            continue
        try:
            exact = curve.split(solve_at(curve, there, value).y)[0]
        except NotConvergedError:
            continue
        if any(np.abs(z - exact).max() <= SAME for z in near):
            return True
    return False
