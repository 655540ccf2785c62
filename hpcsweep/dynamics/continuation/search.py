r"""Search for unknown orbits: Newton's method from many starts, with the known ones deflated.

At a value of the parameter the orbits of period p are the zeros of G (`cycle`). With the known ones
X_1, ..., X_m, in all their shifts, the zeros of

    M(X) G(X),    M(X) = prod_k (1 + 1 / |X - X_k|^2)

are the others (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026). By the formula
of Sherman and Morrison a step of Newton's method for them is one for G, d, times a number:

    d / (1 - d . grad M / M),    grad M / M = sum_k -2 (X - X_k) / (r_k^2 (r_k^2 + 1))

with r_k = |X - X_k|,

so that a step towards a known orbit is turned round.
"""

from collections.abc import Iterator

import numpy as np

from hpcsweep.dynamics.continuation import cycle
from hpcsweep.dynamics.continuation.catalogue import Catalogue
from hpcsweep.dynamics.continuation.cycle import Curve, Map, NotConvergedError
from hpcsweep.dynamics.orbit import divisors

VALUES = 8
"""Values of the parameter at which orbits are sought, in the middles of as many parts of a span."""
PERIODS = 4
"""Longest period that is sought."""
STEPS = 24
LONGEST = 0.5
"""Longest step, in units of the state."""
NEAR = 1e-4
"""Length of a step of Newton's method for G from which on no orbit is deflated any more."""
OTHER = 1e-6
"""Distance between two orbits."""
FARTHEST = 10.0
"""Largest component, in those of the starts, from which a start is given up."""


def places(low: float, high: float, most_period: int, starts: int) -> Iterator[tuple]:
    """Share out starts: the number, the value and the period of each."""
    periods = min(most_period, PERIODS)
    for number in range(starts):
        period, part = 1 + number % periods, number // periods % VALUES
        yield number, low + (high - low) * (part + 0.5) / VALUES, period


def search(
    catalogue: Catalogue, map_: Map, starts: np.ndarray, span: tuple[float, float], most_period: int
) -> None:
    """Look for orbits that are on no branch of a catalogue, and follow their branches.

    Parameters
    ----------
    catalogue : Catalogue
    map_ : Map
    starts : ndarray, shape (m, N)
        In units of the state.
    span : (float, float)
    most_period : int
        The longest period is this or `PERIODS`.
    """
    orbits: dict[tuple[int, float], list[np.ndarray]] = {}
    reach = FARTHEST * float(np.abs(starts).max(initial=1.0))
    seen = -1
    for number, value, period in places(*span, most_period, len(starts)):
        if len(catalogue.branches) != seen:
            orbits, seen = {}, len(catalogue.branches)
        key = period, value
        if key not in orbits:
            orbits[key] = [
                np.roll(np.tile(orbit, (period // p, 1)), shift, axis=0)
                for p in divisors(period)
                for orbit in catalogue.orbits_at(p, value)
                for shift in range(p)
            ]
        points = deflated(Curve(map_, period, 1.0), starts[number], value, orbits[key], reach)
        if points is not None:
            try:
                catalogue.add(points, value, searched=True)
            except NotConvergedError:
                continue


def deflated(
    curve: Curve, start: np.ndarray, value: float, orbits: list[np.ndarray], reach: float
) -> np.ndarray | None:
    """Seek an orbit other than those known, from a start; return its points, shape (p, N)."""
    map_ = curve.map
    try:
        y = curve.join(cycle.continued(map_, start[None], value, curve.period), value)
        for _ in range(STEPS):
            x = curve.split(y)[0]
            images, matrices, _ = map_.tangents(x, value)
            step = -np.linalg.solve(cycle.jacobian(matrices), curve.misses(images, x, y))
            if np.abs(step).max() <= NEAR:
                points = curve.split(cycle.solve_at(curve, x, value).y)[0]
                others = [np.abs(points - orbit).max() for orbit in orbits]
                return points if min(others, default=np.inf) > OTHER else None
            turn = 0.0
            for orbit in orbits:
                away = y[:-1] - orbit.ravel()
                square = float(away @ away) + np.finfo(float).tiny
                turn -= 2.0 * float(step @ away) / (square * (square + 1.0))
            step /= 1.0 - turn
            step *= min(1.0, LONGEST / float(np.abs(step).max()))
            y[:-1] += step
            if not np.abs(y[:-1]).max() <= reach:
                return None
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None
    return None
