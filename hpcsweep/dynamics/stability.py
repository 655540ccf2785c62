"""Stability of orbits: Floquet multipliers and the largest Lyapunov exponent."""

import math

import numpy as np

from hpcsweep.model.arguments import count, rows


def floquet_multipliers(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of a monodromy matrix, largest modulus first, shape (2n,).

    The system is forced, so no multiplier is trivial and all are returned. Their product is
    exp(-p T tr(2 gamma C)).

    Raises
    ------
    ValueError
        If the matrix is not square, or not finite.
    """
    matrix = rows("matrix", matrix)
    if matrix.shape[0] != matrix.shape[1] or not np.all(np.isfinite(matrix)):
        raise ValueError(f"matrix must be square and finite, has shape {matrix.shape}")
    multipliers = np.linalg.eigvals(matrix)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def orbit_exponent(solver, state: np.ndarray, amplitude: float, period: int) -> float:
    """Return the largest Lyapunov exponent per unit time of a periodic orbit: ln |mu_1| / (p T).

    mu_1 is the largest Floquet multiplier. For other motions the exponent is the growth of a
    tangent vector over a window, divided by its time (`hpcsweep.solvers.records`).

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
        Point of the orbit at tau = 0.
    amplitude : float
    period : int
        Orbit period p.

    Returns
    -------
    float
        -inf if the tangent map vanishes.

    Raises
    ------
    ArithmeticError
        If the solver fails.
    """
    period = count("period", period, 1)
    _, matrix = solver.monodromy(state, amplitude, period)
    time = solver.structure.forcing.period(solver.omega, period)
    return exponent_of_multiplier(float(abs(floquet_multipliers(matrix)[0])), time)


def exponent_of_multiplier(multiplier: float, time: float) -> float:
    """Return the exponent for the modulus of an orbit's largest multiplier over a time."""
    return math.log(multiplier) / time if multiplier > 0 else -math.inf
