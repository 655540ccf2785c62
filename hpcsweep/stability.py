"""Stability of orbits: Floquet multipliers and the largest Lyapunov exponent."""

import math

import numpy as np

from hpcsweep.outcome import Outcome

NEWTON_STEPS = 6
NEWTON_SAME = 1e-7
"""Distance between points whose tangent maps are taken for the same."""
NEWTON_REACH = 0.01
"""Longest jump (gaps, gaps omega_0)."""
NEWTON_RESIDUAL = 1e-11
NEWTON_STABLE = 0.9999
NEWTON_LINEAR = 0.05


def floquet_multipliers(matrix: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of a monodromy matrix, largest modulus first, shape (2n,).

    The system is forced, so no multiplier is trivial and all are returned. Their product is
    exp(-p T tr(2 gamma C)).
    """
    multipliers = np.linalg.eigvals(matrix)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def newton_orbit(
    solver, points: np.ndarray, amplitude: float, period: int
) -> tuple[np.ndarray, int, float] | None:
    """Jump from an approaching motion to the orbit it approaches, if that is proved.

    Newton's method on F(z) = z, F the period map over `period` forcing periods with tangent M,
    from where the last three points extrapolate to (Aitken's method along their differences). The
    matrix is kept while it was taken within `NEWTON_SAME` of where it is used; what an orbit's
    matrix tells, its multiplier too, is then right to about that.

    The orbit z* is accepted if

    - it is a fixed point to `NEWTON_RESIDUAL`;
    - it attracts: the spectral radius of M(z*) is below `NEWTON_STABLE`;
    - F is linear between the last points and it: F(z) - z* differs from M(z*) (z - z*) by
      no more than `NEWTON_LINEAR` of itself. The present state is then attracted as the linear
      map says, to z* and to nothing else.

    Parameters
    ----------
    solver : Solver
    points : ndarray, shape (3, 2n)
        The motion `period` forcing periods apart, the present state last.
    amplitude : float
    period : int

    Returns
    -------
    (state, n_periods, multiplier) or None
        z*, shape (2n,), the forcing periods integrated, and the modulus of the largest Floquet
        multiplier; None if any test fails.
    """
    before, state, image = points
    point = image + _extrapolation(state - before, image - state)
    unit = np.eye(len(point))
    taken, matrix = None, None
    periods = 0
    for _ in range(NEWTON_STEPS):
        if taken is not None and np.abs(point - taken).max() <= NEWTON_SAME:
            done = solver.advance(point, amplitude, period)
            if done.outcome is not Outcome.COMPLETE:
                return None
            reached = done.state
        else:
            taken = point
            reached, matrix = solver.monodromy(point, amplitude, period)
        periods += period
        left = reached - point
        if np.abs(left).max() <= NEWTON_RESIDUAL:
            break
        point = point - np.linalg.solve(matrix - unit, left)
        if not np.abs(point - image).max() <= NEWTON_REACH:
            return None
    else:
        return None
    multiplier = float(abs(floquet_multipliers(matrix)[0]))
    if multiplier > NEWTON_STABLE:
        return None
    left = image - point
    curved = np.abs(left - matrix @ (state - point)).max()
    if curved > NEWTON_LINEAR * np.abs(left).max() + NEWTON_RESIDUAL:
        return None
    return reached, periods, multiplier


def _extrapolation(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Sum the geometric series that two differences begin, as far as it converges."""
    ratio = float(before @ now) / max(float(before @ before), 1e-300)
    return now * ratio / (1.0 - ratio) if abs(ratio) < 1.0 else 0.0 * now


def orbit_exponent(solver, state: np.ndarray, amplitude: float, period: int) -> float:
    """Give the largest Lyapunov exponent per unit time of a periodic orbit: ln |mu_1| / (p T).

    mu_1 is the largest Floquet multiplier. Of other motions the exponent is the growth of a
    tangent vector over a window, over its time (`hpcsweep.observation`).

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
    _, matrix = solver.monodromy(state, amplitude, period)
    time = period * 2 * math.pi / solver.omega
    return exponent_of_multiplier(float(abs(floquet_multipliers(matrix)[0])), time)


def exponent_of_multiplier(multiplier: float, time: float) -> float:
    """Turn the modulus of an orbit's largest multiplier over a time into an exponent."""
    return math.log(multiplier) / time if multiplier > 0 else -math.inf
