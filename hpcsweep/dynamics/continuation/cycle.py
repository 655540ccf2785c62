r"""A periodic orbit as a chain of points, and Newton's method for it.

An orbit of period p of a map F is a chain X = (x_0, ..., x_{p-1}) with

    G_i(X, lambda) = F(x_i, lambda) - x_{i+1} = 0,    i + 1 modulo p

(multiple shooting, one segment a return). Its Jacobian holds the p tangent maps M_i one by one and
never their product, which loses the digits of all but the largest multipliers once the norms
multiply to more than 1 / eps. With y = (X, lambda / scale) a branch of orbits is a curve in p N + 1
dimensions; a point of it is found where it meets a hyperplane, border . (y - guess) = 0, which may
be "lambda is given" or, past a fold, one across the curve (pseudo-arclength; Keller, in
Applications of Bifurcation Theory, 1977, 359).

Newton's method begins with the Jacobian of a neighbour, if there is one, and keeps it while the
moves fall by `CONTRACTS`; the last move uses the tangent maps at the solution, which are needed
anyway. Where a motion grazes a contact that is a spring, F is once differentiable, with a term of
power 3/2: the method is then of order 3/2, not 2. From a distance of 1e-5 it takes 3 to 5 moves at
the three grazings of Figure 3's branch of period 1, and 2 or 3 elsewhere on it, to reach 1e-13.
"""

import contextlib
import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from hpcsweep.dynamics.stability import TangentMaps, Tests

STEPS = 12
CONTRACTS = 0.2
"""Factor by which moves must fall for the Jacobian to be kept."""
REACHED = 1e-8
"""Largest move before the last, and of the last: the remaining distance is then rounding."""
EXACT, ROUNDING = 1e-13, 1e-11
"""Moves with a kept Jacobian end at the first, or where they no longer fall and the last one that
did was at most the second: the map's own rounding, times the norm of the inverse, can be above the
first."""
STEEP = 0.2
"""Component of a tangent along the parameter from which points are sought at one value of it."""


class NotConvergedError(ArithmeticError):
    """Raised where Newton's method has found no orbit."""


class Map(Protocol):
    """A map with a parameter, or two; points are in units in which they are of order 1."""

    size: int
    """Dimension N."""

    def images(self, points: np.ndarray, value: Any) -> np.ndarray:
        """Return F of each point, shape (p, N); raise `ArithmeticError` where there is none."""

    def tangents(
        self, points: np.ndarray, value: Any, by: int = 0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return F, dF/dx and the first `by` of dF/dlambda of each point.

        Shapes (p, N), (p, N, N) and (p, N, by).
        """

    def take_round(
        self, scale: Any, rows: np.ndarray, inverse: np.ndarray, matrices: np.ndarray, rules: tuple
    ) -> tuple[float, float] | None:
        """Do what `Curve._take_round` does in one compiled call, if that can be done.

        `rows` are y, its guess, the border, and room for G, the next move, and more; the inverse
        and `matrices`, (p N, N), are written, if there are any; `rules` are the most moves,
        CONTRACTS, `enough` and `least`. Return `least` and the largest component of the next move.
        """

    def signature(self, points: np.ndarray, value: Any) -> tuple[int, ...]:
        """Count non-smooth events of the map along an orbit, (p, N); () for smooth maps."""


class Solution(NamedTuple):
    """A point of a curve.

    Attributes
    ----------
    y : ndarray, shape (p N + 1,)
    tangent : ndarray, shape (p N + 1,)
        Of length 1.
    maps : TangentMaps
        They give the multipliers where these are asked for: half of the points are steps on the way
        to a fold or a grazing, which ask for none.
    residual : float
        Largest component of G.
    inverse : ndarray, shape (p N + 1, p N + 1), or None
        Of the bordered Jacobian.
    """

    y: np.ndarray
    tangent: np.ndarray
    maps: TangentMaps
    residual: float
    inverse: np.ndarray | None = None

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, largest modulus first, shape (N,)."""
        return self.maps.multipliers

    @property
    def tests(self) -> Tests:
        """Functions of the multipliers that vanish at special points."""
        return self.maps.tests


class Round(NamedTuple):
    """A round of Newton's method.

    Attributes
    ----------
    y : ndarray, shape (p N + 1,)
        Where the moves by a kept Jacobian have led.
    misses, move : ndarray, shapes (p N,) and (p N + 1,)
        G there, and the next move.
    matrices, inverse
        See `Solution`, there.
    least, largest : float
        Largest component of the last move that was made, and of the next one.
    """

    y: np.ndarray
    misses: np.ndarray
    move: np.ndarray
    matrices: np.ndarray
    inverse: np.ndarray
    least: float
    largest: float


@dataclass(frozen=True, eq=False)
class Curve:
    """The curve of the orbits of one period.

    Attributes
    ----------
    map : Map
    period : int
    scale : float, or ndarray, shape (2,)
        Of the parameter: the last component of y is lambda / scale. Of two, the last two are.
    costly : bool
        Whether a new value of the parameter is: then points are sought at one value, where the
        curve is not nearly across the parameter.
    """

    map: Map
    period: int
    scale: Any
    costly: bool = field(default=False, kw_only=True)

    def border(self, way: np.ndarray, *tangents: np.ndarray) -> np.ndarray:
        """Return across what a point is sought, between two where the curve goes along `way`.

        A direction of the curve, or the parameter's where a value is costly and `way` and all
        `tangents` go along the parameter.
        """
        if not self.costly:
            return way
        along = [np.sign(way[-1]) * tangent[-1] for tangent in (way, *tangents)]
        return unit(way.size, -1, np.copysign(1.0, way[-1])) if min(along) >= STEEP else way

    @property
    def varied(self) -> int:
        """Number of parameters, from the first, that change along the curve."""
        return 1

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of y that are points, and of a point: p N and N."""
        return self.period * self.map.size, self.map.size

    def split(self, y: np.ndarray) -> tuple[np.ndarray, Any]:
        """Return the points of y, shape (p, N), and the value of the parameter, or of both."""
        size, _ = self.sizes
        points = y[:size].reshape(self.period, -1)
        if y.size == size + 1:
            return points, float(y[size]) * self.scale
        return points, tuple((y[size:] * self.scale).tolist())

    def join(self, points: np.ndarray, value: Any) -> np.ndarray:
        """Return y of points and a value of the parameter, or of both."""
        return np.append(points.ravel(), np.divide(value, self.scale))

    def misses(self, images: np.ndarray, points: np.ndarray, _y: np.ndarray) -> np.ndarray:
        """Return G = F(x_i) - x_{i+1} of points whose images are known, shape (p N,).

        `images` is overwritten.
        """
        images[:-1] -= points[1:]
        images[-1] -= points[0]
        return images.ravel()

    def residual(self, y: np.ndarray) -> np.ndarray:
        """Evaluate G, shape (p N,)."""
        points, value = self.split(y)
        return self.misses(self.map.images(points, value), points, y)

    def linearise(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate G, the tangent maps, (p, N, N), and dF/dlambda at each point, (p, N, 1)."""
        points, value = self.split(y)
        images, matrices, slopes = self.map.tangents(points, value, self.varied)
        return self.misses(images, points, y), matrices, slopes

    def bordered(self, matrices: np.ndarray, slopes: np.ndarray, border: np.ndarray) -> np.ndarray:
        """Return the Jacobian of G by y, and `border` below it, shape (p N + 1, p N + 1)."""
        size, _ = self.sizes
        whole = np.empty((border.size, border.size))
        whole[:size, :size] = jacobian(matrices)
        whole[:size, size:] = slopes.reshape(size, -1) * self.scale
        whole[-1] = border
        return whole

    def signature(self, point: Solution) -> tuple[int, ...]:
        """Return the signature of an orbit."""
        return self.map.signature(*self.split(point.y))

    def solve(
        self,
        guess: np.ndarray,
        border: np.ndarray,
        near: Solution | None = None,
        reached: float = REACHED,
        keeps: bool = False,
    ) -> Solution:
        """Find the point of the curve on the hyperplane through `guess` across `border`.

        Parameters
        ----------
        guess, border : ndarray, shape (p N + 1,)
            The tangent that is returned points along `border`.
        near : Solution, optional
            A point whose Jacobian is used first.
        reached : float
            Largest last move, whose square is about the remaining distance: tangent and
            multipliers are those of its start.
        keeps : bool
            Whether to keep the Jacobian of `near`, which was sought across the same border, and
            with it tangent and tangent maps, where moves contract by it.

        Raises
        ------
        NotConvergedError
            If Newton's method does not converge, or the map fails on its way.
        """
        known = None if near is None else near.inverse
        try:
            if keeps and near is not None and known is not None:
                with contextlib.suppress(ArithmeticError):
                    one = self._take_round(guess, guess, border, known, EXACT, fresh=False)
                    if one.least <= ROUNDING:
                        return near._replace(y=one.y)
            return self._solve(guess, border, known, reached)
        except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            raise NotConvergedError(f"Newton's method has not converged: {error}") from None

    def _solve(
        self, guess: np.ndarray, border: np.ndarray, known: np.ndarray | None, reached: float
    ) -> Solution:
        y, least, before, inverse = guess, math.inf, math.inf, known
        while True:
            one = self._take_round(y, guess, border, inverse, reached, least)
            if one.least <= reached:
                break
            if not one.largest < before:
                raise NotConvergedError("its moves do not fall")
            y, least, before, inverse = one.y - one.move, one.largest, one.largest, one.inverse
        if not one.largest <= reached:
            raise NotConvergedError("its last move is too long")
        tangent = one.inverse[:, -1] / length(one.inverse[:, -1])
        maps = TangentMaps(one.matrices)
        return Solution(one.y - one.move, tangent, maps, largest(one.misses), one.inverse)

    def _take_round(
        self,
        y: np.ndarray,
        guess: np.ndarray,
        border: np.ndarray,
        inverse: np.ndarray | None,
        enough: float,
        least: float = math.inf,
        fresh: bool = True,
    ) -> Round:
        """Move y by a kept Jacobian while moves fall, at most to `enough`; find the one there."""
        (size, n), most = self.sizes, 0 if inverse is None or least <= enough else STEPS
        rows = np.empty((6, y.size))
        rows[0], rows[1], rows[2] = y, guess, border
        whole = np.empty((y.size, y.size)) if inverse is None else inverse.copy()
        matrices = np.empty((size * fresh, n))
        rules = most, CONTRACTS, enough, least
        moves = self.map.take_round(self.scale, rows, whole, matrices, rules)
        if moves is not None:
            return Round(rows[0], rows[3, :-1], rows[4], matrices.reshape(-1, n, n), whole, *moves)
        for _ in range(most):
            move = _move(self.residual(y), y - guess, border, whole)
            distance = largest(move)
            if not distance < least:
                break
            contracts = distance <= CONTRACTS * least
            y, least = y - move, distance
            if least <= enough or not contracts:
                break
        if not fresh:
            return Round(y, y, y, matrices, whole, least, math.inf)
        misses, matrices, slopes = self.linearise(y)
        whole = np.linalg.inv(self.bordered(matrices, slopes, border))
        move = _move(misses, y - guess, border, whole)
        return Round(y, misses, move, matrices, whole, least, largest(move))

    def through(self, guess: np.ndarray, tangent: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y of the point by an orbit, across the tangent there; `guess` is on the curve."""
        return self.solve(guess + tangent @ (y - guess) * tangent, tangent).y


def length(vector: np.ndarray) -> float:
    """Return the Euclidean length of a vector: of short ones in a third of the time of numpy's."""
    return math.sqrt(vector.dot(vector))


def largest(vector: np.ndarray) -> float:
    """Return the largest modulus of a component, NaN if one is."""
    return float(np.maximum.reduce(np.abs(vector)))


def unit(size: int, place: int, length: float = 1.0) -> np.ndarray:
    """Return the vector of a length along one component."""
    vector = np.zeros(size)
    vector[place] = length
    return vector


def continued(map_: Map, points: np.ndarray, value: Any, period: int) -> np.ndarray:
    """Return the first points of an orbit, shape (k, N), and the images of the last, (p, N)."""
    chain = list(points)
    while len(chain) < period:
        chain.append(map_.images(chain[-1][None], value)[0])
    return np.array(chain)


def jacobian(matrices: np.ndarray) -> np.ndarray:
    """Return the Jacobian of G by X, shape (p N, p N)."""
    p, n, _ = matrices.shape
    whole = _shift(p, n).copy()
    for i, matrix in enumerate(matrices):
        rows = slice(i * n, (i + 1) * n)
        whole[rows, rows] += matrix
    return whole


@lru_cache(maxsize=16)
def _shift(p: int, n: int) -> np.ndarray:
    """Return the constant part of the Jacobian: -dx_{i+1}/dX."""
    return -np.roll(np.eye(p * n), n, axis=1)


def _move(
    misses: np.ndarray, away: np.ndarray, border: np.ndarray, inverse: np.ndarray
) -> np.ndarray:
    """Return by how much a point `away` from its guess misses the curve and the hyperplane."""
    off = np.empty(away.size)
    off[:-1], off[-1] = misses, border.dot(away)
    move: np.ndarray = inverse.dot(off)
    if abs(border[-1]) == 1.0:  # at one value, to the last bit, so that it is one solver
        move[-1] = 0.0
    return move


def solve_at(curve: Curve, points: np.ndarray, value: float) -> Solution:
    """Find the orbit near `points`, shape (p, N), at a value of the parameter; see `solve`."""
    y = curve.join(points, value)
    return curve.solve(y, unit(y.size, -1))
