"""Neighbourhoods of orbits from which motions converge to the orbit, and the way into them.

Let z_k be the points of an orbit of period p and T_k the tangent map of the period from z_k to
z_(k+1). With P_k = T_k' P_(k+1) T_k + Q the quadratic form V_k(x) = x' P_k x falls by x' Q x in
each period of the linearised motion; over the whole orbit, P_0 is the solution of the discrete
Lyapunov equation P_0 = M' P_0 M + S, M the monodromy matrix, which exists where all multipliers are
inside the unit circle. Q is 1 in the units of the state.

The ellipsoids V_k(z - z_k) <= c form a neighbourhood that the motion does not leave if V falls on
their surfaces. That is tested, not proved, for the map itself: on `DIRECTIONS` pairs of opposite
points of each surface, at the level c and at `INNER` c, from a large level down to the first that
passes. States within `MARGIN` c are taken to go to the orbit.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from hpcsweep.dynamics.attractor import FAILED, UNDECIDED
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll

DIRECTIONS = 12
"""Pairs of points tested on an ellipsoid, in a space of any dimension: at least twice as many as
the six dimensions of three floors."""
LARGEST = 0.3
"""Longest half axis tried first, in units of the state."""
LEVELS, SHRINK = 6, 9.0
"""Levels tried, each this much lower; half axes shrink by 3."""
INNER, MARGIN = 0.1, 0.25
STRIDE = 8
"""Forcing periods between two tests of the starts."""
WINDOW = 64
"""Last points kept of a start that comes near no known orbit."""


@dataclass(frozen=True)
class Neighbourhood:
    """Ellipsoids around the points of an orbit.

    Attributes
    ----------
    points : ndarray, shape (p, 2n)
    forms : ndarray, shape (p, 2n, 2n)
        P_k / (`MARGIN` c): at most 1 inside.
    """

    points: np.ndarray
    forms: np.ndarray


def neighbourhood(solver, amplitude: float, points: np.ndarray, rng) -> Neighbourhood | None:
    """Return the neighbourhood of an orbit; None if no level passes.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    points : ndarray, shape (p, 2n)
        Points of the orbit in order.
    rng : numpy.random.Generator
        Source of the tested directions.
    """
    units = solver.structure.state_units
    try:
        tangents = [solver.monodromy(z, amplitude, 1)[1] for z in points]
        forms = lyapunov_forms(tangents, np.diag(1.0 / units**2))
        factors = np.linalg.cholesky(forms)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError):
        return None
    directions = rng.standard_normal((DIRECTIONS, units.size))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    surfaces = [np.linalg.solve(factor.T, directions.T).T for factor in factors]
    longest = max(float((np.abs(s) / units).max()) for s in surfaces)
    level = (LARGEST / longest) ** 2
    for _ in range(LEVELS):
        tried = level, INNER * level
        if all(_falls(solver, amplitude, points, forms, surfaces, each) for each in tried):
            return Neighbourhood(points, forms / (MARGIN * level))
        level /= SHRINK
    return None


def lyapunov_forms(tangents: list[np.ndarray], form: np.ndarray) -> np.ndarray:
    """Return P_k for the tangent maps of an orbit's periods and Q; shape (p, 2n, 2n).

    Raises
    ------
    numpy.linalg.LinAlgError
        If the orbit repels, or there is no solution.
    """
    product, summed = np.eye(len(form)), np.zeros_like(form)
    for tangent in tangents:
        summed = summed + product.T @ form @ product
        product = tangent @ product
    if not np.abs(np.linalg.eigvals(product)).max() < 1:
        raise np.linalg.LinAlgError("the orbit is not attracting")
    first = solve_discrete_lyapunov(product.T, summed)
    forms = [0.5 * (first + first.T)]
    for tangent in tangents[:0:-1]:
        forms.append(tangent.T @ forms[-1] @ tangent + form)
    return np.array([forms[0], *forms[:0:-1]])


def inside(states: np.ndarray, neighbourhoods: list[Neighbourhood | None]) -> np.ndarray:
    """Return the index in `neighbourhoods` of the neighbourhood of each state, -1 for none.

    Parameters
    ----------
    states : ndarray, shape (k, 2n)
    neighbourhoods : list of Neighbourhood or None
    """
    places = np.full(len(states), -1)
    for place, each in enumerate(neighbourhoods):
        if each is None:
            continue
        away = states[:, None] - each.points
        level = np.einsum("ski,kij,skj->sk", away, each.forms, away).min(axis=1)
        places[(level <= 1.0) & (places < 0)] = place
    return places


def _falls(solver, amplitude, points, forms, surfaces, level: float) -> bool:
    """Return whether V falls over a period from each tested point of the surfaces V = level."""
    size = np.sqrt(level)
    for k, (point, surface) in enumerate(zip(points, surfaces, strict=True)):
        after = (k + 1) % len(points)
        for step in (*surface, *-surface):
            end = solver.advance(point + size * step, amplitude, 1)
            away = end.state - points[after]
            if end.outcome is not Outcome.COMPLETE or not away @ forms[after] @ away < level:
                return False
    return True


class Approached(NamedTuple):
    """Starts after their approach.

    Attributes
    ----------
    labels : ndarray of int, shape (k,)
        Index of the orbit, `FAILED`, or `UNDECIDED` for a start near none.
    cycles : ndarray of int, shape (k,)
        Forcing periods integrated.
    windows : dict of int to ndarray
        Last points of each undecided start, at most `WINDOW`.
    failures : list of Outcome
    """

    labels: np.ndarray
    cycles: np.ndarray
    windows: dict[int, np.ndarray]
    failures: list[Outcome]


def approach(
    solver,
    amplitude: float,
    starts: np.ndarray,
    neighbourhoods: list[Neighbourhood | None],
    longest: int,
    poll: Poll = None,
) -> Approached:
    """Integrate each start until it is in a neighbourhood, for some `longest` forcing periods.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    starts : ndarray, shape (k, 2n)
    neighbourhoods : list of Neighbourhood or None
        Of the known attractors.
    longest : int
        Forcing periods after which a start is left at the next test.
    poll : callable, optional
        Called before each stride; may raise to leave.
    """
    labels, cycles = np.full(len(starts), UNDECIDED), np.zeros(len(starts), int)
    failures: list[Outcome] = []
    left, gone = np.arange(len(starts)), 0
    trail = np.empty((len(starts), longest + STRIDE, starts.shape[1]))
    trail[:, 0] = starts
    while left.size:
        there = inside(trail[left, gone], neighbourhoods)
        labels[left[there >= 0]] = there[there >= 0]
        left = left[there < 0]
        if gone >= longest:
            break
        for k in left.tolist():
            if poll is not None:
                poll()
            points, outcome = solver.points(trail[k, gone], amplitude, STRIDE)
            cycles[k] += len(points)
            if outcome is Outcome.COMPLETE:
                trail[k, gone + 1 : gone + 1 + STRIDE] = points
            else:
                labels[k] = FAILED
                failures.append(outcome)
        left = left[labels[left] != FAILED]
        gone += STRIDE
    first = max(gone + 1 - WINDOW, 0)
    windows = {k: trail[k, first : gone + 1] for k in left.tolist()}
    return Approached(labels, cycles, windows, failures)
