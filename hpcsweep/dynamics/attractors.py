"""Find all attractors at one point (structure, A, Omega), and which starts reach them.

Starts are classified in groups that double in size, so that later ones use the attractors found by
earlier ones. Once a start enters the neighbourhood of a known orbit (`hpcsweep.dynamics.approach`)
it counts as a start of that orbit. A start still outside all of them after the transient is
compared, by its last `WINDOW` points, with the known motions that are not orbits
(`hpcsweep.dynamics.resemblance`), and only one that resembles none is classified on its own
(`hpcsweep.dynamics.classify_motion`).

Chaos may be a long transient. A new motion that is classified as no orbit is therefore followed for
`max_cycles` forcing periods; if it converges to an orbit on the way, that is its attractor. A
transient with mean lifetime L passes this test with probability exp(-max_cycles / L). An undecided
motion is remembered likewise, so that starts that resemble it count as undecided at the cost of a
window.
"""

from collections import Counter
from collections.abc import Callable
from copy import copy

import numpy as np

from hpcsweep.dynamics.approach import WINDOW, Approached, approach
from hpcsweep.dynamics.attractor import FAILED, UNDECIDED, Attractor
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED, classify_motion
from hpcsweep.dynamics.motion import Motion
from hpcsweep.dynamics.neighbourhood import Neighbourhood, inside, neighbourhood
from hpcsweep.dynamics.resemblance import Signature, same_orbit
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, normalised_drift

FIRST_GROUP, LARGEST_GROUP = 4, 256
"""Starts of the first group, and of the largest."""
PATIENCE = 48
"""Forcing periods after which a start is classified where only orbits are known."""
RECORD = 2000
"""Forcing periods of the record of a motion that is not an orbit."""
MOST_RECORDS = 16
"""Most records of motions that are not orbits."""
LADDER = 4, 16
"""Transients for which a start that resembles no known motion is followed, before it is compared
again, and finally classified: it may approach one of them slowly."""
FEW, LONGER = 5, 20
"""Starts up to which a motion that is not an orbit is followed for `LONGER` times `max_cycles`
before it counts as an attractor."""
MOST_WATCHED = 100
"""Longest orbit period for which a motion is watched to converge."""


class AttractorSearch:
    """Attractors known so far at one point.

    Parameters
    ----------
    solver, amplitude, settings, max_cycles, poll
        As in `portrait`.
    """

    def __init__(self, solver, amplitude: float, settings, max_cycles: int, poll):
        self._solver, self._amplitude, self._settings = solver, amplitude, settings
        self._max_cycles, self._poll = max_cycles, poll
        self._units = solver.structure.state_units
        self._rng = np.random.default_rng(0)
        self._neighbourhoods: list[Neighbourhood | None] = []
        self._signatures: list[tuple[Signature, np.ndarray, int]] = []
        self.attractors: list[Attractor] = []
        self.failures: Counter[Outcome] = Counter()
        self.cycles = 0

    def fork(self, poll: Callable[[], None] | None = None) -> "AttractorSearch":
        """Return a copy of the search, independent of this one."""
        own = copy(self)
        own._poll, own._rng = poll, np.random.default_rng(0)
        own._neighbourhoods, own._signatures = list(self._neighbourhoods), list(self._signatures)
        own.attractors, own.failures, own.cycles = list(self.attractors), Counter(), 0
        return own

    def labels(self, starts: np.ndarray, first_group: int = FIRST_GROUP) -> np.ndarray:
        """Classify starts: return their indices in `attractors`, `UNDECIDED` or `FAILED`.

        Parameters
        ----------
        starts : ndarray, shape (N, 2n)
        first_group : int
            Size of the first group; the others double in size, up to `LARGEST_GROUP`.

        Returns
        -------
        ndarray of int, shape (N,)
        """
        labels = np.empty(len(starts), int)
        first, size = 0, first_group
        while first < len(starts):
            labels[first : first + size] = self._follow(starts[first : first + size])
            first, size = first + size, min(2 * size, LARGEST_GROUP)
        return labels

    def confirmed(self, labels: np.ndarray) -> np.ndarray:
        """Follow non-orbits that few starts reached for longer: they may be transients.

        Parameters
        ----------
        labels : ndarray of int
            From `labels`. A motion that turns out to end in an orbit is removed from `attractors`.

        Returns
        -------
        ndarray of int
            Labels with the new indices of the attractors.
        """
        place_of = np.arange(len(self.attractors))
        for place, one in enumerate(self.attractors[:]):
            if one.orbit_period or (labels == place).sum() > FEW:
                continue
            end = self._settle(one.points[-1], LONGER * self._max_cycles)
            if end.outcome is Outcome.COMPLETE and end.period:
                motion = self._classified(end.state)
                if motion.kind is MotionClass.PERIODIC:
                    there = self._place_orbit(motion)
                    place_of = np.append(place_of, range(len(place_of), len(self.attractors)))
                    place_of[place] = there
        kept = np.flatnonzero(place_of == np.arange(len(place_of)))
        now = {int(old): new for new, old in enumerate(kept)}
        self.attractors = [self.attractors[old] for old in kept]
        self._neighbourhoods = [self._neighbourhoods[old] for old in kept]
        moved = [now.get(int(place), int(place)) for place in place_of]
        self._signatures = [
            (own, points, moved[place]) if place in now else (own, points, place)
            for own, points, place in self._signatures
            if place < 0 or place in now
        ]
        return np.array([moved[label] if label >= 0 else label for label in labels], int)

    def alone(self, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Classify starts, each by the attractors known now alone.

        Returns
        -------
        labels, cycles : ndarray of int, shape (N,)
            As of `labels`, and the forcing periods integrated for each start.
        """
        found = self._approach(starts)
        for k, window in found.windows.items():
            own = self.fork(self._poll)
            found.labels[k] = own._place(window)
            found.cycles[k] += own.cycles
        return found.labels, found.cycles

    def _follow(self, starts: np.ndarray) -> np.ndarray:
        """Return the labels of a group of starts."""
        found = self._approach(starts)
        self.failures.update(found.failures)
        self.cycles += int(found.cycles.sum())
        for k, window in found.windows.items():
            found.labels[k] = self._place(window)
        return found.labels

    def _approach(self, starts: np.ndarray) -> Approached:
        longest = max(min(self._settings.transient_cycles, self._max_cycles), PATIENCE, WINDOW)
        return approach(
            self._solver,
            self._amplitude,
            starts,
            self._neighbourhoods,
            longest if self._signatures else PATIENCE,
            self._poll,
        )

    def classify(self, state: np.ndarray) -> int:
        """Classify a motion; return its index in `attractors`, `UNDECIDED` or `FAILED`."""
        motion = self._classified(state)
        if motion.outcome is not Outcome.COMPLETE or motion.kind is MotionClass.FAILED:
            return self._failed(motion.outcome)
        if motion.kind is MotionClass.PERIODIC:
            return self._place_orbit(motion)
        return self._place_aperiodic(motion)

    def _classified(self, state: np.ndarray) -> Motion:
        motion = classify_motion(
            self._solver, state, self._amplitude, self._settings, self._max_cycles, self._poll
        )
        self.cycles += motion.cycles
        return motion

    def _place(self, window: np.ndarray) -> int:
        """Classify a start by its last points, away from all known orbits."""
        there = self._resembling(window)
        if there is not None:
            return there
        state = window[-1]
        long = self._longest > self._settings.max_orbit_period
        for factor in LADDER if self._signatures or long else ():
            cycles = min(factor * self._settings.transient_cycles, self._max_cycles)
            end = self._settle(state, cycles)
            if end.outcome is not Outcome.COMPLETE:
                return self._failed(end.outcome)
            state = end.state
            there = self._near(state)
            if there is not None:
                return there
            if end.period:
                break
            points, outcome = self._solver.points(state, self._amplitude, WINDOW, self._poll)
            self.cycles += len(points)
            if outcome is not Outcome.COMPLETE:
                return self._failed(outcome)
            there = self._resembling(points)
            if there is not None:
                return there
            state = points[-1]
        return self.classify(state)

    @property
    def _longest(self) -> int:
        """Longest period that is known or sought."""
        known = (one.orbit_period for one in self.attractors)
        return max(self._settings.max_orbit_period, min(max(known, default=0), MOST_WATCHED))

    def _near(self, state: np.ndarray) -> int | None:
        """Return the index of the orbit in whose neighbourhood, or on which, a state lies."""
        there = int(inside(state[None], self._neighbourhoods)[0])
        if there >= 0:
            return there
        same = self._settings.period_tolerance * self._units
        for place, one in enumerate(self.attractors):
            if one.orbit_period and np.any(np.all(np.abs(one.points - state) <= same, axis=1)):
                return place
        return None

    def _settle(self, state: np.ndarray, cycles: int) -> Approach:
        """Follow a motion until it reaches an orbit, for at most `cycles` forcing periods."""
        settings = self._settings
        end = self._solver.settle(
            state,
            self._amplitude,
            cycles,
            self._longest,
            SETTLED,
            settings.period_tolerance,
            NEAR,
            self._poll,
        )
        self.cycles += end.n_periods + end.n_newton
        return end

    def _failed(self, outcome: Outcome) -> int:
        self.failures[outcome] += 1
        return FAILED

    def _resembling(self, points: np.ndarray) -> int | None:
        """Return the index of the known motion, not an orbit, to which points belong."""
        scaled = points / self._units
        return next((place for own, _, place in self._signatures if own.holds(scaled)), None)

    def _place_orbit(self, motion: Motion) -> int:
        """Return the index of a motion classified as an orbit."""
        scaled, same = motion.points / self._units, self._settings.period_tolerance
        for place, known in enumerate(self.attractors):
            if known.orbit_period and same_orbit(scaled, known.points / self._units, same):
                return place
        seen = self._solver.observe(
            motion.points[-1],
            self._amplitude,
            motion.period,
            True,
            poll=self._poll,
            measures=self._settings.measures,
        )
        if seen.outcome is not Outcome.COMPLETE:
            return self._failed(seen.outcome)
        near = neighbourhood(self._solver, self._amplitude, motion.points, self._rng)
        return self._add(motion, motion.points, seen, near)

    def _place_aperiodic(self, motion: Motion) -> int:
        """Return the index of a motion that is not an orbit, or undecided, if it stays so."""
        there = self._resembling(motion.points)
        if there is not None:
            self._remember(motion.points, there)
            return there
        end = self._settle(motion.points[-1], max(self._max_cycles - motion.cycles, 0))
        if end.outcome is not Outcome.COMPLETE:
            return self._failed(end.outcome)
        if end.period:
            settled = self._classified(end.state)
            if settled.kind is MotionClass.PERIODIC:
                return self._place_orbit(settled)
        options = {"poll": self._poll, "measures": self._settings.measures}
        seen = self._solver.observe(end.state, self._amplitude, RECORD, True, **options)
        self.cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return self._failed(seen.outcome)
        if motion.kind is MotionClass.CHAOTIC:
            # the record itself may have reached an orbit
            end = self._settle(seen.points[-1], 2 * MOST_WATCHED)
            settled = self._classified(end.state) if end.period else motion
            if settled.kind is MotionClass.PERIODIC:
                return self._place_orbit(settled)
        scaled = seen.points / self._units
        own = Signature(scaled)
        for signature, points, there in self._signatures:
            is_torus = motion.kind is MotionClass.QUASI_PERIODIC and self._is_torus(there)
            if (
                signature.holds(scaled)
                or own.holds(points)
                or (is_torus and own.same_torus(signature))
            ):
                self._remember(seen.points, there)
                return there
        decided = motion.kind is not MotionClass.UNDECIDED
        place = self._add(motion, seen.points, seen, None) if decided else UNDECIDED
        self._signatures.append((own, scaled, place))
        return place

    def _is_torus(self, place: int) -> bool:
        return place >= 0 and self.attractors[place].kind is MotionClass.QUASI_PERIODIC

    def _remember(self, points: np.ndarray, place: int) -> None:
        """Keep a further record of a known motion, which its first record failed to recognise."""
        if len(points) >= 2 * WINDOW and len(self._signatures) < MOST_RECORDS:
            scaled = points / self._units
            self._signatures.append((Signature(scaled), scaled, place))

    def _add(self, motion: Motion, points: np.ndarray, seen, near: Neighbourhood | None) -> int:
        """Add an attractor; return its index."""
        drift = normalised_drift(seen.peak_drift, self._amplitude, self._solver.omega)
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
                float(drift),
                seen.modal_norm,
                measures=seen.measures,
            )
        )
        self._neighbourhoods.append(near)
        return len(self.attractors) - 1
