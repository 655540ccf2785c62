"""Arrive at the orbit that a motion goes to; leave one that repels.

An orbit is claimed only where Newton's method converges to rounding (`verification`): a motion that
closes without one is slow, and followed.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.shooting import Nearer, shoot
from hpcsweep.dynamics.verification import REACH, VerifiedOrbit, verify_orbit

NEAR = 1e-3
"""Distance between points a period apart below which a jump is tried."""
REPELS = 1e-5
"""Excess over 1 of the largest multiplier above which an orbit repels; it is exact to less."""
PUSH = 1e-8
"""In units of the state."""


class Arrival(NamedTuple):
    """Where a motion has come to.

    Attributes
    ----------
    state : ndarray, shape (2n,)
        From which it continues.
    orbit : VerifiedOrbit or None
        The orbit that it goes to, if that is known; its first point is near the state.
    cycles : int
        Forcing periods integrated.
    multiplier : float
        Modulus of the largest Floquet multiplier of the orbit.
    """

    state: np.ndarray
    orbit: VerifiedOrbit | None
    cycles: int
    multiplier: float = math.nan


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

    def jump(
        self, points: np.ndarray, period: int, limit: np.ndarray | None, tolerance: float
    ) -> Arrival:
        """Jump to the approached orbit, if the motion is verified to go there.

        Parameters
        ----------
        points : ndarray, shape (k, 2n)
            Of the motion, the last one that of the state.
        period : int
        limit : ndarray, shape (2n,), or None
            Of the points, in units of the state, by extrapolation, if it exists.
        tolerance : float
            Largest distance of the point that is found from the orbit.
        """
        z, nearer = points[-1], None
        if limit is not None:
            z, nearer = points[-1 - period], Nearer(points[-1], limit * self._units)
        shot = shoot(self._solver, z, self._amplitude, period, nearer)
        if not shot.attracts(tolerance):
            return Arrival(points[-1], None, shot.cycles)
        # the points that are at hand end where those of the orbit begin
        known = shot.point if shot.points is None else np.roll(shot.points, 1, axis=0)
        return self.at(known, period, points[-1], shot.cycles)

    def close(self, z: np.ndarray, period: int) -> Arrival:
        """Come to the orbit on which a motion has closed, if there is one."""
        return self.at(z, period, z, reach=NEAR)

    def at(
        self,
        point: np.ndarray,
        period: int,
        z: np.ndarray,
        cycles: int = 0,
        reach: float = REACH,
    ) -> Arrival:
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
            return Arrival(z, None, cycles)
        multiplier = orbit.multiplier
        if multiplier <= 1 + REPELS:
            return Arrival(z, orbit, cycles, multiplier)
        point = orbit.points[0]
        if np.abs((z - point) / self._units).max() <= PUSH:  # otherwise it is on its way already
            # in no direction that a structure prefers
            z = point + PUSH * self._units * np.cos(np.arange(z.size))
        return Arrival(z, None, cycles)
