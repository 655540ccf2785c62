"""Arrive at the orbit that a motion goes to; leave one that repels.

An orbit is claimed only where Newton's method converges to rounding (`verification`): a motion that
closes without one is slow, and followed. To an orbit that it approaches a motion jumps: the orbit
is sought from where the approach is extrapolated to. With F the map over p forcing periods, o the
orbit and M the tangent map there, the motion is verified to go to an attracting orbit if the map is
nearly linear over the last turn, from z: F(z) - o = M (z - o) up to `LINEAR_DEFECT` of F(z) - o.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.orbit import limit_of_approach
from hpcsweep.dynamics.verification import REACH, VerifiedOrbit, verify_orbit
from hpcsweep.solvers.skip_rule import LINEAR_DEFECT

ROUNDING = 1e-10
"""Further difference allowed to the map."""
NEAR = 1e-3
"""Distance between points a period apart below which a jump is tried."""
REPELS = 1e-5
"""Excess over 1 of the largest multiplier above which an orbit repels; it is exact to less."""
PUSH = 1e-8
"""In units of the state."""


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


def jump(
    solver,
    points: np.ndarray,
    amplitude: float,
    period: int,
    poll: Callable[[], None] | None = None,
) -> Destination:
    """Jump to the orbit that a motion approaches, if it is verified to go there.

    Parameters
    ----------
    solver : Solver
    points : ndarray, shape (k, 2n)
        Of the motion, k at least 3 `period`.
    amplitude : float
    period : int
    poll : callable, optional
        Called within long work; may raise to leave.
    """
    units, end = solver.structure.state_units, points[-1]
    limit = limit_of_approach(points / units, period)
    guess = end if limit is None else limit * units
    orbit, _, _, cycles = verify_orbit(solver, guess, amplitude, period, poll=poll)
    if orbit is not None:
        before, after = (points[[-1 - period, -1]] - orbit.points[0]) / units
        matrix = np.linalg.matrix_power(orbit.maps.product, period // orbit.period)
        bent = np.abs(after - matrix @ before).max()
        linear = bent <= LINEAR_DEFECT * np.abs(after).max() + ROUNDING
        orbit = orbit if linear and orbit.multiplier < 1.0 else None
    return Destination(end, orbit, cycles)


def arrive(
    solver,
    z: np.ndarray,
    amplitude: float,
    period: int,
    reach: float = REACH,
    poll: Callable[[], None] | None = None,
) -> Destination:
    """Come to the orbit on which a motion has closed, if there is one, or leave one that repels.

    Parameters
    ----------
    solver : Solver
    z : ndarray, shape (2n,)
        State of the motion.
    amplitude : float
    period : int
    reach : float
        Largest distance of the orbit from the state, in units of the state.
    poll : callable, optional
        As above.
    """
    orbit, _, _, cycles = verify_orbit(solver, z, amplitude, period, reach, poll)
    if orbit is not None and orbit.multiplier > 1 + REPELS:
        units, point, orbit = solver.structure.state_units, orbit.points[0], None
        if np.abs((z - point) / units).max() <= PUSH:  # otherwise it is on its way already
            # in no direction that a structure prefers
            z = point + PUSH * units * np.cos(np.arange(z.size))
    return Destination(z, orbit, cycles)
