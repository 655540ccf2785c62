r"""Decide whether a state that closes on itself after p forcing periods is on an orbit.

That a motion closes to within some tolerance shows no orbit. Where two orbits have met in a fold
and are gone, the map along the direction that they met in is F(x) - x = delta + c x^2 with delta, c
> 0: the motion slows down near x = 0, closes to delta there and takes pi / sqrt(c delta) returns to
pass. It is the *ghost* of the fold. An orbit exists where F(x) - x has a zero, and Newton's method
tells: with d its move from x, the next residual is c d^2, and the ratio of a move with the Jacobian
kept to the move before it is

    theta = c d^2 / |2 c x| / d = (1 + delta / (c x^2)) / 4,

below 1/4 for every x if there is a zero (delta < 0), at least 1/4 if there is none. So beside an
orbit the residual falls by a square, at a fold (delta = 0) by a quarter a move, and past it, it
comes to delta and jumps about. Nothing but rounding ends its fall to an orbit.

*Rounding* is recognised without a tolerance, which would have to know the growth of errors within
a period: 1e-16 of soft structures, 1e-12 of a smooth contact 1e5 times as stiff. After a move d
from a point with tangent map M to one with M' the residual is that of curvature, (M' - M) d / 2 to
second order (of 2/3 of it at a grazing, see below), and what rounding adds. Where the former is
less than `CURVED` of it the rest is rounding, and the point is as near to the orbit as its
condition permits, |(M - 1)^-1| eps: near a fold, where x^2 = -delta / c, this is eps / |2 c x|. It
reaches x itself at x = sqrt(eps / c), 1e-7 to 1e-8: orbits within eps of their fold in the
parameter are known to no more than that, and which side of the fold they are on is not decided.

Where a motion grazes a contact that is a spring, F has a term b max(x, 0)^(3/2) (of a dashpot, one
of x). The method then is of order 3/2 on the side of the impact: M changes like sqrt(x), and from
the other side, from which it sees no impact, a move leads past the kink, and the next one comes
from there. Moves need not fall from the first to the last, only in the end.

All points of the orbit are solved for at once, as in `continuation.cycle`: a residual is that of
one period. Orbits of sliders, and of what has no spring, come in families: it is the nearest one,
relative to what drifts along directions that no spring opposes.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import jacobian
from hpcsweep.dynamics.orbit import smallest_period
from hpcsweep.dynamics.stability import TangentMaps, floquet_multipliers, without_families
from hpcsweep.solvers.offers import CLOSING, ISOLATED
from hpcsweep.solvers.polling import Poll

STEPS = 40
NEAR, PATIENCE = 1e-3, 6
"""Residual from which it must halve within so many moves: at a fold it falls to a quarter in one.
"""
HASTY = 3
"""The same for motions beside an orbit that are nearly linear: of 831 jumps all but one."""
CURVED = 0.25
"""Share of a residual due to curvature, below which the rest is rounding."""
CLOSE = 1e-13
"""Residual, in units of the state, that is rounding where the move is hardly larger: past a fold no
move is below (delta / c)^(1/2)."""
MAX_ROUNDING = 1e-9
"""Of a period's integration, in units of the state."""
MIN_ROUNDING = 4 * np.finfo(float).eps
"""Residual that is rounding whatever precedes it, as a share of the largest state."""
REACH = 0.1
"""Largest distance of an orbit from where it is sought, in units of the state."""
FAR = 1e3
"""Size of a state, in its units, at which Newton's method is lost."""
FAMILY = 1e-7
"""Singular value, over the largest, that is 0: tangent maps of sliders are differences."""
FEW = 100
"""Numbers of an orbit of several periods from which on what has no spring is taken to be held by
contacts over it: what floats free, in families, has period 1."""
SAME, UNCERTAIN = 1e-9, 10.0
"""Distance of points of an orbit that may be one, and its multiple of the uncertainty."""


class VerifiedOrbit(NamedTuple):
    """An orbit to which Newton's method has converged to rounding.

    Attributes
    ----------
    points : ndarray, shape (p, 2n)
        z(0), z(T), ..., of one turn of the minimal period p.
    maps : TangentMaps
        Of each point over a forcing period, in units of the state.
    residual : float
        Largest difference between F of a point and the next point, in units of the state.
    uncertainty : float
        Length of the move that is left, in units of the state.
    transverse : ndarray, shape (m, m), optional
        Of sliders: the monodromy matrix transverse to the family of the orbit.
    """

    points: np.ndarray
    maps: TangentMaps
    residual: float
    uncertainty: float
    transverse: np.ndarray | None = None

    @property
    def period(self) -> int:
        """Minimal period p in forcing periods."""
        return len(self.points)

    @property
    def families(self) -> int:
        """Number of multipliers that are 1 along the family of the orbit."""
        return 0 if self.transverse is None else self.points.shape[1] - len(self.transverse)

    @property
    def multiplier(self) -> float:
        """Modulus of the largest multiplier: of the product of tangent maps, which keeps it.

        Infinite where the product is, of impacts that hardly more than graze.
        """
        product = self.maps.product if self.transverse is None else self.transverse
        if not np.isfinite(product).all():
            return math.inf
        return float(abs(floquet_multipliers(product)[0]))


class Verdict(NamedTuple):
    """What Newton's method has found.

    Attributes
    ----------
    orbit : VerifiedOrbit or None
        None where there is no orbit: the motion is slow, near the ghost of a fold or elsewhere.
    residual : float
        Least that was reached, in units of the state; inf if the solver has failed.
    away : float
        Distance of the orbit that was found from the state, in its units; inf if none was.
    cycles : int
        Forcing periods integrated.
    """

    orbit: VerifiedOrbit | None
    residual: float
    away: float
    cycles: int


def verify_orbit(
    solver,
    state: np.ndarray,
    amplitude: float,
    period: int,
    reach: float = REACH,
    poll: Poll = None,
    hasty: bool = False,
) -> Verdict:
    """Find the orbit on which a state nearly closes, to rounding, or find that there is none.

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,) or (k, 2n)
        At phase 0, or the first k consecutive stroboscopic points of a turn, k <= `period`.
    amplitude : float
    period : int
        Forcing periods after which it closes; the orbit has this period or a divisor of it.
    reach : float
        Largest distance of the orbit from the state, in units of the state.
    poll : callable, optional
        Called before each piece of the work; may raise to leave.
    hasty : bool
        Whether an orbit is of no use unless the map is nearly linear from the state to it.

    Returns
    -------
    Verdict
        Its orbit begins with the point near the state.
    """
    search = _Search(solver, amplitude, poll, HASTY if hasty else PATIENCE)
    points = np.atleast_2d(state) / search.units
    least, away = math.inf, math.inf
    for marched in (False,) if hasty else (False, True):
        try:
            verified = search.converge(search.continued(points, period), marched)
            verified = None if verified is None else search.shortened(verified)
        except (ArithmeticError, np.linalg.LinAlgError, ValueError):
            verified = None
        least = min(least, search.least)
        if verified is not None:
            away = min(away, float(np.abs(verified.points[0] - points[0]).max()))
            if away <= reach:
                orbit = verified._replace(points=verified.points * search.units)
                if not ISOLATED.of(solver.structure):
                    left = without_families(solver.structure, verified.maps.product)
                    orbit = orbit._replace(transverse=left)
                return Verdict(orbit, verified.residual, away, search.cycles)
    return Verdict(None, least, away, search.cycles)


class _Search:
    """Newton's method for orbits at one amplitude, in units of the state."""

    def __init__(self, solver, amplitude: float, poll, patience: int):
        self._patience = patience
        self._solver, self._amplitude, self._poll = solver, amplitude, poll
        self.units = solver.structure.state_units
        self._moves = _moves if ISOLATED.of(solver.structure) else self._nearest
        self.least, self.cycles = math.inf, 0

    def closed(self, apart: np.ndarray) -> np.ndarray:
        """Return differences of states, (..., N), relative to what drifts."""
        structure = self._solver.structure
        if CLOSING.of(structure):
            return apart
        return structure.without_drift(apart * self.units) / self.units

    def _nearest(self, matrices: np.ndarray, misses: np.ndarray) -> np.ndarray:
        """Return the same as `_moves` of families: the shortest d."""
        p, n, _ = matrices.shape
        if p > 1 and p * n > FEW and CLOSING.of(self._solver.structure):
            return _moves(matrices, misses)
        whole = self.closed(jacobian(matrices).T.reshape(-1, p, n)).reshape(-1, p * n).T
        return (np.linalg.pinv(whole, rcond=FAMILY) @ misses.ravel()).reshape(misses.shape)

    def tangents(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the images of points, shape (p, N), and the tangent maps, (p, N, N)."""
        images, matrices = self._solver.images(
            points * self.units, self._amplitude, True, self._poll
        )
        self.cycles += len(points)
        return images / self.units, matrices * self.units / self.units[:, None]

    def continued(self, points: np.ndarray, period: int) -> np.ndarray:
        """Return p consecutive points, of which the first are known."""
        missing = period - len(points)
        if missing <= 0:
            return points[:period]
        last = points[-1] * self.units
        more, _ = self._solver.points(last, self._amplitude, missing, self._poll)
        self.cycles += missing
        return np.concatenate((points, more / self.units))

    def converge(self, points: np.ndarray, marched: bool = False) -> VerifiedOrbit | None:
        """Return the orbit near points, shape (p, N), of p or a divisor; None if there is none.

        `marched`: after a move all points follow from the first one.
        """
        before = matrices = np.zeros((*points.shape, points.shape[1]))
        shift, curved, fallen = np.zeros_like(points), math.inf, 0
        self.least = math.inf
        for step in range(STEPS):
            images, matrices = self.tangents(points)
            misses = self.closed(images - np.roll(points, -1, axis=0))
            residual = float(np.abs(misses).max())
            if not residual <= FAR:
                return None
            if residual <= 0.5 * self.least:
                fallen = step
            self.least = min(self.least, residual)
            if step > 0:
                bent = 0.5 * np.einsum("pij,pj->pi", matrices - before, shift)
                curved = float(np.abs(_gathered(before, bent) if marched else bent).max())
            move = self._moves(matrices, misses)
            left = float(np.abs(move).max())
            least = CLOSE if left <= 100 * CLOSE else MIN_ROUNDING * (1.0 + np.abs(points).max())
            if residual <= least or (residual <= MAX_ROUNDING and curved <= CURVED * residual):
                return VerifiedOrbit(points, TangentMaps(matrices), residual, left)
            if self.least <= NEAR and step - fallen >= self._patience:
                return None
            moved = points - move
            if marched:
                moved = self.continued(moved[:1], len(points))
            before, shift, points = matrices, points - moved, moved
        return None

    def shortened(self, orbit: VerifiedOrbit) -> VerifiedOrbit:
        """Return one turn of an orbit that repeats within the turn that was solved for."""
        same = max(SAME, UNCERTAIN * orbit.uncertainty)
        shortest = smallest_period(self.closed(orbit.points), same)
        if shortest == orbit.period:
            return orbit
        return self.converge(orbit.points[:shortest]) or orbit


def _gathered(matrices: np.ndarray, bent: np.ndarray) -> np.ndarray:
    """Return the sum of what the periods of a turn contribute to its end, shape (N,)."""
    total = np.zeros(bent.shape[1])
    for matrix, defect in zip(matrices, bent, strict=True):
        total = matrix @ total + defect
    return total


@np.errstate(over="ignore", invalid="ignore")
def _moves(maps: np.ndarray, misses: np.ndarray) -> np.ndarray:
    """Solve M_i d_i - d_(i+1) = misses_i, i + 1 modulo p, for d, shape (p, N).

    Two periods are one, d_(i+2) = M_(i+1) M_i d_i - (M_(i+1) misses_i + misses_(i+1)), and two of
    these, until one is left. What rounding of the products leaves the next move takes away.
    """
    if len(maps) == 1:
        return np.linalg.solve(maps[0] - np.eye(len(maps[0])), misses[0])[None]
    d, odd = np.empty_like(misses), len(maps) // 2 * 2
    pairs = maps[1::2] @ maps[:-1:2], np.einsum("pij,pj->pi", maps[1::2], misses[:-1:2])
    whole = zip((pairs[0], pairs[1] + misses[1::2]), (maps[odd:], misses[odd:]), strict=True)
    d[::2] = _moves(*map(np.concatenate, whole))
    d[1::2] = np.einsum("pij,pj->pi", maps[:-1:2], d[:-1:2]) - misses[:-1:2]
    return d
