"""What motion a state goes to: integrated on until it is known, or a cap is reached.

In rounds the motion is watched for an orbit that is near, unless small differences grow, and then
observed with a tangent vector, each time for twice as long. It is

- periodic if Newton's method has proved the orbit it goes to (`solvers.flow.transient`), or its
  points have closed and stay closed (`orbit.closed_period`), and the orbit does not repel;
- chaotic if the largest Lyapunov exponent over all rounds is above 0 with confidence
  (`exponent.growth_interval`), a small difference has grown by `CHAOS_GROWTH` in the logarithm
  over the last one, and no orbit has ended it `CONFIRMED` periods later;
- quasi-periodic if over `LEAST_TORUS` periods or more there is no growth (`TORUS_GROWTH`), the
  exponent is not below 0 with confidence, weighted means over both halves agree to `TORUS_DIGITS`
  (`birkhoff`), and no orbit is proved that the torus is locked to.

A motion that repeats although it repels stays there until rounding drives it away; it is driven by
`PUSH` at once. Chaos may be a transient that would end later.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hpcsweep.dynamics.birkhoff import agreeing_digits
from hpcsweep.dynamics.classify import (
    CHAOS_GROWTH,
    NEUTRAL_GROWTH,
    MotionClass,
)
from hpcsweep.dynamics.exponent import UNKNOWN, Interval, aligned, growth_interval
from hpcsweep.dynamics.orbit import (
    approached_period,
    closed_period,
    returning_period,
    smallest_period,
    stays_near_orbit,
)
from hpcsweep.dynamics.stability import exponent_of_multiplier, floquet_multipliers
from hpcsweep.model.arguments import count
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Growth, Observation

SETTLED = 1e-10
"""Largest estimated distance (gaps, gaps omega_0) from the orbit at which a motion is on it."""
NEAR = 1e-3
"""Distance between points a period apart from which on a jump is tried."""
LONGEST = 64
"""Longest orbit period to which Newton's method jumps, in forcing periods. Longer ones, up to half
of what is observed, are recognised when they have closed."""
LONGER = 32
"""Of a round of many periods orbits up to a part of it as long are jumped to. Motions locked to
an orbit of long period wander before: a longer part costs more than it saves."""
WATCHED = 4 * LONGEST
"""Forcing periods that are watched in each round."""
FIRST_ROUND = 200
"""Forcing periods that are observed in the first."""
CONFIRMED = 100
"""Forcing periods for which chaos is watched for an orbit that ends it. Of 163 windows of 100
periods with a growth of chaos, drawn from the map of Figure 6 as described, 10 ended in an orbit
within 3,000 more: 4 within 100, 8 within 300."""
LEAST_TORUS = 800
"""Fewest points by which a torus is told from what is nearly one."""
TORUS_GROWTH = 0.5
"""Largest growth over such a round, either sign. An orbit of long period that a torus is locked to
is approached along it: P50 and P90 (Figure 3 as described, A = 0.1015 and 0.1005) by -1.8 and
-2.2."""
LONG_TORUS = 3200
"""Periods from which on `NEUTRAL_GROWTH` is allowed: slow drift along a torus makes the growth
swing by 2 and more."""
TORUS_DIGITS = 5.0
"""Of tori drawn from the map of Figure 6 as described weighted means agree to 4.7 to 11.2 digits
after 800 periods and to more after more; those of chaos beside a torus (Figure 3 as described, A =
0.1025 down, exponent 0.0035 / T) to 2.6 to 4.7 after 400 to 3,200."""
HINT_DIGITS = 2.5
"""The same of shorter rounds, after which as many periods are observed as a torus needs."""
REPELS = 1e-5
"""Excess over 1 of the largest multiplier above which an orbit repels; it is exact to less."""
PUSH = 1e-8
"""In units of the state."""
NEWTON_STEPS = 8
LINEAR = 0.05
"""Share of the distance to an orbit by which the map may differ from its tangent."""


@dataclass(frozen=True)
class Motion:
    """The motion that a state goes to.

    Attributes
    ----------
    kind : MotionClass
        PERIODIC, QUASI_PERIODIC, CHAOTIC, UNDECIDED or FAILED.
    points : ndarray, shape (k, 2n)
        Of an orbit its p points in their order; of other motions the last points that were seen.
    period : int
        Orbit period p in forcing periods, 0 of other motions.
    multiplier : float
        Modulus of the orbit's largest Floquet multiplier; NaN of other motions.
    exponent, exponent_low, exponent_high : float
        Largest Lyapunov exponent per unit of time with its confidence interval, which of an orbit
        is a point; NaN if not known.
    cycles : int
        Forcing periods integrated.
    outcome : Outcome
        Of the solver.
    seen : Observation, optional
        The window, if it was told by that, and is no orbit.
    """

    kind: MotionClass
    points: np.ndarray
    period: int
    multiplier: float
    exponent: float
    exponent_low: float
    exponent_high: float
    cycles: int
    outcome: Outcome
    seen: Observation | None = None

    @property
    def interval(self) -> Interval:
        """The exponent with its interval."""
        return Interval(self.exponent, self.exponent_low, self.exponent_high)


def decide(
    solver,
    state: np.ndarray,
    amplitude: float,
    settings,
    max_cycles: int,
    poll: Callable[[], None] | None = None,
    window: Observation | None = None,
) -> Motion:
    """Find out which motion a state goes to.

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
        At tau = 0.
    amplitude : float
    settings : SweepSettings
        Of the runs: their ``max_orbit_period`` and ``period_tolerance``.
    max_cycles : int
        Forcing periods after which it is given up as undecided; the last round may be cut short.
    poll : callable, optional
        Called within long work; may raise to leave.
    window : Observation, optional
        Of a window that has ended in `state`, with the growth of a tangent vector: the first
        round.
    """
    search = _Search(solver, amplitude, settings, poll)
    max_cycles = count("max_cycles", max_cycles)
    z = np.array(state, dtype=float)
    length, last = FIRST_ROUND, z[None]
    if window is not None:
        last = window.points
        length = len(window.points)
        motion = search.confirm(search.judge(window), z, max_cycles)
        if motion is not None:
            return motion
        z = search.end
    while search.cycles < max_cycles:
        tried = length > LEAST_TORUS
        if not search.growing and (tried or not search.likely_torus):
            z, motion = search.watch(z, min(WATCHED, max_cycles - search.cycles))
            if motion is not None:
                return motion
        if search.likely_torus:
            length = max(length, LEAST_TORUS)
        if search.cycles < max_cycles:
            seen = search.observe(z, min(length, max_cycles - search.cycles))
            motion = search.judge(seen)
            last = seen.points
            if motion is None or motion.kind is not MotionClass.FAILED:
                z = search.end
                motion = search.confirm(motion, z, max_cycles)
            if motion is not None:
                return motion
        length *= 2
    return search.motion(MotionClass.UNDECIDED, last, growth=search.growth)


class _Search:
    """The means by which one motion is found out."""

    def __init__(self, solver, amplitude: float, settings, poll):
        self._solver, self._amplitude, self._poll = solver, amplitude, poll
        self._same = settings.period_tolerance
        self._units = solver.structure.state_units
        self._time = 2 * math.pi / solver.omega
        self._logarithms = np.empty(0)
        self.cycles = 0
        self.end = np.empty(0)  # of what was observed, where an orbit that repels is left
        self.growth = UNKNOWN
        self.growing = self.likely_torus = False

    def watch(self, z: np.ndarray, n_periods: int) -> tuple[np.ndarray, Motion | None]:
        """Integrate until the motion has reached an orbit or is proved to."""
        end = self._solver.settle(
            z, self._amplitude, n_periods, LONGEST, SETTLED, self._same, NEAR, self._poll
        )
        self.cycles += end.n_periods + end.n_newton
        if end.outcome is not Outcome.COMPLETE:
            return end.state, self.motion(MotionClass.FAILED, end.state[None], outcome=end.outcome)
        if not end.period:
            return end.state, None
        multiplier = None if math.isnan(end.multiplier) else end.multiplier
        return self._orbit(end.state, end.period, multiplier)

    def confirm(self, motion: Motion | None, z: np.ndarray, max_cycles: int) -> Motion | None:
        """Watch chaos for an orbit that ends it; give what it turns out to be."""
        if motion is None or motion.kind is not MotionClass.CHAOTIC:
            return motion
        _, ended = self.watch(z, min(CONFIRMED, max(max_cycles - self.cycles, 0)))
        return ended or replace(motion, cycles=self.cycles)

    def observe(self, z: np.ndarray, n_periods: int) -> Growth:
        """Integrate with a tangent vector."""
        seen = self._solver.grow(z, self._amplitude, n_periods, self._poll)
        self.cycles += len(seen.points)
        return seen

    def judge(self, seen: Observation | Growth) -> Motion | None:
        """Tell the motion from what was observed, if that is enough."""
        if seen.outcome is not Outcome.COMPLETE:
            return self.motion(MotionClass.FAILED, seen.points, outcome=seen.outcome)
        points, size = seen.points / self._units, len(seen.points)
        whole = seen if isinstance(seen, Observation) else None
        self.end = seen.points[-1]
        self._logarithms = np.concatenate((self._logarithms, aligned(seen.logarithms)))
        self.growth = growth = growth_interval(self._logarithms)
        self.growing = seen.growth > NEUTRAL_GROWTH
        # short orbits where the last points have closed, long ones where all have
        period = next(filter(None, (self._closed(points, p) for p in (LONGEST, size // 2))), 0)
        if period:
            self.end, motion = self._orbit(seen.points[-1], period, None)
            return motion
        grows = growth.low > 0 and seen.growth > CHAOS_GROWTH
        # beside an orbit that repels it is that orbit's growth
        if grows and not stays_near_orbit(points[: size // 3], LONGEST, NEAR):
            return self.motion(MotionClass.CHAOTIC, seen.points, growth=growth, seen=whole)
        period = approached_period(points, max(LONGEST, size // LONGER), NEAR)
        if period:
            motion = self._jump(seen.points[-1], period)
            if motion is not None:
                return motion
        neutral = abs(seen.growth) <= NEUTRAL_GROWTH
        digits = agreeing_digits(points) if neutral and size >= 4 else 0.0
        self.likely_torus = digits >= HINT_DIGITS
        most = NEUTRAL_GROWTH if size >= LONG_TORUS else TORUS_GROWTH
        still = abs(seen.growth) <= most and growth.high >= 0
        if size >= LEAST_TORUS and digits >= TORUS_DIGITS and still:
            period = returning_period(points, size // 2, NEAR)
            locked = self._jump(seen.points[-1], period) if period else None
            torus = self.motion(MotionClass.QUASI_PERIODIC, seen.points, growth=growth, seen=whole)
            return locked or torus
        return None

    def _closed(self, points: np.ndarray, max_period: int) -> int:
        return closed_period(points, max(max_period, 1), self._same)

    def _orbit(self, z, period: int, multiplier: float | None) -> tuple[np.ndarray, Motion | None]:
        """Make the motion of an orbit that was reached; where it repels, leave it.

        `multiplier` is None if the orbit was not proved by Newton's method.
        """
        start = z
        try:
            if multiplier is None:
                z, matrix, _ = self._newton(z, period)
                multiplier = float(abs(floquet_multipliers(matrix)[0]))
            points, outcome = self._solver.points(z, self._amplitude, period, self._poll)
            self.cycles += len(points)
            if outcome is not Outcome.COMPLETE:
                return z, self.motion(MotionClass.FAILED, points, outcome=outcome)
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            return z, None
        if multiplier > 1 + REPELS:
            if np.abs((start - z) / self._units).max() > PUSH:
                return start, None  # on its way already
            turns = np.cos(np.arange(z.size))  # into no direction that a structure prefers
            return z + PUSH * self._units * turns, None
        smallest = smallest_period(points / self._units, self._same)
        multiplier **= smallest / period
        exponent = exponent_of_multiplier(multiplier, smallest)
        return z, self.motion(
            MotionClass.PERIODIC,
            points[-smallest:],
            smallest,
            multiplier,
            Interval.exact(exponent),
        )

    def _jump(self, z: np.ndarray, period: int) -> Motion | None:
        """Solve for the orbit that is approached; give it if the motion is proved to go there.

        The proof is that of `solvers.flow.transient`: the orbit attracts, and from the motion's
        point to it the map is linear but for `LINEAR` of the distance that is left.
        """
        try:
            orbit, matrix, distance = self._newton(z, period)
            image, _ = self._solver.monodromy(z, self._amplitude, period)
            self.cycles += period
            multiplier = float(abs(floquet_multipliers(matrix)[0]))
        except (ArithmeticError, ValueError, np.linalg.LinAlgError):
            return None
        left = image - orbit
        bent = np.abs((left - matrix @ (z - orbit)) / self._units).max()
        if not distance <= 0.1 * self._same or not multiplier < 1.0:
            return None
        if not bent <= LINEAR * np.abs(left / self._units).max() + SETTLED:
            return None
        return self._orbit(orbit, period, multiplier)[1]

    def _newton(self, z: np.ndarray, period: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Take a point near an orbit onto it; give its matrix and its distance from it too.

        The distance is that of the next step: where a multiplier is near 1 a small residual is no
        small distance.
        """
        least, best, matrix = math.inf, z, np.eye(z.size)
        for _ in range(NEWTON_STEPS):
            image, tangent = self._solver.monodromy(z, self._amplitude, period)
            self.cycles += period
            step = np.linalg.solve(tangent - np.eye(z.size), image - z)
            distance = float(np.abs(step / self._units).max())
            if not distance < least:
                break
            least, best, matrix = distance, z, tangent
            z = z - step
        return best, matrix, least

    def motion(
        self,
        kind: MotionClass,
        points: np.ndarray,
        period: int = 0,
        multiplier: float = math.nan,
        growth: Interval = UNKNOWN,
        outcome: Outcome = Outcome.COMPLETE,
        seen: Observation | None = None,
    ) -> Motion:
        """Make the result; `growth` a forcing period."""
        interval = growth.times(1.0 / self._time)
        return Motion(kind, points, period, multiplier, *interval, self.cycles, outcome, seen)
