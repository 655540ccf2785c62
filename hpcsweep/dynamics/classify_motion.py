"""Classify the motion that a state goes to: integrate until it is known, or a limit is reached.

The motion is first watched for an orbit nearby, and then observed with a tangent vector; where
small differences grow, or a torus is likely, from the beginning of the window on. This stretch is
extended, to twice its length up to `MIN_TORUS` periods and by a part of it from then on, and
classified each time by its later part. A motion is

- periodic if it has closed on or is verified to go to an orbit that does not repel;
- chaotic if the largest Lyapunov exponent over all that was observed is above 0 with confidence
(`stability.growth_interval`), a small difference has grown by `CHAOS_GROWTH` in the logarithm
  over what is judged, and no orbit has ended it within the periods that it is asked to outlive;
- quasi-periodic if weighted means over both halves agree, to `TORUS_DIGITS` over `MIN_TORUS`
  periods or more, or where it is `CALM` to `CALM_DIGITS`, so weighted there is no growth
  (`birkhoff`), the exponent is not below 0 with confidence, and no orbit is verified that the torus
  is locked to.

An orbit is claimed only where Newton's method converges to rounding (`verification`): a motion that
closes without one is slow, and followed. To an orbit that it approaches a motion jumps: the orbit
is sought from where the approach is extrapolated to. With F the map over p forcing periods, o the
orbit and M the tangent map there, the motion is verified to go to an attracting orbit if the map is
nearly linear over the last turn, from z: F(z) - o = M (z - o) up to `LINEAR_DEFECT` of F(z) - o. A
motion that repeats although it repels stays there until rounding drives it away; it is driven by
`PUSH` at once. Chaos may be a transient that would end later.

At the border of its family (`families`) an orbit of sliders is replaced by one within; growth is
that across families.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hpcsweep.dynamics import orbit, stability
from hpcsweep.dynamics.attractor import Motion
from hpcsweep.dynamics.birkhoff import agreeing_digits, growth_vanishes, weighted_growth
from hpcsweep.dynamics.classify import CHAOS_GROWTH, NEUTRAL_GROWTH, MotionClass
from hpcsweep.dynamics.families import moved_inward
from hpcsweep.dynamics.lifetime import outlive
from hpcsweep.dynamics.verification import REACH, VerifiedOrbit, verify_orbit
from hpcsweep.model.arguments import count
from hpcsweep.solvers.offers import TANGENTS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.records import Growth, Observation
from hpcsweep.solvers.skip_rule import LINEAR_DEFECT

SETTLED = 1e-10
"""Largest estimated distance (gaps, gaps omega_0) from the orbit at which a motion is on it."""
NEAR = 1e-3
"""Distance between points a period apart below which a jump is tried."""
ROUNDING = 1e-10
"""Difference allowed to the map of a last turn besides `LINEAR_DEFECT`."""
REPELS = 1e-5
"""Excess over 1 of the largest multiplier above which an orbit repels; it is exact to less."""
PUSH = 1e-8
"""In units of the state."""
LONGEST = 64
"""Longest orbit period to which Newton's method jumps at sight, in forcing periods. Longer ones, up
to a third of what is observed, are recognised when they close; see `TURNS`."""
WATCHED = 4 * LONGEST
"""Forcing periods that are watched before a stretch is observed."""
FIRST_STRETCH = 200
"""Forcing periods that are observed at first."""
CONFIRMED = 100
"""Forcing periods for which chaos is watched for an orbit that ends it. Of 163 windows of 100
periods with a growth of chaos, drawn from the map of Figure 6 as described, 10 ended in an orbit
within 3,000 more: 4 within 100, 8 within 300."""
MIN_TORUS = 800
"""Fewest points that distinguish a torus from a near one."""
CARRIED = 4
"""A stretch is extended by 1/4 before it is classified again, a short one by itself."""
JUDGED = 3 / 4
"""Final fraction of a stretch by which it is classified; the rest may be a transient."""
DRIVEN_AWAY = 36.0
"""Growth by which a rounding error becomes as large as the motion: -ln 2^-52."""
TURNS = 6
"""An orbit of long period is jumped to if its approach is geometric (`orbit.limit_of_approach`), or
after this many turns."""
TORUS_DIGITS, LATER_DIGITS = 5.0, 4.5
"""The latter from twice `MIN_TORUS` periods on. Of tori drawn from the map of Figure 6 as described
weighted means agree to 4.7 to 11.2 digits after 800 periods and to more after more; those of chaos
beside a torus (Figure 3 as described, A = 0.1025 down, exponent 0.0035 / T) to 2.6 to 4.7 after 400
to 3,200, and grow. Of 2,374 chaotic motions one more passed with 4.5 from 800 periods on, none from
1,500."""
RETURNS = 8
"""Part of what is judged that an orbit may be long to which a torus is tried to be locked: with
half in place of an eighth the tori of three frames (Omega = 0.425, 0.5, 0.716) took 1.7 times as
long, and four of 90 were orbits of more than 1,000 periods."""
HINT_DIGITS = 2.0
"""The same for a shorter stretch, after which as many periods are observed as a torus needs."""
CALM_DIGITS, CALM = 3.5, 0.1
"""Digits that suffice where the weighted growth of both halves of a stretch is within so much over
`MIN_TORUS` periods, and in proportion over fewer, from `FIRST_STRETCH` on: of 2,374 chaotic motions
and 828 orbits of 80 frames, judged over 200, 400 and 800 periods and each time after that, none
came to both; of 2,372 tori three quarters did over 400. A torus whose whole growth is within it is
tried to be locked to orbits of up to `MIN_TORUS` / `RETURNS` periods only: locked, it is the
stretch times the orbit's exponent, once the motion has come there."""
SEARCHED, SEARCHED_FREELY = 4, 1000
"""Newton's method takes no more than 1/4 of all periods, beyond the first 1,000: beside the ghost
of a long orbit each search is as long as all that was observed."""

Step = tuple[np.ndarray, Motion | None]
"""The state from which to continue, and the motion if it is classified."""


def classify_motion(
    solver,
    state: np.ndarray,
    amplitude: float,
    settings,
    max_cycles: int,
    poll: Poll = None,
    window: Observation | None = None,
    outlived: int = CONFIRMED,
) -> Motion:
    """Classify the motion that a state goes to.

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
        At tau = 0.
    amplitude : float
    settings : SweepSettings
        Settings of the runs: ``max_orbit_period`` and ``period_tolerance`` are used.
    max_cycles : int
        Forcing periods after which the motion is undecided; the last part may be cut short.
    poll : callable, optional
        Called within long work; may raise to leave.
    window : Observation, optional
        A window that ended in `state`, with the growth of a tangent vector: tried first.
    outlived : int
        Forcing periods, within `max_cycles`, for which chaos is watched for an orbit that ends it.
    """
    search = _Classifier(
        solver, amplitude, settings, poll, count("max_cycles", max_cycles), outlived
    )
    z, motion = np.array(state, dtype=float), None
    if window is not None:
        z, motion = search.judge_window(z, window)
    while motion is None and search.left:
        if search.stretch is None and not (search.growing or search.likely_torus):
            z, motion = search.watch(z, WATCHED)
        if motion is None and search.left:
            z, motion = search.carry_on(z)
    if motion is None:
        last = search.last if len(search.last) else z[None]
        motion = search.motion(MotionClass.UNDECIDED, last, growth=search.growth)
    return motion


class _Classifier:
    """Classifier of one motion."""

    def __init__(self, solver, amplitude: float, settings, poll, max_cycles: int, outlived: int):
        self._outlived = outlived
        self._solver, self._amplitude, self._poll = solver, amplitude, poll
        self._same = settings.period_tolerance
        self._units = solver.structure.state_units
        self._time = solver.structure.forcing.period(solver.omega)
        self._max_cycles = max_cycles
        self.last = np.empty((0, self._units.size))  # points of what was judged last
        self._logarithms = np.empty(0)  # of all that was observed
        self.stretch: Growth | None = None  # the stretch that is extended
        self._window: Observation | None = None  # with which it begins
        self._tried: dict[int, int] = {}  # its length when it was tried to jump, by period
        self.growing = self.likely_torus = False
        self.cycles = self._searched = 0

    @property
    def left(self) -> int:
        """Forcing periods still allowed."""
        return max(self._max_cycles - self.cycles, 0)

    @property
    def growth(self) -> stability.MeanInterval:
        """Growth a period over everything observed."""
        return stability.growth_interval(self._logarithms)

    def watch(self, z: np.ndarray, n_periods: int) -> Step:
        """Integrate until the motion has reached an orbit, or is verified to go to one."""
        rules = min(n_periods, self.left), LONGEST, SETTLED, self._same, NEAR
        end = self._solver.settle(z, self._amplitude, *rules, self._poll)
        self.cycles += end.n_periods + end.n_newton
        if end.outcome is not Outcome.COMPLETE:
            return end.state, self.motion(MotionClass.FAILED, end.state[None], outcome=end.outcome)
        if not end.period:
            return end.state, None
        return self._arrive(end.state, end.period, REACH)

    def judge_window(self, z: np.ndarray, seen: Observation) -> Step:
        """Classify a motion by a window; return the state from which to continue."""
        if seen.outcome is not Outcome.COMPLETE:
            return z, self.motion(MotionClass.FAILED, seen.points, outcome=seen.outcome)
        self._logarithms = stability.aligned(seen.logarithms)
        end, motion = self._judge(seen, len(seen.points) // 2)
        if seen.direction is not None and (self.growing or self.likely_torus):
            facts = seen.points, seen.outcome, seen.logarithms, seen.direction
            self.stretch, self._window = Growth(*facts), seen
        return end, self._confirmed(motion, end)

    def carry_on(self, z: np.ndarray) -> Step:
        """Observe the motion for longer, and classify it by the end of the continuous stretch."""
        before = self.stretch
        direction = None if before is None else before.direction
        most = min(self._more(), self.left)
        seen = self._solver.grow(z, self._amplitude, most, self._poll, direction)
        self.cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return z, self.motion(MotionClass.FAILED, seen.points, outcome=seen.outcome)
        added = stability.aligned(seen.logarithms) if before is None else seen.logarithms
        self._logarithms = np.concatenate((self._logarithms, added))
        self.stretch = stretch = seen if before is None else before.followed_by(seen)
        start = stretch.points[-1]
        end, motion = self._closing(stretch)
        if motion is None and np.array_equal(end, start):
            judged = max(MIN_TORUS, int(JUDGED * len(stretch.points)))
            end, motion = self._judge(stretch.last(judged))
        if not np.array_equal(end, start):  # a repelling orbit was left
            self.stretch = self._window = None
            self._tried.clear()
        return end, self._confirmed(motion, end)

    def _more(self) -> int:
        """Return the number of periods by which to extend the stretch."""
        size = 0 if self.stretch is None else len(self.stretch.points)
        if size >= MIN_TORUS:
            return size // CARRIED
        more = max(size, FIRST_STRETCH)
        return min(more, MIN_TORUS - size) if self.likely_torus else more

    def _confirmed(self, motion: Motion | None, z: np.ndarray) -> Motion | None:
        """Watch chaos for an orbit that ends it; return the resulting motion."""
        if motion is None or motion.kind is not MotionClass.CHAOTIC:
            return motion
        z, _, ended = outlive(self._march, z, min(self._outlived, self.left))
        if ended is None and self.growth.mean == -math.inf:
            return None  # all that is near merges on a rigid stop: an orbit, however long
        return ended or replace(motion, cycles=self.cycles)

    def _march(self, z: np.ndarray, n_periods: int) -> tuple[np.ndarray, int, Motion | None]:
        """Integrate, and watch for an orbit if the motion returns to its end: to one it has ended.

        Marching takes two thirds to four fifths of the time of watching.
        """
        before, ended = self.cycles, None
        if self._solver.structure.is_rigid.any():
            seen = self._solver.grow(z, self._amplitude, n_periods, self._poll)
            points, outcome = seen.points, seen.outcome
            self._logarithms = np.concatenate((self._logarithms, seen.logarithms))
        else:
            points, outcome = self._solver.points(z, self._amplitude, n_periods, self._poll)
        self.cycles += len(points)
        z = points[-1] if len(points) else z
        if outcome is not Outcome.COMPLETE:
            ended = self.motion(MotionClass.FAILED, z[None], outcome=outcome)
        elif self.left and orbit.returns_near(points[-1 - LONGEST :] / self._units, NEAR):
            z, ended = self.watch(z, WATCHED)
        return z, self.cycles - before, ended

    def _closing(self, stretch: Growth) -> Step:
        """Look for an orbit of long period on which a stretch closes, and jump to it.

        It is also claimed where each of the last two turns has closed on the previous one.
        """
        points, size, end = stretch.points / self._units, len(stretch.points), stretch.points[-1]
        period, distance = orbit.closing_period(points, LONGEST + 1, size // 3, NEAR, self._same)
        if not period:
            return end, None
        last = points[-3 * period :]
        if distance <= self._same and self._closed(last, 3 * period // 2):
            return self._arrive(end, period)
        soon = orbit.limit_of_approach(last, period) is not None or TURNS * period <= size
        soon = soon and stretch.logarithms[-3 * period :].sum() < 0
        if soon and size >= 2 * self._tried.get(period, 0):
            self._tried[period] = size
            return self._jump(stretch.points, period)
        return end, None

    def _judge(self, seen: Observation | Growth, longest: int = 0) -> Step:
        """Classify a motion by its observation, if that suffices; return where to continue.

        `longest` is the longest period on which all of it may have closed.
        """
        points, size, end = seen.points / self._units, len(seen.points), seen.points[-1]
        # of a stretch that is judged as a whole the window with which it began
        begun = self.stretch is not None and size == len(self.stretch.points)
        whole = seen if isinstance(seen, Observation) else self._window if begun else None
        growth, self.last = self.growth, seen.points
        self.growing = seen.growth > NEUTRAL_GROWTH
        # short orbits where the last points have closed, long ones where all have
        period = self._closed(points, LONGEST) or (longest and self._closed(points, longest))
        if period:
            return self._arrive(end, period)
        if growth.low > 0 and seen.growth > CHAOS_GROWTH:
            # near a repelling orbit it is that orbit's growth
            third = size // 3
            beside = orbit.stays_near_orbit(points[:third], LONGEST, NEAR)
            if not beside or seen.logarithms[:third].sum() > DRIVEN_AWAY:
                return end, self.motion(MotionClass.CHAOTIC, seen.points, growth=growth, seen=whole)
        period = orbit.approached_period(points, LONGEST, NEAR)
        there = self._jump(seen.points, period)[1] if period else None
        return end, there or self._torus(points, seen, whole)

    def _torus(self, points, seen: Observation | Growth, whole) -> Motion | None:
        """Recognise a torus, or the orbit that it is locked to, by points in state units."""
        size = len(points)
        vanishes = size >= 4 and abs(seen.growth) < math.inf and growth_vanishes(seen.logarithms)
        neutral = vanishes if size >= MIN_TORUS else abs(seen.growth) <= NEUTRAL_GROWTH
        digits = agreeing_digits(points) if neutral and size >= 4 else 0.0
        self.likely_torus = neutral and digits >= HINT_DIGITS
        if size < FIRST_STRETCH or digits < CALM_DIGITS or not vanishes:
            return None
        *halves, grown = np.abs(weighted_growth(seen.logarithms)).tolist()
        calm = max(halves) <= CALM * min(size / MIN_TORUS, 1.0)
        needed = TORUS_DIGITS if size < 2 * MIN_TORUS else LATER_DIGITS
        if not calm and (digits < needed or size < MIN_TORUS):
            return None
        growth = stability.growth_interval(seen.logarithms)
        longest = min((size if grown > CALM else MIN_TORUS) // RETURNS, size // 3)
        period = orbit.returning_period(points, longest, NEAR)
        locked = self._jump(seen.points, period, period <= LONGEST)[1] if period else None
        if locked or growth.high < 0:
            return locked
        return self.motion(MotionClass.QUASI_PERIODIC, seen.points, growth=growth, seen=whole)

    def _closed(self, points: np.ndarray, max_period: int) -> int:
        return orbit.closed_period(points, max_period, self._same)

    def _jump(self, points: np.ndarray, period: int, hasty: bool = True) -> Step:
        """Jump to the orbit that the motion approaches, if it is verified to go there.

        At least 3 `period` of its points are needed.
        """
        end, limit = points[-1], orbit.limit_of_approach(points / self._units, period)
        turn = points[-period:] if limit is None else limit * self._units
        there = self._verified(np.roll(turn, 1, axis=0), period, hasty=hasty)
        if there is None or there.multiplier >= 1.0:
            return end, None
        before, after = (points[[-1 - period, -1]] - there.points[0]) / self._units
        matrix = np.linalg.matrix_power(there.maps.product, period // there.period)
        bent = np.abs(after - matrix @ before).max()
        linear = bent <= LINEAR_DEFECT * np.abs(after).max() + ROUNDING
        return end, self._periodic(there) if linear else None

    def _arrive(self, z: np.ndarray, period: int, reach: float = NEAR) -> Step:
        """Come to the orbit on which the motion has closed, if there is one."""
        there = self._verified(z, period, reach)
        if there is None or there.multiplier <= 1 + REPELS:
            return z, self._periodic(there) if there else None
        point = there.points[0]
        if np.abs((z - point) / self._units).max() <= PUSH:  # otherwise it is on its way already
            # in no direction that a structure prefers
            z = point + PUSH * self._units * np.cos(np.arange(z.size))
        return z, None

    def _verified(
        self, z: np.ndarray, period: int, reach: float = REACH, hasty: bool = False
    ) -> VerifiedOrbit | None:
        """Return the orbit near a state, if there is one, and if it may be searched for."""
        if self._searched > max(self.cycles // SEARCHED, SEARCHED_FREELY):
            return None
        found = self._search(z, period, reach, hasty)
        if found is None and not TANGENTS.of(self._solver.structure):
            inner = moved_inward(self._solver, np.atleast_2d(z)[0], self._amplitude, period)
            found = self._search(inner, period, reach, hasty)
        return found

    def _search(self, z, period: int, reach: float, hasty: bool) -> VerifiedOrbit | None:
        verdict = verify_orbit(self._solver, z, self._amplitude, period, reach, self._poll, hasty)
        self.cycles += verdict.cycles
        self._searched += verdict.cycles
        return verdict.orbit

    def _periodic(self, there: VerifiedOrbit) -> Motion:
        """Return the motion that has come to an orbit, whose first point is near its state."""
        points = np.roll(there.points, -1, axis=0)
        period, multiplier = there.period, there.multiplier
        exact = stability.exponent_of_multiplier(multiplier, period)
        exponent = stability.MeanInterval.exact(exact)
        facts = {"period": period, "multiplier": multiplier, "families": there.families}
        return self.motion(MotionClass.PERIODIC, points, exponent, **facts)

    def motion(
        self,
        kind: MotionClass,
        points: np.ndarray,
        growth: stability.MeanInterval = stability.UNKNOWN,
        **facts: Any,
    ) -> Motion:
        """Return the result, with more facts of it; `growth` is a forcing period's."""
        interval = growth.times(1.0 / self._time)
        return Motion(kind, points, interval=interval, cycles=self.cycles, **facts)
