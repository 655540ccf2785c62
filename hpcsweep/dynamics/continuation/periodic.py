"""One periodic orbit of a structure: points, multipliers, contacts, verified."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.dynamics.continuation.forced import NO_TIES, ForcedMap, Ties
from hpcsweep.dynamics.stability import floquet_multipliers
from hpcsweep.dynamics.verification import REACH, VerifiedOrbit, verify_orbit
from hpcsweep.model.arguments import count, finite, finite_vector, forcing_frequency, instance
from hpcsweep.model.confinement import demand_confined
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import MAX_PERIOD
from hpcsweep.solvers.offers import BATCHES
from hpcsweep.solvers.solver import loaded
from hpcsweep.solvers.trajectory import Crossing, crossings

SHOWN = 6
"""Events of a signature that are printed."""


@dataclass(frozen=True, repr=False)
class Orbit:
    """A periodic orbit.

    Attributes
    ----------
    points : ndarray, shape (p, 2n)
        z(0), z(T), ..., z((p - 1) T), p the minimal period; of L sliders (p, 2n + L), (u, u', p).
        A motion that ratchets closes relative to what it gains along `Structure.free_drifts`.
    multipliers : ndarray of complex, shape (2n,)
        Floquet multipliers over p forcing periods, largest modulus first; of sliders transverse to
        the family of the orbit, (2n + L - families,).
    residual : float
        Largest difference between z(jT) integrated and the next point, in units of the state.
    signature : tuple of Crossing
        The contacts that close and open, in order of time: ``contact`` (its number), ``closes``,
        and ``phase`` in forcing periods, from 0 to p. It is not told of structures with sliders.
        A rigid contact closes at each impact, and opens where it rests no more.
    families : int
        Number of multipliers of 1 that are left out: sliders that stick, whose p may be another,
        and directions in which no spring keeps a place (`stability.without_families`).
    """

    points: np.ndarray
    multipliers: np.ndarray
    residual: float
    signature: tuple[Crossing, ...]
    families: int = 0

    @property
    def period(self) -> int:
        """Minimal period p in forcing periods."""
        return len(self.points)

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside the unit circle."""
        return bool(abs(self.multipliers[0]) < 1.0)

    def __repr__(self) -> str:
        events = [
            f"{'+' if crossing.closes else '-'}{crossing.contact}@{crossing.phase:.4g}"
            for crossing in self.signature[:SHOWN]
        ]
        if len(self.signature) > SHOWN:
            events.append(f"... {len(self.signature)} in all")
        return (
            f"Orbit(P{self.period}, {'stable' if self.stable else 'unstable'}, largest multiplier "
            f"{self.multipliers[0]:.6g}, residual {self.residual:.1e}, "
            f"contacts [{', '.join(events)}])"
        )


def orbit(structure: Structure, amplitude: float, omega: float, state: Any, period: int) -> Orbit:
    """Find the periodic orbit near a state, stable or not.

    By Newton's method, to rounding (`hpcsweep.dynamics.verification`): past a fold, where a motion
    nearly closes, there is none. Orbits of sliders come in families: it is the nearest one. The
    contacts are from the exact flow of each forcing period, to 1e-14 of it.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the forcing.
    state : array_like, shape (2n,)
        (u, v) at phase 0, near a point of the orbit; of L sliders (2n + L,), (u, v, p).
    period : int
        Forcing periods after which the orbit closes; its minimal period is a divisor of it.

    Returns
    -------
    Orbit
        Its points, shape (p, 2n), in the units of the structure; multipliers, residual, signature.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If there is no orbit of that period near, or a solver fails.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory*, 10.1.

    Examples
    --------
    At resonance the displacement without contact is A / (2 zeta) cos(tau):

    >>> stop = hpcsweep.Structure(n_floors=1, sharpness=math.inf, damping_ratio=0.05)
    >>> orbit = hpcsweep.orbit(stop, amplitude=0.05, omega=1.0, state=[0.45, 0.0], period=1)
    >>> orbit.points.round(12) + 0.0
    array([[0.5, 0. ]])
    >>> bool(np.isclose(abs(orbit.multipliers[0]), math.exp(-2.0 * math.pi * 0.05), rtol=1e-12))
    True
    """
    _, verified = find(structure, amplitude, omega, state, period)
    if verified.transverse is not None:
        transverse = floquet_multipliers(verified.transverse)
        return Orbit(verified.points, transverse, verified.residual, (), verified.families)
    signature = [
        crossing._replace(phase=crossing.phase + turn)
        for turn, z in enumerate(verified.points)
        for crossing in crossings(structure, amplitude, omega, z)
    ]
    return Orbit(verified.points, verified.maps.multipliers, verified.residual, tuple(signature))


def find(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: Any,
    period: int,
    parameter: str = "amplitude",
    ties: Ties = NO_TIES,
) -> tuple[ForcedMap, VerifiedOrbit]:
    """Find the orbit near a state, on the map of a parameter and what it gives."""
    instance("structure", structure, Structure)
    amplitude, omega = finite("amplitude", amplitude), forcing_frequency("omega", omega)
    demand_confined(structure, amplitude)
    z = finite_vector("state", state, structure.state_units.size)
    period = count("period", period, 1, MAX_PERIOD)
    forced = ForcedMap(structure, amplitude, omega, parameter, ties=ties)
    solver, amplitude = forced.solver(forced.value)
    if BATCHES.of(structure):
        loaded(structure, branches=True)
    verdict = verify_orbit(solver, z, amplitude, period)
    if verdict.orbit is None:
        why = f"the residual of Newton's method falls to {verdict.residual:.3g} and no further"
        if verdict.away < math.inf:
            why = f"the one found is {verdict.away:.3g} away"
        raise ArithmeticError(f"no orbit of period {period} within {REACH} of the state: {why}")
    return forced, verdict.orbit
