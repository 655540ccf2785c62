"""The motions known so far at one point, and which of them a motion has come to.

An orbit is recognised by its neighbourhood or by its points, other motions by how often they visit
which places (`Signature`), of which one motion may need several records.

Orbits are the same if they have the same period and, for one shift of their points, no point
differs by more than the tolerance; or if they are of one family (`families`), of which some members
are kept. Motions without a period on which sliders stick are told together where the same sliders
slip and the same contacts close.

Motions other than orbits, chaos and tori, are distinguished by two statistics of their stroboscopic
points. First, where the points are: attractors are disjoint closed sets, and a motion comes
arbitrarily near to each point of its attractor, so that all but a few (`STRAYS`) of its points must
be about as near to the other's as that one's own second half is to its first. Second, how often:
the mean of its points must be no farther from the other's than twice the largest distance of means
over windows of the other, of the same length.

A nearly locked torus is visited in clusters of points that drift along it, which another motion on
it need not meet in thousands of periods. But its weighted means (`birkhoff`) are known to many
digits, and identify it: two tori are the same if the means of all coordinates and of their squares
agree within `SAFE_MEANS` times their difference between the halves of either record.
"""

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from hpcsweep.dynamics.attractor import Attractor, Motion
from hpcsweep.dynamics.birkhoff import weighted_means
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.families import are_joined, separation, slipping, told_of_sliders
from hpcsweep.dynamics.neighbourhood import WINDOW, Neighbourhood, inside
from hpcsweep.dynamics.stability import MeanInterval
from hpcsweep.solvers.records import Observation, normalised_drift

UNCERTAIN = 1e-6
"""Distance within which two orbits that attract are one: at a fold they are known to the root of
rounding, to which motions do not come from one side as from another."""
MAX_MEMBERS = 64
"""Most members of a family that are kept."""
MAX_RECORDS = 16
"""Most records of motions that are not orbits."""
STRAYS = 0.05
"""Largest share of points beyond the reach: the reach leaves out 1 % of the motion's own."""
REACH, SAFETY = 0.99, 2.0
"""Quantile of the distances between the halves, and its multiple that is the reach."""
SAFE_MEANS, MIN_MEANS = 10.0, 1e-9
"""Multiple of the difference of the means of halves, and least difference, in units of the state.
Means of 14 records of one torus agree to 5e-15."""
PARTS = 4
"""Windows of a length begin this many times in that length."""


def same_orbit(orbit: np.ndarray, other: np.ndarray, tolerance: float) -> bool:
    """Return whether orbits are the same, by the smallest distance over cyclic shifts.

    Parameters
    ----------
    orbit, other : ndarray, shapes (p, 2n) and (q, 2n)
        Points in order, in units of the state.
    tolerance : float
    """
    if orbit.shape != other.shape:
        return False
    return any(
        np.abs(orbit - np.roll(other, k, axis=0)).max() <= tolerance for k in range(len(orbit))
    )


class Signature:
    """Statistics that identify a motion that is not an orbit.

    Parameters
    ----------
    points : ndarray, shape (k, 2n)
        Consecutive points in units of the state; at least two.
    """

    def __init__(self, points: np.ndarray):
        half = len(points) // 2
        distances, _ = cKDTree(points[:half]).query(points[half:])
        self._reach = SAFETY * float(np.quantile(distances, REACH))
        self._tree = cKDTree(points)
        self._mean = points.mean(axis=0)
        self._sums = np.concatenate((np.zeros((1, points.shape[1])), points.cumsum(axis=0)))
        self._farthest: dict[int, np.ndarray] = {}

        self._weighted = weighted_means(points)
        halves = weighted_means(points[:half]) - weighted_means(points[-half:])
        self._apart = float(np.abs(halves).max())

    def same_torus(self, other: "Signature") -> bool:
        """Return whether two motions, with records of the same length, are on one torus."""
        most = max(SAFE_MEANS * max(self._apart, other._apart), MIN_MEANS)
        return bool(np.abs(self._weighted - other._weighted).max() <= most)

    def holds(self, points: np.ndarray) -> bool:
        """Return whether a motion's points, in units of the state, belong to the same attractor."""
        far, _ = self._tree.query(points)
        if np.mean(far > self._reach) > STRAYS:
            return False
        away = np.abs(points.mean(axis=0) - self._mean)
        return bool(np.all(away <= SAFETY * self._spread(len(points)) + self._reach))

    def _spread(self, size: int) -> np.ndarray:
        """Return the largest distance from the mean over windows of a length, shape (2n,)."""
        size = min(size, len(self._sums) // 2)
        if size not in self._farthest:
            first = np.arange(0, len(self._sums) - size, max(size // PARTS, 1))
            means = (self._sums[first + size] - self._sums[first]) / size
            self._farthest[size] = np.abs(means - self._mean).max(axis=0)
        return self._farthest[size]


def distance(points: np.ndarray, other: np.ndarray) -> float:
    """Return the distance of two attractors by their points, in units of the state.

    The mean distance from a point of one to the nearest of the other, in the direction in which it
    is smaller: an orbit and the one of twice the period into which it doubles are near, and so are
    a small chaotic attractor and the larger one to which it grows in a crisis.

    Parameters
    ----------
    one, other : ndarray, shape (k, 2n), (m, 2n)
    """
    apart = np.abs(points[:, None] - other).max(axis=2)
    return float(min(apart.min(axis=0).mean(), apart.min(axis=1).mean()))


def matched(
    before: list[np.ndarray], now: list[np.ndarray], farthest: float
) -> list[tuple[int, int]]:
    """Match attractors of one amplitude to those of the next: nearest first, each at most once.

    Parameters
    ----------
    before, now : list of ndarray, shapes (k, 2n)
        Points in units of the state.
    farthest : float
        Distance beyond which they do not match.

    Returns
    -------
    list of (int, int)
        Indices in `before` and in `now`.
    """
    near = sorted(
        (distance(points, other), i, j)
        for i, points in enumerate(before)
        for j, other in enumerate(now)
    )
    pairs: list[tuple[int, int]] = []
    for apart, i, j in near:
        free = all(i != taken and j != matching for taken, matching in pairs)
        if apart <= farthest and free:
            pairs.append((i, j))
    return pairs


class KnownMotions:
    """Motions at one point, by their indices.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    same : float
        Largest difference, in units of the state, of points that are one.

    Attributes
    ----------
    attractors : list of Attractor
    neighbourhoods : list of Neighbourhood or None
        Of each; None of what is no orbit.
    """

    def __init__(self, solver, amplitude: float, same: float):
        self._solver, self._amplitude, self._same = solver, amplitude, same
        self._structure, self._units = solver.structure, solver.structure.state_units
        self._members: list[list[np.ndarray]] = []
        self._records: list[tuple[Signature, np.ndarray, int]] = []
        self.attractors: list[Attractor] = []
        self.neighbourhoods: list[Neighbourhood | None] = []

    def copy(self) -> "KnownMotions":
        """Return an independent copy."""
        motions = copy(self)
        motions._records, motions._members = list(self._records), [list(m) for m in self._members]
        motions.attractors = list(self.attractors)
        motions.neighbourhoods = list(self.neighbourhoods)
        return motions

    @property
    def all_orbits(self) -> bool:
        """Whether no other motion has been met."""
        return not self._records

    @property
    def longest(self) -> int:
        """Longest orbit period, 0 if there is none."""
        return max((attractor.orbit_period for attractor in self.attractors), default=0)

    def near(self, state: np.ndarray) -> int | None:
        """Return the index of the orbit in whose neighbourhood, or on which, a state lies."""
        there = int(inside(state[None], self.neighbourhoods)[0])
        if there >= 0:
            return there
        for place, attractor in enumerate(self.attractors):
            away = np.abs(self._scaled(attractor.points - state)).max(axis=1)
            if attractor.orbit_period and np.any(away <= self._same):
                return place
        return None

    def _scaled(self, points: np.ndarray) -> np.ndarray:
        """Return points in units of the state, less what drifts."""
        return self._structure.without_drift(points) / self._units

    def orbit(self, points: np.ndarray) -> int | None:
        """Return the index of an orbit, by its points."""
        scaled, same = self._scaled(points), max(self._same, UNCERTAIN)
        for place, attractor in enumerate(self.attractors):
            if attractor.orbit_period and same_orbit(scaled, self._scaled(attractor.points), same):
                return place
        return None

    def family(self, motion: Motion, seen: Observation, poll=None) -> int | None:
        """Return the index of the family of which a motion, as it was observed, is a member."""
        structure, points, period = self._structure, motion.points, motion.period
        if not (seen.slid or motion.families):
            return None
        slips = slipping(structure, seen.slid, len(seen.points), self._same)
        if not motion.families and len(slips) == len(structure.sliders):
            return None
        for place, attractor in enumerate(self.attractors):
            kind = attractor.orbit_period, attractor.families, attractor.contact, attractor.kind
            if kind != (period, motion.families, seen.contact, motion.kind):
                continue
            if slipping(structure, attractor.sliders, len(seen.points), self._same) != slips:
                continue
            if not period:
                return place
            turned = [
                np.roll(turn, k, axis=0) for turn in self._members[place] for k in range(period)
            ]
            turned.sort(key=lambda turn: separation(structure, turn, points))
            for turn in turned[: max(2, period)]:
                if are_joined(self._solver, self._amplitude, turn, points, motion.families, poll):
                    if len(self._members[place]) < MAX_MEMBERS:
                        self._members[place].append(points)
                    return place
        return None

    def resembling(self, points: np.ndarray) -> int | None:
        """Return the index of the motion, not an orbit, to which points belong."""
        scaled = self._scaled(points)
        return next(
            (place for signature, _, place in self._records if signature.holds(scaled)), None
        )

    def record(self, motion: Motion, seen: Observation) -> int:
        """Return the index of a motion that is no orbit, by a record of it; add it if it is new."""
        scaled = self._scaled(seen.points)
        latest = Signature(scaled)
        torus = MotionClass.QUASI_PERIODIC
        tori = [k for k, each in enumerate(self.attractors) if motion.kind is each.kind is torus]
        resembled = (
            there
            for signature, points, there in self._records
            if signature.holds(scaled)
            or latest.holds(points)
            or (there in tori and latest.same_torus(signature))
        )
        there = next(resembled, None)
        there = self.family(motion, seen) if there is None else there
        if there is not None:
            self.remember(seen.points, there)
            return there
        place = self.add(motion, seen.points, seen, None)
        self._records.append((latest, scaled, place))
        return place

    def remember(self, points: np.ndarray, place: int) -> None:
        """Keep a further record of a motion, which its first record failed to recognise."""
        if len(points) >= 2 * WINDOW and len(self._records) < MAX_RECORDS:
            scaled = self._scaled(points)
            self._records.append((Signature(scaled), scaled, place))

    def add(
        self, motion: Motion, points: np.ndarray, seen: Observation, near: Neighbourhood | None
    ) -> int:
        """Add a motion; return its index."""
        drift = normalised_drift(seen.peak_drift, self._amplitude, self._solver.omega)
        decided = motion.kind, points, motion.period, motion.multiplier, *motion.interval
        observed = seen.contact, float(drift), seen.modal_norm
        sliders = told_of_sliders(self._structure, seen.slid, motion.period, self._same)
        measured: dict[str, Any] = {"measures": seen.measures, "families": motion.families}
        self.attractors.append(Attractor(*decided, *observed, **measured, sliders=sliders))
        self._members.append([points])
        self.neighbourhoods.append(near)
        return len(self.attractors) - 1

    def measured(self, place: int, growth: MeanInterval) -> None:
        """Replace the exponent of a motion by its growth a period, measured for longer."""
        mean, low, high = growth.times(1.0 / self._structure.forcing.period(self._solver.omega))
        self.attractors[place] = replace(
            self.attractors[place], lyapunov=mean, lyapunov_low=low, lyapunov_high=high
        )

    def without(self, replaced: dict[int, int], labels: np.ndarray) -> np.ndarray:
        """Remove motions that are no attractors; return the labels by the indices of the others.

        Starts that resemble a removed one later get the label that replaces it.
        """
        kept = [place for place in range(len(self.attractors)) if place not in replaced]
        now = replaced | {place: new for new, place in enumerate(kept)}
        self.attractors = [self.attractors[place] for place in kept]
        self.neighbourhoods = [self.neighbourhoods[place] for place in kept]
        self._members = [self._members[place] for place in kept]
        self._records = [
            (signature, points, now.get(place, place)) for signature, points, place in self._records
        ]
        return np.array([now.get(label, label) for label in labels.tolist()], int)
