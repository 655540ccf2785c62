"""The motions known so far at one point, and which of them a motion has come to.

An orbit is recognised by its neighbourhood or by its points, other motions by how often they visit
which places (`resemblance`), of which one motion may need several records.
"""

from copy import copy

import numpy as np

from hpcsweep.dynamics.approach import WINDOW
from hpcsweep.dynamics.attractor import Attractor
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.motion import Motion
from hpcsweep.dynamics.neighbourhood import Neighbourhood, inside
from hpcsweep.dynamics.resemblance import Signature, same_orbit
from hpcsweep.solvers.records import Observation, normalised_drift

UNCERTAIN = 1e-6
"""Distance within which two orbits that attract are one: at a fold they are known to the root of
rounding, to which motions do not come from one side as from another."""
MAX_RECORDS = 16
"""Most records of motions that are not orbits."""


class KnownMotions:
    """Motions at one point, by their indices.

    Parameters
    ----------
    units : ndarray, shape (2n,)
        Of the state.
    same : float
        Largest difference, in units of the state, of points that are one.
    amplitude, omega : float
        Of the point.

    Attributes
    ----------
    attractors : list of Attractor
    neighbourhoods : list of Neighbourhood or None
        Of each; None of what is no orbit.
    """

    def __init__(self, units: np.ndarray, same: float, amplitude: float, omega: float):
        self._units, self._same, self._point = units, same, (amplitude, omega)
        self._records: list[tuple[Signature, np.ndarray, int]] = []
        self.attractors: list[Attractor] = []
        self.neighbourhoods: list[Neighbourhood | None] = []

    def copy(self) -> "KnownMotions":
        """Return an independent copy."""
        own = copy(self)
        own._records = list(self._records)
        own.attractors, own.neighbourhoods = list(self.attractors), list(self.neighbourhoods)
        return own

    @property
    def all_orbits(self) -> bool:
        """Whether no other motion has been met."""
        return not self._records

    @property
    def longest(self) -> int:
        """Longest orbit period, 0 if there is none."""
        return max((one.orbit_period for one in self.attractors), default=0)

    def near(self, state: np.ndarray) -> int | None:
        """Return the index of the orbit in whose neighbourhood, or on which, a state lies."""
        there = int(inside(state[None], self.neighbourhoods)[0])
        if there >= 0:
            return there
        same = self._same * self._units
        for place, one in enumerate(self.attractors):
            if one.orbit_period and np.any(np.all(np.abs(one.points - state) <= same, axis=1)):
                return place
        return None

    def orbit(self, points: np.ndarray) -> int | None:
        """Return the index of an orbit, by its points."""
        scaled, same = points / self._units, max(self._same, UNCERTAIN)
        for place, known in enumerate(self.attractors):
            if known.orbit_period and same_orbit(scaled, known.points / self._units, same):
                return place
        return None

    def resembling(self, points: np.ndarray) -> int | None:
        """Return the index of the motion, not an orbit, to which points belong."""
        scaled = points / self._units
        return next((place for own, _, place in self._records if own.holds(scaled)), None)

    def record(self, motion: Motion, seen: Observation) -> int:
        """Return the index of a motion that is no orbit, by a record of it; add it if it is new."""
        scaled = seen.points / self._units
        own = Signature(scaled)
        for signature, points, there in self._records:
            is_torus = motion.kind is MotionClass.QUASI_PERIODIC and self._is_torus(there)
            if (
                signature.holds(scaled)
                or own.holds(points)
                or (is_torus and own.same_torus(signature))
            ):
                self.remember(seen.points, there)
                return there
        place = self.add(motion, seen.points, seen, None)
        self._records.append((own, scaled, place))
        return place

    def _is_torus(self, place: int) -> bool:
        return place >= 0 and self.attractors[place].kind is MotionClass.QUASI_PERIODIC

    def remember(self, points: np.ndarray, place: int) -> None:
        """Keep a further record of a motion, which its first record failed to recognise."""
        if len(points) >= 2 * WINDOW and len(self._records) < MAX_RECORDS:
            scaled = points / self._units
            self._records.append((Signature(scaled), scaled, place))

    def add(
        self, motion: Motion, points: np.ndarray, seen: Observation, near: Neighbourhood | None
    ) -> int:
        """Add a motion; return its index."""
        self.attractors.append(
            Attractor(
                motion.kind,
                points,
                motion.period,
                motion.multiplier,
                motion.exponent,
                motion.exponent_low,
                motion.exponent_high,
                seen.contact,
                float(normalised_drift(seen.peak_drift, *self._point)),
                seen.modal_norm,
                measures=seen.measures,
            )
        )
        self.neighbourhoods.append(near)
        return len(self.attractors) - 1

    def without(self, replaced: dict[int, int], labels: np.ndarray) -> np.ndarray:
        """Remove motions that are no attractors; return the labels by the indices of the others.

        Starts that resemble a removed one later get the label that replaces it.
        """
        kept = [place for place in range(len(self.attractors)) if place not in replaced]
        now = replaced | {place: new for new, place in enumerate(kept)}
        self.attractors = [self.attractors[place] for place in kept]
        self.neighbourhoods = [self.neighbourhoods[place] for place in kept]
        self._records = [
            (own, points, now.get(place, place)) for own, points, place in self._records
        ]
        return np.array([now.get(label, label) for label in labels.tolist()], int)
