"""Arrive at the orbit that a motion goes to; leave one that repels.

An orbit is claimed only where Newton's method converges to rounding (`verification`): a motion that
closes without one is slow, and followed.

To an orbit that a motion approaches it jumps by Newton's method on p forcing periods (`shoot`, or
single shooting). With F that map and M its tangent at z, a step solves (M - 1) d = z - F(z). Its
length is the distance from the orbit to first order; a residual is not: where a multiplier is near
1 a small one may be far away. After a step shorter than `SAME` M is kept, and F alone gives the
distance, with the points of the orbit. The motion of z is verified to go to an attracting orbit if
the map is nearly linear: F(z) - o = M (z - o) up to `LINEAR_DEFECT` of F(z) - o, o the orbit. Where
F(z) of the motion is known, Newton's method may start from a guess nearer to the orbit.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.orbit import limit_of_approach
from hpcsweep.dynamics.stability import floquet_multipliers
from hpcsweep.dynamics.verification import REACH, VerifiedOrbit, verify_orbit
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import LINEAR_DEFECT

STEPS = 8
REACHED = 1e-12
"""Distance below which another step gains nothing ..."""
ON_ORBIT = 1e-10
"""... and one that is enough where the points are at hand."""
SAME = 1e-10
"""Distance between points whose tangent maps are taken as equal; the multiplier is then accurate to
about that."""
ROUNDING = 1e-10
"""Further difference allowed to the map."""
NEAR = 1e-3
"""Distance between points a period apart below which a jump is tried."""
REPELS = 1e-5
"""Excess over 1 of the largest multiplier above which an orbit repels; it is exact to less."""
PUSH = 1e-8
"""In units of the state."""


class Shot(NamedTuple):
    """Result of Newton's method; distances are in units of the state."""

    point: np.ndarray
    """Of the orbit, shape (2n,)."""
    multiplier: float
    """Modulus of the largest Floquet multiplier over p periods; NaN if the solver has failed."""
    distance: float
    """Of the point from the orbit; inf if the solver has failed."""
    bent: float
    """Distance of F from its tangent at z."""
    left: float
    """Distance of F(z) from the orbit."""
    cycles: int
    """Forcing periods integrated."""
    points: np.ndarray | None = None
    """Of the orbit, shape (p, 2n), the last one as near to `point` as `distance`; if at hand."""

    def attracts(self, tolerance: float) -> bool:
        """Return whether the motion of z is verified to go to the orbit, found to `tolerance`."""
        linear = self.bent <= LINEAR_DEFECT * self.left + ROUNDING
        return self.distance <= tolerance and self.multiplier < 1.0 and linear


def shoot(
    solver,
    z: np.ndarray,
    amplitude: float,
    period: int,
    nearer: tuple[np.ndarray, np.ndarray] | None = None,
) -> Shot:
    """Solve for the orbit of `period` forcing periods near a point.

    Parameters
    ----------
    solver : Solver
    z : ndarray, shape (2n,)
    amplitude : float
    period : int
    nearer : (ndarray, ndarray), optional
        F(z), and a point nearer to the orbit than z.
    """
    units = solver.structure.state_units
    start, best, matrix, taken = z, z, np.eye(z.size), np.eye(z.size)
    first, least, cycles, seen = None, math.inf, 0, None
    if nearer is not None:
        first, z = nearer
    try:
        for _ in range(STEPS):
            points, follows = None, least <= SAME
            if follows:
                points, outcome = solver.points(z, amplitude, period)
                if outcome is not Outcome.COMPLETE:
                    raise ArithmeticError(f"{outcome.name} on the way round an orbit")
                image = points[-1]
            else:
                image, taken = solver.monodromy(z, amplitude, period)
            cycles += period
            first = image if first is None else first
            move = np.linalg.solve(taken - np.eye(z.size), image - z)
            distance = float(np.abs(move / units).max())
            if not distance < least:
                break
            least, best, matrix, seen = distance, z, taken, points
            if distance <= (ON_ORBIT if follows else REACHED):
                break
            z = z - move
        multiplier = float(abs(floquet_multipliers(matrix)[0]))
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return Shot(start, math.nan, math.inf, math.inf, 0.0, cycles)
    left = (first - best) / units
    bent = np.abs(left - (matrix @ (start - best)) / units).max()
    largest = float(np.abs(left).max())
    return Shot(best, multiplier, least, float(bent), largest, cycles, seen)


class Destination(NamedTuple):
    """Where a motion has come to.

    Attributes
    ----------
    state : ndarray, shape (2n,)
        From which it continues.
    orbit : VerifiedOrbit or None
        The orbit that it goes to, if that is known; its first point is near the state.
    cycles : int
        Forcing periods integrated.
    """

    state: np.ndarray
    orbit: VerifiedOrbit | None
    cycles: int


class Arriving:
    """Arrivals of the motions at one amplitude.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    poll : callable, optional
        Called within long work; may raise to leave.
    """

    def __init__(self, solver, amplitude: float, poll: Callable[[], None] | None = None):
        self._solver, self._amplitude, self._poll = solver, amplitude, poll
        self._units = solver.structure.state_units

    def jump(self, points: np.ndarray, period: int, tolerance: float) -> Destination:
        """Jump to the approached orbit, if the motion is verified to go there.

        Parameters
        ----------
        points : ndarray, shape (k, 2n)
            Of the motion, the last one that of the state.
        period : int
        tolerance : float
            Largest distance of the point that is found from the orbit.
        """
        z, nearer = points[-1], None
        limit = limit_of_approach(points / self._units, period)
        if limit is not None:
            z, nearer = points[-1 - period], (points[-1], limit * self._units)
        shot = shoot(self._solver, z, self._amplitude, period, nearer)
        if not shot.attracts(tolerance):
            return Destination(points[-1], None, shot.cycles)
        # the points that are at hand end where those of the orbit begin
        known = shot.point if shot.points is None else np.roll(shot.points, 1, axis=0)
        return self.at(known, period, points[-1], shot.cycles)

    def close(self, z: np.ndarray, period: int) -> Destination:
        """Come to the orbit on which a motion has closed, if there is one."""
        return self.at(z, period, z, reach=NEAR)

    def at(
        self, point: np.ndarray, period: int, z: np.ndarray, cycles: int = 0, reach: float = REACH
    ) -> Destination:
        """Come to an orbit, or leave one that repels.

        Parameters
        ----------
        point : ndarray, shape (2n,) or (k, 2n)
            Of the orbit, as far as it is known, or its first k points.
        period : int
        z : ndarray, shape (2n,)
            State of the motion, at the same phase.
        cycles : int
            Forcing periods integrated so far.
        reach : float
            Largest distance of the orbit from the point, in units of the state.
        """
        verdict = verify_orbit(self._solver, point, self._amplitude, period, reach, self._poll)
        orbit, cycles = verdict.orbit, cycles + verdict.cycles
        if orbit is None:
            return Destination(z, None, cycles)
        if orbit.multiplier <= 1 + REPELS:
            return Destination(z, orbit, cycles)
        point = orbit.points[0]
        if np.abs((z - point) / self._units).max() <= PUSH:  # otherwise it is on its way already
            # in no direction that a structure prefers
            z = point + PUSH * self._units * np.cos(np.arange(z.size))
        return Destination(z, None, cycles)
