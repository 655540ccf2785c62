"""The two solvers behind one interface, and the function that gives stroboscopic points.

A solver belongs to one structure and one frequency and has the methods of `Solver`. All of them
start at phase tau = 0 of the forcing and advance whole forcing periods T = 2 pi / Omega.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.bdf import BdfMap
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Advance, Approach, Observation

SOLVERS = {"flow": FlowMap, "bdf": BdfMap}


class Solver(Protocol):
    """What `sweep` asks of a solver; shapes and units in `hpcsweep.solvers.records`."""

    structure: Structure
    omega: float

    def advance(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> Advance:
        """Integrate, keeping only the last state; see `FlowMap.advance`."""
        ...

    def settle(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        max_period: int,
        settled: float,
        same: float,
        near: float = 0.0,
        poll: Callable[[], None] | None = None,
    ) -> Approach:
        """Integrate until the orbit is known, for at most `n_periods`; see `FlowMap.settle`.

        A solver that cannot tell integrates all of them and returns period 0.
        """
        ...

    def points(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> tuple[np.ndarray, Outcome]:
        """Integrate, keeping every stroboscopic point."""
        ...

    def observe(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        modal_norm: bool = False,
        growth: bool = False,
        poll: Callable[[], None] | None = None,
    ) -> Observation:
        """Integrate, keeping points, contact set, drift, modal norms and growth of a tangent."""
        ...

    def monodromy(
        self, state: np.ndarray, amplitude: float, n_periods: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate with the tangent map: final state and d z(n T) / d z(0), shape (2n, 2n)."""
        ...


def make_solver(name: str, structure: Structure, omega: float, rtol: float) -> Solver:
    """Make the solver `name` for one structure and frequency.

    Raises
    ------
    ValueError
        If there is no solver of that name.
    """
    if name not in SOLVERS:
        raise ValueError(f"solver must be one of {', '.join(SOLVERS)}, is {name!r}")
    return SOLVERS[name](structure, omega, rtol)


def stroboscopic_points(
    structure: Structure,
    amplitude: float,
    omega: float,
    state: np.ndarray,
    n_periods: int,
    solver: str = "flow",
    rtol: float = 1e-9,
) -> np.ndarray:
    """Return the stroboscopic points z(T), z(2T), ..., z(n_periods T).

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
        A and Omega of the ground acceleration A sin(Omega tau) (10).
    state : array_like, shape (2 n_floors,)
        (u, v) at tau = 0, in gaps and gaps omega_0.
    n_periods : int
    solver : {"flow", "bdf"}
    rtol : float
        Relative tolerance asked of the solver.

    Returns
    -------
    ndarray, shape (n_periods, 2 n_floors)

    Raises
    ------
    ValueError
        If an argument is outside its range.
    ArithmeticError
        If the solver fails; the message names the outcome and the period.
    """
    z = np.array(state, dtype=float)
    if z.shape != (2 * structure.n_floors,):
        raise ValueError(f"state must have shape ({2 * structure.n_floors},), has shape {z.shape}")
    if not np.all(np.isfinite(z)):
        raise ValueError("state must be finite")
    if not np.isfinite(amplitude):
        raise ValueError(f"amplitude must be finite, is {amplitude!r}")
    if not (np.isfinite(omega) and omega > 0):
        raise ValueError(f"omega must be finite and positive, is {omega!r}")
    if n_periods < 0:
        raise ValueError(f"n_periods must be at least 0, is {n_periods!r}")
    if not 0 < rtol < 1:
        raise ValueError(f"rtol must lie between 0 and 1, is {rtol!r}")
    points, outcome = make_solver(solver, structure, omega, rtol).points(
        z, float(amplitude), int(n_periods)
    )
    if outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"{solver}: {outcome.name} in forcing period {len(points) + 1}")
    return points
