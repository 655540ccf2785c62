r"""Catalogue of all branches on which orbits lie, each once, with those that leave them.

Orbits are taken in turn: if one lies on a known branch, which is tested by computing the point
of that branch on the hyperplane through the orbit, it is assigned to it; otherwise its branch is
followed. Then the branches that leave at period doublings and branch points are followed, in the
order in which they are found, unless they are known. Nothing is random: a catalogue depends only on
its orbits and their order.
"""

import contextlib
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.branch import Arc, Limits, follow
from hpcsweep.dynamics.continuation.cycle import (
    Curve,
    Map,
    NotConvergedError,
    Solution,
    solve,
    solve_at,
)
from hpcsweep.dynamics.continuation.events import Kind, Special
from hpcsweep.dynamics.continuation.switching import criticality, switch
from hpcsweep.dynamics.orbit import smallest_period

FOLDS_OF_A_STEP = 8
"""Room for the folds of a last step."""
HALVINGS = 30
SAME = 1e-9
"""Distance of orbits that count as the same, in units of the state."""
OFF = 0.2
"""Chords of a piece of a branch within which its points lie from the cubic through its ends."""


@dataclass
class Branch:
    """A branch of a catalogue.

    Attributes
    ----------
    arc : Arc
    parent : int
        Branch that it leaves, -1 if it was found by an orbit.
    searched : bool
        Whether that orbit was found by the search.
    """

    arc: Arc
    parent: int = -1
    searched: bool = False


class Place(NamedTuple):
    """Where an orbit lies.

    Attributes
    ----------
    branch : int
        Number of its branch, -1 if there is no room for it.
    distance : float
        From the points that were given to those of the orbit, in units of the state.
    """

    branch: int
    distance: float


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
    most_branches, most_points : int
        Room; a branch is followed only where there is room for its most points.
    """

    def __init__(
        self,
        map_: Map,
        limits: Limits,
        scale: float,
        most_period: int,
        most_branches: int,
        most_points: float = math.inf,
    ):
        self._map, self._limits, self._scale = map_, limits, scale
        self._most_period, self._most_branches = most_period, most_branches
        self._most_points = most_points
        self.branches: list[Branch] = []
        self._grown = 0

    @property
    def is_full(self) -> bool:
        """Whether the catalogue has no room for another branch."""
        points = sum(len(one.arc.points) for one in self.branches)
        longest = 2 * (self._limits.most_steps + FOLDS_OF_A_STEP) + 1
        full = len(self.branches) >= self._most_branches
        return full or points + longest > self._most_points

    def add(self, points: np.ndarray, value: float, searched: bool = False) -> Place:
        """Add an orbit, shape (p, N), and follow its branch if it is a new one.

        Raises
        ------
        NotConvergedError
            If there is no orbit at these points.
        """
        curve = Curve(self._map, len(points), self._scale)
        found = solve_at(curve, points, value)
        there = curve.split(found.y)[0]
        distance = float(np.abs(there - points).max())
        shortest = smallest_period(there, 1e-7)
        if shortest < len(points):
            return Place(self.add(there[:shortest], value, searched).branch, distance)
        known = self.branch_of(there, value)
        if known < 0:
            known = self._follow(curve, found, -1, searched)
        return Place(known, distance)

    def branch_of(self, points: np.ndarray, value: float) -> int:
        """Return the branch on which an orbit lies to `SAME`, -1 for none."""
        for number, branch in enumerate(self.branches):
            if branch.arc.curve.period == len(points) and _holds(branch.arc, points, value):
                return number
        return -1

    def orbits_at(self, period: int, value: float) -> list[np.ndarray]:
        """Return all orbits of the branches of a period at a value, shape (p, N) each."""
        found = []
        for branch in self.branches:
            if branch.arc.curve.period == period:
                for guess, _, _ in places_at(branch.arc, value):
                    there = branch.arc.curve.split(guess)[0]
                    with contextlib.suppress(NotConvergedError):
                        exact = solve_at(branch.arc.curve, there, value)
                        found.append(branch.arc.curve.split(exact.y)[0])
        return found

    def grow(self) -> None:
        """Follow the branches that leave others."""
        while self._grown < len(self.branches):
            arc = self.branches[self._grown].arc
            for at, (place, special) in enumerate(arc.specials):
                if special.kind in (Kind.DOUBLING, Kind.BRANCH_POINT):
                    arc.specials[at] = place, self._leave(self._grown, place, special)
            self._grown += 1

    def _follow(self, curve: Curve, start: Solution, parent: int, searched: bool = False) -> int:
        if self.is_full:
            return -1
        arc = follow(curve, start, self._limits, born=parent >= 0)
        self.branches.append(Branch(arc, parent, searched))
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
        points, value = curve.split(start.y)
        number = -1
        if self._limits.low <= value <= self._limits.high:
            number = self.branch_of(points, value)
            if number < 0 and curve.period <= self._most_period:
                number = self._follow(curve, start, parent)
        return special._replace(leaving=start, leads_to=number)


def _holds(arc: Arc, points: np.ndarray, value: float) -> bool:
    """Return whether an orbit, or one of its shifts, lies on a piece of a branch."""
    curve = arc.curve
    shifts = [np.roll(points, shift, axis=0) for shift in range(len(points))]
    for guess, tangent, chord in places_at(arc, value):
        there = curve.split(guess)[0]
        far = [float(np.abs(z - there).max()) for z in shifts]
        if min(far) > OFF * chord + SAME:
            continue
        own = curve.join(shifts[int(np.argmin(far))], value)
        try:  # the point of the branch on the hyperplane through the orbit, across the branch
            exact = solve(curve, guess + tangent @ (own - guess) * tangent, tangent).y
        except NotConvergedError:
            continue
        if np.abs(exact - own).max() <= SAME:
            return True
    return False


def places_at(arc: Arc, value: float) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return where a branch passes a value of the parameter: y and tangent, nearly, and the chord.

    A piece is a cubic between its ends, with their tangents (Hermite); the parameter is monotone
    on it.
    """
    at = value / arc.curve.scale
    ends = arc.heights
    found = []
    for piece in np.flatnonzero((ends[:-1] - at) * (ends[1:] - at) <= 0.0).tolist():
        first, last = arc.points[piece], arc.points[piece + 1]
        chord = last.y - first.y
        length = float(np.linalg.norm(chord))
        own, other = length * first.tangent[-1], length * last.tangent[-1]
        low, high = 0.0, 1.0
        rises = last.y[-1] > first.y[-1]
        for _ in range(HALVINGS):
            s = 0.5 * (low + high)
            if (_cubic(s, first.y[-1], last.y[-1], own, other) < at) == rises:
                low = s
            else:
                high = s
        s = 0.5 * (low + high)
        y = _cubic(s, first.y, last.y, length * first.tangent, length * last.tangent)
        tangent = (1.0 - s) * first.tangent + s * last.tangent
        found.append((y, tangent / np.linalg.norm(tangent), float(np.abs(chord).max())))
    return found


def _cubic(s: float, first, last, first_slope, last_slope):
    """Evaluate Hermite's cubic at s from 0 to 1."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * first + s * first_slope) + s * s * (
        (1.0 + 2.0 * r) * last - r * last_slope
    )
