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

Along the amplitude of a structure, where a new value needs no solver, the method is compiled
(`hpcsweep.solvers.flow.orbit.corrector`), and so are steps on which nothing happens (`.walk`): in
Python a point of three floors costs 350 to 450 us, of which its map takes 30. The method is written
twice for this factor; the one here serves any map and parameter, and orbits whose tangent maps have
no product with the digits of the multipliers.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from hpcsweep.dynamics.stability import TangentMaps, Tests
from hpcsweep.solvers.branch_rule import CONTRACTS, EXACT, REACHED, ROUNDING, STEPS

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

    def tangents(self, points: np.ndarray, value: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return F and dF/dx of each point, shapes (p, N) and (p, N, N)."""

    def slopes(self, points: np.ndarray, value: Any, images: np.ndarray, k: int = 0) -> np.ndarray:
        """Return dF/dlambda at each point, whose F is known; of parameter number `k` of two."""

    def signature(self, points: np.ndarray, value: Any) -> tuple[int, ...]:
        """Count non-smooth events of the map along an orbit, (p, N); () for smooth maps."""

    def tracer(self, period: int, scale: float, made: Callable[..., Any]) -> Any:
        """Return what finds points of a `Curve` by compiled kernels, None for most maps.

        See `hpcsweep.solvers.flow.orbit.tracer`; `made` makes a point of what that knows of it.
        """


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
    signature : tuple of int or None
        Of the orbit, if it is known.
    """

    y: np.ndarray
    tangent: np.ndarray
    maps: TangentMaps
    residual: float
    inverse: np.ndarray | None = None
    signature: tuple[int, ...] | None = None

    @classmethod
    def made(cls, y, tangent, matrices, multipliers, *others) -> "Solution":
        """Return what a tracer has found; the multipliers are None where they are not known."""
        return cls(y, tangent, TangentMaps(matrices, multipliers), *others)

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, largest modulus first, shape (N,)."""
        return self.maps.multipliers

    @property
    def tests(self) -> Tests:
        """Functions of the multipliers that vanish at special points."""
        return self.maps.tests


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
        along = [np.sign(way[-1]) * tangent[-1] for tangent in (way, *tangents)]
        at_one_value = self.costly and min(along) >= STEEP
        return unit(way.size, -1, np.copysign(1.0, way[-1])) if at_one_value else way

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of y that are points, and of a point: p N and N."""
        return self.period * self.map.size, self.map.size

    def split(self, y: np.ndarray) -> tuple[np.ndarray, Any]:
        """Return the points of y, shape (p, N), and the value of the parameter, or of both."""
        size, _ = self.sizes
        values = (y[size:] * self.scale).tolist()
        return y[:size].reshape(self.period, -1), values[0] if len(values) == 1 else tuple(values)

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

    def slopes(self, points: np.ndarray, value: Any, images: np.ndarray) -> np.ndarray:
        """Return dF/dlambda at each point, shape (p, N)."""
        return self.map.slopes(points, value, images)

    def residual(self, y: np.ndarray) -> np.ndarray:
        """Evaluate G, shape (p N,)."""
        points, value = self.split(y)
        return self.misses(self.map.images(points, value), points, y)

    def linearise(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate G, the tangent maps, (p, N, N), and dF/dlambda at each point, (p, N)."""
        points, value = self.split(y)
        images, matrices = self.map.tangents(points, value)
        slopes = self.slopes(points, value, images)
        return self.misses(images, points, y), matrices, slopes

    def bordered(self, matrices: np.ndarray, slopes: np.ndarray, border: np.ndarray) -> np.ndarray:
        """Return the Jacobian of G by y, and `border` below it, shape (p N + 1, p N + 1)."""
        size, _ = self.sizes
        whole = np.empty((border.size, border.size))
        whole[:size, :size] = jacobian(matrices)
        whole[:size, size:] = slopes.reshape(size, -1) * self.scale
        whole[-1] = border
        return whole

    @cached_property
    def tracer(self) -> Any:
        """What finds the points by compiled kernels, or None; see `Map`."""
        return self.map.tracer(self.period, self.scale, Solution.made)

    def signature(self, point: Solution) -> tuple[int, ...]:
        """Return the signature of an orbit."""
        if point.signature is not None:
            return point.signature
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
        tracer, point = self.tracer, None
        try:
            if tracer is not None:
                point = tracer.solve(guess, border, near, reached, keeps)
            else:
                if keeps and near is not None:
                    point = self._solve_keeping(guess, border, near)
                inverse = None if near is None else near.inverse
                point = point or self._solve(guess, border, inverse, reached)
        except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            raise NotConvergedError(str(error)) from None
        if point is None:
            raise NotConvergedError("Newton's method has not converged")
        return point

    def _solve(
        self, guess: np.ndarray, border: np.ndarray, inverse: np.ndarray | None, reached: float
    ) -> Solution:
        y, least, fresh_least = guess, np.inf, np.inf
        for _ in range(STEPS):
            fresh = inverse is None
            if inverse is None:
                misses, _, inverse = self._inverted(y, border)
            else:
                misses = self.residual(y)
            move = _move(misses, y - guess, border, inverse)
            distance = float(np.abs(move).max())
            if fresh:
                if not distance < fresh_least:
                    raise NotConvergedError("moves of Newton's method do not fall")
                least = fresh_least = distance
            elif distance > CONTRACTS * least:
                inverse = None
            if fresh or distance < least:
                y, least = y - move, distance
            if distance <= reached:
                break
        misses, matrices, inverse = self._inverted(y, border)
        move = _move(misses, y - guess, border, inverse)
        if not np.abs(move).max() <= reached:
            raise NotConvergedError(f"Newton's method has not converged in {STEPS} steps")
        tangent = inverse[:, -1] / np.linalg.norm(inverse[:, -1])
        size = float(np.abs(misses).max())
        return Solution(y - move, tangent, TangentMaps(matrices), size, inverse)

    def _inverted(
        self, y: np.ndarray, border: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate G, the tangent maps, and the inverse of the bordered Jacobian."""
        misses, matrices, slopes = self.linearise(y)
        return misses, matrices, np.linalg.inv(self.bordered(matrices, slopes, border))

    def through(self, guess: np.ndarray, tangent: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y of the point by an orbit, across the tangent there; `guess` is on the curve."""
        return self.solve(guess + tangent @ (y - guess) * tangent, tangent).y

    def _solve_keeping(
        self, guess: np.ndarray, border: np.ndarray, near: Solution
    ) -> Solution | None:
        assert near.inverse is not None
        y, least = guess, np.inf
        with contextlib.suppress(ArithmeticError):
            for _ in range(STEPS):
                move = _move(self.residual(y), y - guess, border, near.inverse)
                distance = float(np.abs(move).max())
                if not (distance <= EXACT or distance <= CONTRACTS * least):
                    return near._replace(y=y, signature=None) if least <= ROUNDING else None
                y, least = y - move, distance
                if distance <= EXACT:
                    return near._replace(y=y, signature=None)
        return None


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
    off[:-1], off[-1] = misses, border @ away
    move: np.ndarray = inverse @ off
    if abs(border[-1]) == 1.0:  # at one value, to the last bit, so that it is one solver
        move[-1] = 0.0
    return move


def solve_at(curve: Curve, points: np.ndarray, value: float) -> Solution:
    """Find the orbit near `points`, shape (p, N), at a value of the parameter; see `solve`."""
    y = curve.join(points, value)
    return curve.solve(y, unit(y.size, -1))
