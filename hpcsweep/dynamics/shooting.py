"""Solve for an orbit near a point by Newton's method on p forcing periods (single shooting).

With F that map and M its tangent at z, a step solves (M - 1) d = z - F(z). Its length is the
distance from the orbit to first order; a residual is not: where a multiplier is near 1 a small one
may be far away. After a step shorter than `SAME` M is kept, and F alone gives the distance, with
the points of the orbit. The motion of z is verified to go to an attracting orbit if the map is
nearly linear: F(z) - o = M (z - o) up to `LINEAR_DEFECT` of F(z) - o, o the orbit. Where F(z) of
the motion is known, Newton's method may start from a guess nearer to the orbit.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.stability import floquet_multipliers
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


class Nearer(NamedTuple):
    """Further knowledge of the motion of a point z."""

    image: np.ndarray
    """F(z)"""
    guess: np.ndarray
    """A point nearer to the orbit."""


def shoot(
    solver, z: np.ndarray, amplitude: float, period: int, nearer: Nearer | None = None
) -> Shot:
    """Solve for the orbit of `period` forcing periods near a point.

    Parameters
    ----------
    solver : Solver
    z : ndarray, shape (2n,)
    amplitude : float
    period : int
    nearer : Nearer, optional
        Further knowledge of the motion of z.
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
