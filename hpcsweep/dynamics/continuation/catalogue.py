r"""Catalogue of all branches on which orbits lie, each once, with those that leave them.

Orbits are taken in turn: if one lies on a known branch, which is tested by computing the point
of that branch on the hyperplane through the orbit, it is assigned to it; otherwise its branch is
followed. Then the branches that leave at period doublings and branch points are followed, in the
order in which they are found, unless they are known. Nothing is random: a catalogue depends only on
its orbits and their order.

At a doubling the tangent map of the chain X of p points, gone round twice, has the null vector
Phi = (phi_0, ..., phi_{p-1}, -phi_0, ..., -phi_{p-1}) with phi_{i+1} = M_i phi_i and M phi_0 =
-phi_0. The orbits of twice the period leave along it, at a distance eps with lambda = lambda_* + c
eps^2 + ...: they are found on the hyperplane across Phi at the distance eps. The doubling is
supercritical if they lie on the side where the orbits of period p are unstable, which is the sign
of c, that of the normal form's coefficient (Kuznetsov, Elements of Applied Bifurcation Theory,
4.5). At a branch point the null vector is of one round, with M phi_0 = phi_0.
"""

import contextlib
import math
from dataclasses import replace
from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.branch import COLLAPSED, Arc, Limits, Stepper, follow, on_cubic
from hpcsweep.dynamics.continuation.cycle import Curve, Map, NotConvergedError, Solution, solve_at
from hpcsweep.dynamics.continuation.events import Kind, Special, n_unstable
from hpcsweep.dynamics.orbit import smallest_period
from hpcsweep.dynamics.stability import TangentMaps

FOLDS_OF_A_STEP = 8
"""Room for the folds of a last step."""
SAME = 1e-9
"""Distance of orbits that count as the same, in units of the state."""
STRIDE = 8
"""Steps of a new branch from one orbit that is sought on known branches to the next."""
OFF = 0.2
"""Chords of a piece of a branch within which its points lie from the cubic through its ends."""

DISTANCES = (1e-3, 1e-4, 1e-5, 1e-6)
"""eps, in units of the state, as they are tried: at a large one the orbit of twice the period may
have doubled itself."""
APART = 0.1
"""Share of eps at which the orbit found is another one."""


class Catalogue:
    """Branches of a map, each once.

    Attributes
    ----------
    step : callable or None
        Takes their steps, as in `follow`.

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
    costly : bool
        Whether a new value of the parameter is; see `Curve`.
    """

    step: Stepper | None = None

    def __init__(
        self,
        map_: Map,
        limits: Limits,
        scale: float,
        most_period: int,
        most_branches: int,
        most_points: float = math.inf,
        costly: bool = False,
    ):
        self._map, self._limits, self._scale, self._costly = map_, limits, scale, costly
        self._most_period, self._most_branches = most_period, most_branches
        self._most_points = most_points
        self.branches: list[Arc] = []
        self._grown = 0

    @property
    def is_full(self) -> bool:
        """Whether the catalogue has no room for another branch."""
        points = sum(len(arc.points) for arc in self.branches)
        longest = 2 * (self._limits.most_steps + FOLDS_OF_A_STEP) + 1
        return len(self.branches) >= self._most_branches or points + longest > self._most_points

    def add(self, points: np.ndarray, value: float, searched: bool = False) -> tuple[int, float]:
        """Add an orbit, shape (p, N), and follow its branch if it is a new one.

        Returns
        -------
        branch : int
            Number of its branch, -1 if there is no room for it.
        distance : float
            From the points to those of the orbit, in units of the state.

        Raises
        ------
        NotConvergedError
            If there is no orbit at these points.
        """
        curve = Curve(self._map, len(points), self._scale, costly=self._costly)
        orbit = solve_at(curve, points, value)
        there = curve.split(orbit.y)[0]
        distance = float(np.abs(there - points).max())
        shortest = smallest_period(there, 1e-7)
        if shortest < len(points):
            return self.add(there[:shortest], value, searched)[0], distance
        number = self.branch_of(there, value)
        if number < 0:
            number = self._follow(curve, orbit, -1, searched)
        return number, distance

    def branch_of(self, points: np.ndarray, value: float) -> int:
        """Return the branch on which an orbit lies to `SAME`, -1 for none."""
        for number, arc in enumerate(self.branches):
            if arc.curve.period == len(points) and self.is_on(arc, points, value):
                return number
        return -1

    def is_on(self, arc: Arc, points: np.ndarray, value: float) -> bool:
        """Return whether an orbit lies on a branch of its period."""
        return passes(arc, points, value, SAME)

    def orbits_at(self, period: int, value: float) -> list[np.ndarray]:
        """Return all orbits of the branches of a period at a value, shape (p, N) each."""
        arcs = [arc for arc in self.branches if arc.curve.period == period]
        return [orbit for arc in arcs for orbit in orbits_on(arc, value)]

    def grow(self) -> None:
        """Follow the branches that leave others."""
        while self._grown < len(self.branches):
            arc = self.branches[self._grown]
            for at, (place, special) in enumerate(arc.specials):
                if special.kind in (Kind.DOUBLING, Kind.BRANCH_POINT):
                    arc.specials[at] = place, self._leave(self._grown, place, special)
            self._grown += 1

    def _follow(self, curve: Curve, start: Solution, parent: int, searched: bool = False) -> int:
        if self.is_full:
            return -1
        arc = follow(curve, start, self._limits, parent >= 0, self.step)
        arc, number = self.own_part(arc, start)
        if len(arc.points) == 1 and number >= 0:
            return number
        arc.parent, arc.searched = parent, searched
        self.branches.append(arc)
        return len(self.branches) - 1

    def own_part(self, arc: Arc, start: Solution) -> tuple[Arc, int]:
        """Return the part of a new branch around its start that repeats no known one.

        Where two branches nearly touch a step may jump from one to the other, which is then
        followed again, to its end or until a step jumps away; every `STRIDE`-th orbit is tested.
        Also return the known branch, -1 if there is none.
        """
        centre = next(k for k, point in enumerate(arc.points) if point is start)
        first, before = self._last_own(arc, centre, 0)
        last, after = self._last_own(arc, centre, len(arc.points) - 1)
        if before < 0 and after < 0:
            return arc, -1
        specials = [(k - first, special) for k, special in arc.specials if first < k <= last]
        ends = "known" if before >= 0 else arc.ends[0], "known" if after >= 0 else arc.ends[1]
        return Arc(arc.curve, arc.points[first : last + 1], specials, ends), max(before, after)

    def _last_own(self, arc: Arc, inside: int, end: int) -> tuple[int, int]:
        """Return the last place from `inside` to `end` before a known branch, and that, or -1."""
        way = 1 if end > inside else -1
        for outside in (
            *range(inside + way * STRIDE, end, way * STRIDE),
            *([end] * (end != inside)),
        ):
            number = self._known_at(arc, outside)
            if number >= 0:
                while abs(outside - inside) > 1:
                    middle = (inside + outside) // 2
                    known_there = self._known_at(arc, middle) >= 0
                    inside, outside = (inside, middle) if known_there else (middle, outside)
                return inside, number
            inside = outside
        return end, -1

    def _known_at(self, arc: Arc, place: int) -> int:
        """Return the known branch on which a point of another one lies, -1 for none."""
        return self.branch_of(*arc.curve.split(arc.points[place].y))

    def _leave(self, parent: int, place: int, special: Special) -> Special:
        """Follow the branch that leaves at a special point; return it with its criticality."""
        arc = self.branches[parent]
        switched = switch(arc.curve, special)
        if switched is None:
            return special
        curve, start = switched
        around = arc.points[max(place - 1, 0)], arc.points[min(place, len(arc.points) - 1)]
        if special.kind is Kind.DOUBLING:
            special = special._replace(criticality=criticality(*around, special, start))
        points, value = curve.split(start.y)
        number = -1
        if self._limits.low <= value <= self._limits.high:
            number = self.branch_of(points, value)
            if number < 0:
                number = self._ending_at(arc.curve, special, curve.period)
            if number < 0 and curve.period <= self._most_period:
                number = self._follow(curve, start, parent)
        return special._replace(leaving=start, leads_to=number)

    def _ending_at(self, curve: Curve, special: Special, period: int) -> int:
        """Return the branch of a period that has come back to a special point, -1 for none.

        It ends before the orbits that leave there nearest to it.
        """
        points = np.tile(curve.split(special.at.y)[0], (period // curve.period, 1))
        turns = [np.roll(points, shift, axis=0) for shift in range(curve.period)]
        for number, arc in enumerate(self.branches):
            if arc.curve.period == period:
                for why, end in zip(arc.ends, (arc.points[0], arc.points[-1]), strict=True):
                    there = arc.curve.split(end.y)[0]
                    near = min(float(np.abs(there - x).max()) for x in turns) <= 2.0 * COLLAPSED
                    if why == "halving" and near and abs(end.y[-1] - special.at.y[-1]) <= COLLAPSED:
                        return number
        return -1


def passes(arc: Arc, points: np.ndarray, value: Any, same: float) -> bool:
    """Return whether a curve passes an orbit, or one of its shifts, to within `same`.

    Parameters
    ----------
    arc : Arc
    points : ndarray, shape (p, N)
    value : float, or pair
        Of the parameter at the orbit.
    same : float
    """
    shifts = [arc.curve.join(np.roll(points, k, axis=0), value) for k in range(len(points))]
    for guess, tangent, chord in places_at(arc, shifts[0][-1]):
        far = [float(np.abs(guess - y)[:-1].max()) for y in shifts]
        if min(far) <= OFF * chord + same:
            with contextlib.suppress(ArithmeticError):
                exact = arc.curve.through(guess, tangent, shifts[int(np.argmin(far))])
                if min(np.abs(exact - y).max() for y in shifts) <= same:
                    return True
    return False


def orbits_on(arc: Arc, value: float) -> list[np.ndarray]:
    """Return the orbits of a branch at a value, shape (p, N) each."""
    orbits = []
    for guess, _, _ in places_at(arc, value / arc.curve.scale):
        with contextlib.suppress(NotConvergedError):
            exact = solve_at(arc.curve, arc.curve.split(guess)[0], value)
            orbits.append(arc.curve.split(exact.y)[0])
    return orbits


def places_at(arc: Arc, at: float) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return where a curve passes a value of y's last component: y, tangent, nearly, and the chord.

    A piece is a cubic between its ends, with their tangents (Hermite); the parameter is monotone
    on it.
    """
    ends = arc.heights
    places = []
    for piece in np.flatnonzero((ends[:-1] - at) * (ends[1:] - at) <= 0.0).tolist():
        first, last = arc.points[piece], arc.points[piece + 1]
        y, s = on_cubic(first, last, -1, at)
        tangent = (1.0 - s) * first.tangent + s * last.tangent
        chord = float(np.abs(last.y - first.y).max())
        places.append((y, tangent / np.linalg.norm(tangent), chord))
    return places


def switch(curve: Curve, special: Special) -> tuple[Curve, Solution] | None:
    """Find an orbit on the branch that leaves at a doubling or a branch point.

    Parameters
    ----------
    curve : Curve
        Curve of the branch of the special point.
    special : Special

    Returns
    -------
    curve : Curve
        Of the branch that leaves.
    point : Solution
        None, instead of both, if there is none at any of `DISTANCES`.
    """
    doubles = special.kind is Kind.DOUBLING
    points, value = curve.split(special.at.y)
    vector = _null_vector(special.at.maps, -1.0 if doubles else 1.0)
    if doubles:
        points, vector = np.tile(points, (2, 1)), np.concatenate((vector, -vector))
    new = replace(curve, period=len(points))
    border = np.append(vector.ravel() / np.linalg.norm(vector), 0.0)
    start = new.join(points, value)
    sign = 1.0 if doubles else np.sign(special.at.tests.doubling)
    for distance in DISTANCES:
        eps = distance * np.sqrt(len(points))
        try:
            leaving = new.solve(start + eps * border, border)
        except NotConvergedError:
            continue
        is_apart = float((leaving.y - start) @ border) > (1.0 - APART) * eps
        if is_apart and leaving.tests.doubling * sign > 0:
            return new, leaving
    return None


def criticality(before: Solution, after: Solution, special: Special, leaving: Solution) -> int:
    """Return 1 for a supercritical doubling, -1 for a subcritical one, 0 if undetermined.

    Parameters
    ----------
    before, after : Solution
        Neighbours of the special point on its branch.
    special : Special
    leaving : Solution
        Of the branch that leaves.
    """
    unstable_after = n_unstable(after.multipliers) > n_unstable(before.multipliers)
    side = float(leaving.y[-1] - special.at.y[-1])
    way = float(after.y[-1] - before.y[-1])
    if side == 0.0 or way == 0.0:
        return 0
    return 1 if (side * way > 0) == unstable_after else -1


def _null_vector(maps: TangentMaps, multiplier: float) -> np.ndarray:
    """Return phi_i of the multiplier nearest to a real one, shape (p, N)."""
    values, vectors = np.linalg.eig(maps.product)
    chain = [vectors[:, np.argmin(np.abs(values - multiplier))].real]
    for matrix in maps.matrices[:-1]:
        chain.append(matrix @ chain[-1])
    return np.array(chain)
