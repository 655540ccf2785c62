"""One periodic orbit of a structure: points, multipliers, contacts, verified."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.cycle import (
    Curve,
    NotConvergedError,
    Solution,
    continued,
    solve_at,
)
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.model.arguments import count, finite, finite_vector, instance, positive
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import MAX_PERIOD
from hpcsweep.solvers.trajectory import Crossing, crossings

REACH = 0.1
"""Largest distance of an orbit from where it is sought, in units of the state."""
CLOSES = 1e-9
"""Residual of an orbit that is verified, in units of the state."""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit.

    Attributes
    ----------
    points : ndarray, shape (p, 2n)
        z(0), z(T), ..., z((p - 1) T).
    multipliers : ndarray of complex, shape (2n,)
        Floquet multipliers over p forcing periods, largest modulus first.
    residual : float
        Largest difference between z(jT) integrated and the next point, in units of the state.
    signature : tuple of Crossing
        The contacts that close and open, in order of time: ``contact`` (its number), ``closes``,
        and ``phase`` in forcing periods, from 0 to p.
    """

    points: np.ndarray
    multipliers: np.ndarray
    residual: float
    signature: tuple[Crossing, ...]

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside the unit circle."""
        return bool(abs(self.multipliers[0]) < 1.0)


def orbit(structure: Structure, amplitude: float, omega: float, state: Any, period: int) -> Orbit:
    """Find the periodic orbit near a state, stable or not.

    By Newton's method on all p points at once (`hpcsweep.dynamics.continuation.cycle`), verified by
    integrating each point once more. The contacts are from an integration of each forcing period by
    scipy's DOP853.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the forcing.
    state : array_like, shape (2n,)
        (u, v) at phase 0, near a point of the orbit.
    period : int
        p, in forcing periods.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If there is no orbit of that period near, or a solver fails.
    """
    forced, found = find(structure, amplitude, omega, state, period)
    there = Curve(forced, period, 1.0).split(found.y)[0]
    images = forced.images(there, forced.value)
    residual = float(np.abs(images - np.roll(there, -1, axis=0)).max())
    points = there * forced.units
    signature = [
        one._replace(phase=one.phase + turn)
        for turn, z in enumerate(points)
        for one in crossings(structure, amplitude, omega, z)
    ]
    return Orbit(points, found.multipliers, residual, tuple(signature))


def find(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    period: int,
    parameter: str = "amplitude",
) -> tuple[ForcedMap, Solution]:
    """Find the orbit near a state as a point of the curve of an unscaled parameter."""
    instance("structure", structure, Structure)
    amplitude, omega = finite("amplitude", amplitude), positive("omega", omega)
    z = finite_vector("state", state, 2 * structure.n_floors)
    period = count("period", period, 1, MAX_PERIOD)
    forced = ForcedMap(structure, amplitude, omega, parameter)
    curve = Curve(forced, period, 1.0)
    start = z / forced.units
    try:
        points = continued(forced, start[None], forced.value, period)
        found = solve_at(curve, points, forced.value)
    except (NotConvergedError, ArithmeticError) as error:
        raise ArithmeticError(f"no orbit of period {period} near the state: {error}") from None
    there = curve.split(found.y)[0]
    away = float(np.abs(there[0] - start).max())
    if away > REACH:
        raise ArithmeticError(
            f"no orbit of period {period} within {REACH} of the state: the one found is {away:.3g} "
            "away"
        )
    if found.residual > CLOSES:
        raise ArithmeticError(f"no orbit of period {period}: it closes to {found.residual:.3g}")
    return forced, found
