"""Find all attractors at one point (structure, A, Omega), and which starts reach them.

Starts are classified in groups that double in size, so that later ones use the attractors found by
earlier ones. Once a start enters the neighbourhood of a known orbit
(`hpcsweep.dynamics.neighbourhood`) it counts as a start of that orbit. A start still outside all of
them after the transient is compared, by its last `WINDOW` points, with the known motions that are
not orbits (`hpcsweep.dynamics.known`), and only one that resembles none is classified on its own
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

Chaos is followed with a tangent vector: the growth over all periods of a sample that outlives them
is the exponent of the attractor.
"""

import math
from collections import Counter
from collections.abc import Callable
from copy import copy

import numpy as np

from hpcsweep.dynamics.attractor import FAILED, UNDECIDED, Attractor, Motion
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED, classify_motion
from hpcsweep.dynamics.known import KnownMotions
from hpcsweep.dynamics.lifetime import Survival, follow_to_ends, outlive, periods_at_risk
from hpcsweep.dynamics.neighbourhood import WINDOW, Approached, approach, neighbourhood
from hpcsweep.dynamics.orbit import returns_near
from hpcsweep.dynamics.stability import MeanInterval, aligned, growth_interval
from hpcsweep.solvers.offers import TANGENTS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.records import Approach, Observation

FIRST_GROUP, MAX_GROUP = 4, 256
"""Starts of the first group, and of the largest."""
PATIENCE = 48
"""Forcing periods after which a start is classified where only orbits are known."""
RECORD = 2000
"""Forcing periods of the record of a motion that is not an orbit."""
LADDER = 4, 16
"""Transients for which a start that resembles no known motion is followed, before it is compared
again, and finally classified: it may approach one of them slowly."""
SAMPLE = {MotionClass.CHAOTIC: 12, MotionClass.QUASI_PERIODIC: 2, MotionClass.UNDECIDED: 2}
"""Starts of a motion that are tested. Chaos ends at random, so that many starts tell as much as a
long one; the approach to an orbit that is taken for a torus takes its time."""
TRANSIENT = -4
"""Label of starts of a motion that is known to end."""
MAX_WATCHED = 100
"""Longest orbit period for which a motion is watched to converge."""
TURNS = 4
"""Turns of the longest orbit for which chaos is watched that is again where it was."""

Stretch = Callable[[np.ndarray, int], tuple[np.ndarray, int, int | None]]
"""Follows a state for so many forcing periods: the state it comes to, how many it took, and the
label of the orbit that it has ended in."""


class AttractorSearch:
    """Attractors known so far at one point.

    Parameters
    ----------
    solver : Solver
        Of the structure and the frequency.
    amplitude : float
    settings : SweepSettings
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    confidence : float
        Of the tests of lifetimes.
    poll : callable or None
        Called before each start and within long ones; may raise to leave.

    Attributes
    ----------
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
        self._max_cycles, self.confidence, self._poll = max_cycles, confidence, poll
        self._at_risk = periods_at_risk(max_cycles, confidence)
        self._rng = np.random.default_rng(0)
        self._known = KnownMotions(solver, amplitude, settings.period_tolerance)
        self.failures: Counter[Outcome] = Counter()
        self.cycles = self.n_transient = self._n_tested = 0
        self.transient = Survival()

    def fork(self, poll: Poll = None) -> "AttractorSearch":
        """Return a copy of the search, independent of this one."""
        other = copy(self)
        other._poll, other._rng = poll, np.random.default_rng(0)
        other._known, other.failures, other.cycles = self._known.copy(), Counter(), 0
        other.transient, other.n_transient = Survival(), 0
        return other

    @property
    def attractors(self) -> list[Attractor]:
        """Attractors that are known, and motions that are still to be tested."""
        return self._known.attractors

    def labels(self, starts: np.ndarray, first_group: int = FIRST_GROUP) -> np.ndarray:
        """Classify starts: return their indices in `attractors`, `UNDECIDED` or `FAILED`.

        Parameters
        ----------
        starts : ndarray, shape (N, 2n)
        first_group : int
            Size of the first group; the others double in size, up to `MAX_GROUP`.

        Returns
        -------
        ndarray of int, shape (N,)
        """
        labels, last = np.empty(len(starts), int), np.array(starts, dtype=float)
        first, size = 0, first_group
        while first < len(starts):
            group = slice(first, first + size)
            labels[group] = self._follow(last[group])
            first, size = first + size, min(2 * size, MAX_GROUP)
        return self._tested(labels, last)

    def alone(self, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Classify starts, each by the attractors known now alone.

        Returns
        -------
        labels, cycles : ndarray of int, shape (N,)
            As of `labels`, and the forcing periods integrated for each start.
        """
        approached = self._approach(starts)
        for k, window in approached.windows.items():
            search = self.fork(self._poll)
            label = np.array([search._place(window)])
            approached.labels[k] = search._tested(label, window[-1:])[0]
            approached.cycles[k] += search.cycles
        return approached.labels, approached.cycles

    def _follow(self, starts: np.ndarray) -> np.ndarray:
        """Return the labels of a group of starts; replace those near no orbit by their last state.

        Labels beyond the tested attractors are of motions that are still to be tested.
        """
        approached = self._approach(starts)
        self.failures.update(approached.failures)
        self.cycles += int(approached.cycles.sum())
        for k, window in approached.windows.items():
            approached.labels[k], starts[k] = self._place(window), window[-1]
        return approached.labels

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
        ending = np.flatnonzero(labels == TRANSIENT)
        labels[ending] = self._to_their_ends(last[ending], UNDECIDED)
        replaced: dict[int, int] = {}
        place = self._n_tested
        while place < len(self.attractors):
            attractor, reached = self.attractors[place], np.flatnonzero(labels == place)
            decided = attractor.kind is not MotionClass.UNDECIDED
            if not attractor.orbit_period:
                growth = self._outlived(attractor, last[reached])
                if growth is None:
                    # its record is one of its motions, too, and may be on what is left
                    states = np.concatenate((last[reached], attractor.points[-1:]))
                    ends = self._to_their_ends(states, place if decided else UNDECIDED)
                    labels[reached] = ends[:-1]
                    if np.any(ends == place):
                        growth = self._outlived(attractor, states[ends == place])
                    else:
                        replaced[place] = TRANSIENT
                elif not decided:
                    labels[reached], replaced[place] = UNDECIDED, UNDECIDED
                if growth is not None and not math.isnan(growth.mean):
                    self._known.measured(place, growth)
            place += 1
        labels = self._known.without(replaced, labels)
        self._n_tested = len(self.attractors)
        return labels

    def _outlived(self, attractor: Attractor, states: np.ndarray) -> MeanInterval | None:
        """Follow a sample of motions: of its starts, else from its record; None if any ends.

        Otherwise the growth a period, NaN but of chaos, whose record is one motion: its points tell
        the same until rounding has grown, for 10,000 periods where chaos is weak.
        """
        size, chaotic = SAMPLE[attractor.kind], attractor.kind is MotionClass.CHAOTIC
        evenly = np.unique(np.linspace(0, len(states), size, endpoint=False).astype(int))
        drawn = states[evenly[: len(states)]]  # none where only a seed came to it
        more = int(not len(drawn)) if chaotic else size - len(drawn)
        later = np.linspace(len(attractor.points) // 2, len(attractor.points) - 1, more)
        sample = np.concatenate((drawn, attractor.points[later.astype(int)]))
        length, grown = math.ceil(self._at_risk / len(sample)), [np.empty(0)]
        for state in sample:
            logarithms: list[np.ndarray] = []
            stretch = self._growing(logarithms) if chaotic else self._stretch
            if self._outlive(state, length, stretch)[2] is not None:
                return None
            grown.append(aligned(np.concatenate(logarithms or grown[:1])))
        return growth_interval(np.concatenate(grown))

    def _growing(self, grown: list[np.ndarray]) -> Stretch:
        """Return what follows a motion for stretches of `outlive`, with a tangent vector.

        It is watched where it returns to the end of a stretch: to it, it has ended.
        """
        structure, direction = self._solver.structure, None

        def stretch(state: np.ndarray, cycles: int) -> tuple[np.ndarray, int, int | None]:
            nonlocal direction
            seen = self._solver.grow(state, self._amplitude, cycles, self._poll, direction)
            points, direction = seen.points, seen.direction
            self.cycles += len(points)
            if seen.outcome is not Outcome.COMPLETE:
                return state, len(points), self._failed(seen.outcome)
            grown.append(seen.logarithms)
            there, last = self._known.near(points[-1]), points[-1 - self._longest :]
            near = structure.without_drift(last) / structure.state_units
            if there is None and returns_near(near, NEAR):
                there = self._stretch(points[-1], TURNS * self._longest)[2]
            return points[-1], cycles, there

        return stretch

    def _to_their_ends(self, states: np.ndarray, survivor: int) -> np.ndarray:
        """Follow motions that look alike to their ends; return their labels.

        Those that outlive the periods at risk when no other ends any more get the label `survivor`;
        others that have not ended are undecided.
        """
        ends, ages, outlived = follow_to_ends(self._outlive, states, self._at_risk)
        lasting = survivor if outlived else UNDECIDED
        labels = np.array([lasting if end is None else end for end in ends], int)
        ended = (labels != UNDECIDED) & (labels != survivor)
        on_transient = ended | (labels == UNDECIDED)
        self.n_transient += int(on_transient.sum())
        escapes, at_risk = self.transient
        at_risk += int(ages[on_transient].sum())
        self.transient = Survival(escapes + int(ended.sum()), at_risk)
        return labels

    def _outlive(
        self, state: np.ndarray, cycles: int, stretch: Stretch | None = None
    ) -> tuple[np.ndarray, int, int | None]:
        """Follow a motion until it ends in an orbit: where it is, how long it took, the label."""
        state, done, there = outlive(stretch or self._stretch, state, cycles)
        if there is None:
            # it may approach an orbit of a period that is too long to be watched for
            there, _ = self._orbit_of(state)
        return state, done, there

    def _stretch(self, state: np.ndarray, cycles: int) -> tuple[np.ndarray, int, int | None]:
        """Follow a motion for a stretch of `outlive`."""
        end = self._settle(state, cycles)
        state = end.state
        if end.outcome is not Outcome.COMPLETE:
            return state, end.n_periods, self._failed(end.outcome)
        there, n_periods = self._known.near(state), end.n_periods
        if there is None and end.period:
            before = self.cycles
            there, state = self._orbit_of(state)
            if there is None and not TANGENTS.of(self._solver.structure):
                n_periods += self.cycles - before  # at a kink it closes again at once
        return state, n_periods, there

    def _orbit_of(self, state: np.ndarray) -> tuple[int | None, np.ndarray]:
        """Classify a motion; return the index of the orbit it goes to, if any, and its end."""
        motion = self._classified(state)
        periodic = motion.kind is MotionClass.PERIODIC
        return self._place_orbit(motion) if periodic else None, motion.points[-1]

    def _approach(self, starts: np.ndarray) -> Approached:
        longest, known = PATIENCE, self._known
        if not known.all_orbits:
            longest = max(min(self._settings.transient_cycles, self._max_cycles), PATIENCE, WINDOW)
        return approach(
            self._solver, self._amplitude, starts, known.neighbourhoods, longest, self._poll
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
        there = self._known.resembling(window)
        if there is not None:
            return there
        state = window[-1]
        long = self._longest > self._settings.max_orbit_period
        for factor in LADDER if long or not self._known.all_orbits else ():
            cycles = min(factor * self._settings.transient_cycles, self._max_cycles)
            state, _, there = self._stretch(state, cycles)
            if there is not None:
                return there
            points, outcome = self._solver.points(state, self._amplitude, WINDOW, self._poll)
            self.cycles += len(points)
            if outcome is not Outcome.COMPLETE:
                return self._failed(outcome)
            there = self._known.resembling(points)
            if there is not None:
                return there
            state = points[-1]
        return self.classify(state)

    @property
    def _longest(self) -> int:
        """Longest period that is known or sought."""
        return max(self._settings.max_orbit_period, min(self._known.longest, MAX_WATCHED))

    def _settle(self, state: np.ndarray, cycles: int) -> Approach:
        """Follow a motion until it reaches an orbit, for at most `cycles` forcing periods."""
        rules = cycles, self._longest, SETTLED, self._settings.period_tolerance, NEAR
        end = self._solver.settle(state, self._amplitude, *rules, self._poll)
        self.cycles += end.n_periods + end.n_newton
        return end

    def _failed(self, outcome: Outcome) -> int:
        self.failures[outcome] += 1
        return FAILED

    def _place_orbit(self, motion: Motion) -> int:
        """Return the index of a motion classified as an orbit."""
        there = self._known.orbit(motion.points)
        if there is not None:
            return there
        seen = self._observe(motion, motion.period)
        if seen.outcome is not Outcome.COMPLETE:
            return self._failed(seen.outcome)
        there = self._known.family(motion, seen, self._poll)
        if there is not None:
            return there
        near = None
        if not motion.families:
            near = neighbourhood(self._solver, self._amplitude, motion.points, self._rng)
        return self._known.add(motion, motion.points, seen, near)

    def _observe(self, motion: Motion, n_periods: int) -> Observation:
        options = {"poll": self._poll, "measures": self._settings.measures}
        z = motion.points[-1]
        return self._solver.observe(z, self._amplitude, n_periods, True, **options)

    def _place_aperiodic(self, motion: Motion) -> int:
        """Return the index of a motion without a period, as one that is still to be tested."""
        there = self._known.resembling(motion.points)
        if there is not None:
            self._known.remember(motion.points, there)
            return there
        seen = self._observe(motion, RECORD)
        self.cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return self._failed(seen.outcome)
        # the record itself may have reached an orbit
        end = self._settle(seen.points[-1], 2 * MAX_WATCHED)
        there = self._orbit_of(end.state)[0] if end.period else None
        if there is not None:
            return there
        return self._known.record(motion, seen)
