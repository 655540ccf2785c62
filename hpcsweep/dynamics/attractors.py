"""Find all attractors at one point (structure, A, Omega), and which starts reach them.

Starts are classified in groups that double in size, so that later ones use the attractors found by
earlier ones. Once a start enters the neighbourhood of a known orbit (`hpcsweep.dynamics.approach`)
it counts as a start of that orbit. A start still outside all of them after the transient is
compared, by its last `WINDOW` points, with the known motions that are not orbits
(`hpcsweep.dynamics.resemblance`), and only one that resembles none is classified on its own
(`hpcsweep.dynamics.classify_motion`).

Chaos may be a transient, and what looks like a torus the slow approach to an orbit. When all starts
are classified, each motion without a period is therefore put to a test of lifetimes
(`hpcsweep.dynamics.lifetime`): a sample of its own starts is followed until they have come to an
orbit, known or new, or have outlived the periods that the confidence asks for. If one of them ends,
all starts of the motion are followed to their ends, for ever longer stretches: survival is
memoryless, so that each stretch is a test of its own, and a motion that is left when all transient
ones are gone counts as an attractor once it has outlived the periods at risk. Otherwise it is
transient chaos, of which the search keeps the survival, and its starts are those of the orbits in
which they end. An undecided motion is remembered and followed likewise.
"""

import math
from collections import Counter
from collections.abc import Callable
from copy import copy
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.approach import WINDOW, Approached, approach
from hpcsweep.dynamics.attractor import FAILED, UNDECIDED, Attractor
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED, classify_motion
from hpcsweep.dynamics.lifetime import Survival, periods_at_risk
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
SAMPLE = {MotionClass.CHAOTIC: 12, MotionClass.QUASI_PERIODIC: 2, MotionClass.UNDECIDED: 2}
"""Starts of a motion that are tested. Chaos ends at random, so that many starts tell as much as a
long one; the approach to an orbit that is taken for a torus takes its time."""
CHUNK = 512
"""Forcing periods after which a motion that is followed is compared with the known orbits."""
MOST_STRETCHES = 10
"""Stretches for which transient motions are followed, each with twice the periods at risk of the
one before: so that no motion passes one of many tests by chance."""
TRANSIENT = -4
"""Label of starts of a motion that is known to end."""
MOST_WATCHED = 100
"""Longest orbit period for which a motion is watched to converge."""


class Fate(NamedTuple):
    """Where a motion that was followed came to."""

    label: int | None
    """As of `AttractorSearch.labels`; None if it has not ended."""
    state: np.ndarray
    cycles: int


class AttractorSearch:
    """Attractors known so far at one point.

    Parameters
    ----------
    solver, amplitude, settings, max_cycles, confidence, poll
        As in `portrait`.

    Attributes
    ----------
    attractors : list of Attractor
    failures : Counter of Outcome
    cycles : int
        Forcing periods integrated.
    transient : Survival
        Of the starts that were transient chaos.
    n_transient : int
        Number of these starts.
    """

    def __init__(self, solver, amplitude: float, settings, max_cycles: int, confidence, poll):
        self._solver, self._amplitude, self._settings = solver, amplitude, settings
        self._max_cycles, self._poll = max_cycles, poll
        self._at_risk = periods_at_risk(max_cycles, confidence)
        self._units = solver.structure.state_units
        self._rng = np.random.default_rng(0)
        self._neighbourhoods: list[Neighbourhood | None] = []
        self._signatures: list[tuple[Signature, np.ndarray, int]] = []
        self.attractors: list[Attractor] = []
        self.failures: Counter[Outcome] = Counter()
        self.cycles = self.n_transient = self._n_tested = 0
        self.transient = Survival()

    def fork(self, poll: Callable[[], None] | None = None) -> "AttractorSearch":
        """Return a copy of the search, independent of this one."""
        own = copy(self)
        own._poll, own._rng = poll, np.random.default_rng(0)
        own._neighbourhoods, own._signatures = list(self._neighbourhoods), list(self._signatures)
        own.attractors, own.failures, own.cycles = list(self.attractors), Counter(), 0
        own.transient, own.n_transient = Survival(), 0
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
        labels, last = np.empty(len(starts), int), np.array(starts, dtype=float)
        first, size = 0, first_group
        while first < len(starts):
            group = slice(first, first + size)
            labels[group] = self._follow(last[group])
            first, size = first + size, min(2 * size, LARGEST_GROUP)
        return self._tested(labels, last)

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
            label = np.array([own._place(window)])
            found.labels[k] = own._tested(label, window[-1:])[0]
            found.cycles[k] += own.cycles
        return found.labels, found.cycles

    def _follow(self, starts: np.ndarray) -> np.ndarray:
        """Return the labels of a group of starts; replace those near no orbit by their last state.

        Labels beyond the tested attractors are of motions that are still to be tested.
        """
        found = self._approach(starts)
        self.failures.update(found.failures)
        self.cycles += int(found.cycles.sum())
        for k, window in found.windows.items():
            found.labels[k], starts[k] = self._place(window), window[-1]
        return found.labels

    def _tested(self, labels: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Test the lifetimes of motions without a period; return the labels of the starts.

        Parameters
        ----------
        labels : ndarray of int, shape (N,)
            Indices in `attractors`, of motions not yet tested, too; `TRANSIENT` for starts of a
            motion that is known to end; `UNDECIDED` or `FAILED`.
        last : ndarray, shape (N, 2n)
            State from which each start is followed.
        """
        known = np.flatnonzero(labels == TRANSIENT)
        labels[known] = self._to_their_ends(last[known], UNDECIDED)
        replaced: dict[int, int] = {}
        place = self._n_tested
        while place < len(self.attractors):
            one, own = self.attractors[place], np.flatnonzero(labels == place)
            decided = one.kind is not MotionClass.UNDECIDED
            if not one.orbit_period:
                if self._ends(one, last[own]):
                    # its record is one of its motions, too, and may be on what is left
                    states = np.concatenate((last[own], one.points[-1:]))
                    ends = self._to_their_ends(states, place if decided else UNDECIDED)
                    labels[own] = ends[:-1]
                    if not np.any(ends == place):
                        replaced[place] = TRANSIENT
                elif not decided:
                    labels[own], replaced[place] = UNDECIDED, UNDECIDED
            place += 1
        return self._without(replaced, labels)

    def _ends(self, one: Attractor, states: np.ndarray) -> bool:
        """Return whether any motion of a sample ends: of its starts, else from its record."""
        size = SAMPLE[one.kind]
        drawn = states[np.unique(np.linspace(0, len(states), size, endpoint=False).astype(int))]
        later = np.linspace(len(one.points) // 2, len(one.points) - 1, size - len(drawn))
        length = math.ceil(self._at_risk / size)
        sample = np.concatenate((drawn, one.points[later.astype(int)]))
        return any(self._outlive(state, length).label is not None for state in sample)

    def _to_their_ends(self, states: np.ndarray, survivor: int) -> np.ndarray:
        """Follow motions that look alike to their ends; return their labels.

        Those that outlive the periods at risk when no other ends any more get the label `survivor`;
        others that have not ended are undecided.
        """
        labels, ages = np.full(len(states), UNDECIDED), np.zeros(len(states), int)
        left, stretch = np.arange(len(states)), self._at_risk
        for _ in range(MOST_STRETCHES):
            if not left.size:
                break
            length = max(math.ceil(stretch / left.size), CHUNK)
            for k in left.tolist():
                label, states[k], cycles = self._outlive(states[k], length)
                ages[k] += cycles
                labels[k] = UNDECIDED if label is None else label
            still = left[labels[left] == UNDECIDED]
            if still.size == left.size:
                labels[still] = survivor
                break
            left, stretch = still, 2 * stretch
        ended = (labels != UNDECIDED) & (labels != survivor)
        on_transient = ended | (labels == UNDECIDED)
        self.n_transient += int(on_transient.sum())
        survival = Survival(int(ended.sum()), int(ages[on_transient].sum()))
        self.transient = self.transient.followed_by(survival)
        return labels

    def _outlive(self, state: np.ndarray, cycles: int) -> Fate:
        """Follow a motion until it ends in an orbit, for `cycles` forcing periods."""
        done = 0
        while done < cycles:
            end = self._settle(state, min(CHUNK, cycles - done))
            state, done = end.state, done + max(end.n_periods, 1)
            if end.outcome is not Outcome.COMPLETE:
                return Fate(self._failed(end.outcome), state, done)
            there = self._near(state)
            if there is not None:
                return Fate(there, state, done)
            if end.period:
                there, state = self._orbit_of(state)
                if there is not None:
                    return Fate(there, state, done)
        # it may approach an orbit of a period that is too long to be watched for
        there, _ = self._orbit_of(state)
        return Fate(there, state, done)

    def _orbit_of(self, state: np.ndarray) -> tuple[int | None, np.ndarray]:
        """Classify a motion; return the index of the orbit it goes to, if any, and its end."""
        motion = self._classified(state)
        periodic = motion.kind is MotionClass.PERIODIC
        return self._place_orbit(motion) if periodic else None, motion.points[-1]

    def _without(self, replaced: dict[int, int], labels: np.ndarray) -> np.ndarray:
        """Remove motions that are no attractors; return the labels by the indices of the others.

        Starts that resemble a removed one later get the label that replaces it.
        """
        kept = [place for place in range(len(self.attractors)) if place not in replaced]
        now = replaced | {place: new for new, place in enumerate(kept)}
        self.attractors = [self.attractors[place] for place in kept]
        self._neighbourhoods = [self._neighbourhoods[place] for place in kept]
        self._signatures = [
            (own, points, now.get(place, place)) for own, points, place in self._signatures
        ]
        self._n_tested = len(self.attractors)
        return np.array([now.get(label, label) for label in labels.tolist()], int)

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
        """Return the index of a motion without a period, as one that is still to be tested."""
        there = self._resembling(motion.points)
        if there is not None:
            self._remember(motion.points, there)
            return there
        options = {"poll": self._poll, "measures": self._settings.measures}
        seen = self._solver.observe(motion.points[-1], self._amplitude, RECORD, True, **options)
        self.cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return self._failed(seen.outcome)
        # the record itself may have reached an orbit
        end = self._settle(seen.points[-1], 2 * MOST_WATCHED)
        there = self._orbit_of(end.state)[0] if end.period else None
        if there is not None:
            return there
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
        place = self._add(motion, seen.points, seen, None)
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
