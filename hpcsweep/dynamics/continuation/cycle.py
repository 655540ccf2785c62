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

from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from hpcsweep.dynamics.continuation.maps import Map
from hpcsweep.dynamics.continuation.tangent_maps import TangentMaps
from hpcsweep.solvers.branch_rule import CONTRACTS, EXACT, REACHED, ROUNDING, STEPS

STEEP = 0.2
"""Component of a tangent along the parameter from which points are sought at one value of it."""


class NotConvergedError(ArithmeticError):
    """Raised where Newton's method has found no orbit."""


class Solvable(Protocol):
    """A curve whose points on hyperplanes can be found."""

    def border(self, way: np.ndarray, *tangents: np.ndarray) -> np.ndarray:
        """Return across what a point is sought, between two where the curve goes along `way`."""
        ...

    def solve(
        self, guess: np.ndarray, border: np.ndarray, near: "Solution | None" = None
    ) -> "Solution":
        """Find the point on the hyperplane through `guess` across `border`; see `solve`."""
        ...

    def correct(self, guess: np.ndarray, border: np.ndarray, near: "Solution") -> "Solution":
        """Find it where a neighbour was sought across the same border; see `correct`."""
        ...


class Curve(NamedTuple):
    """The curve of the orbits of one period.

    Attributes
    ----------
    map : Map
    period : int
    scale : float
        Of the parameter: the last component of y is lambda / scale.
    costly : bool
        Whether a new value of the parameter is: then points are sought at one value, where the
        curve is not nearly across the parameter.
    """

    map: Map
    period: int
    scale: float
    costly: bool = False

    def border(self, way: np.ndarray, *tangents: np.ndarray) -> np.ndarray:
        """Return across what a point is sought: a direction of the curve, or the parameter's.

        The latter where a value is costly and `way` and all `tangents` go along the parameter.
        """
        along = [np.sign(way[-1]) * one[-1] for one in (way, *tangents)]
        return _along(way.size, way[-1]) if self.costly and min(along) >= STEEP else way

    def split(self, y: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the points of y, shape (p, N), and the value of the parameter."""
        return y[:-1].reshape(self.period, -1), float(y[-1]) * self.scale

    def join(self, points: np.ndarray, value: float) -> np.ndarray:
        """Return y of points and a value of the parameter."""
        return np.append(points.ravel(), value / self.scale)

    def residual(self, y: np.ndarray) -> np.ndarray:
        """Evaluate G, shape (p N,)."""
        points, value = self.split(y)
        return miss_of(self.map.images(points, value), points)

    def linearise(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate G, the tangent maps, (p, N, N), and dF/dlambda at each point, (p, N)."""
        points, value = self.split(y)
        images, matrices = self.map.tangents(points, value)
        slopes = self.map.slopes(points, value, images)
        return miss_of(images, points), matrices, slopes

    def bordered(self, matrices: np.ndarray, slopes: np.ndarray, border: np.ndarray) -> np.ndarray:
        """Return the Jacobian of G by y, and `border` below it, shape (p N + 1, p N + 1)."""
        size = slopes.size
        whole = np.empty((size + 1, size + 1))
        whole[:size, :size] = jacobian(matrices)
        whole[:size, size] = slopes.ravel() * self.scale
        whole[-1] = border
        return whole

    @property
    def tracer(self) -> Any:
        """What finds the points by compiled kernels, or None; see `Map`."""
        return self.map.tracer(self.period, self.scale, Solution.made)

    def signature(self, point: "Solution") -> tuple[int, ...]:
        """Return the signature of an orbit."""
        if point.signature is not None:
            return point.signature
        return self.map.signature(*self.split(point.y))

    def solve(
        self,
        guess: np.ndarray,
        border: np.ndarray,
        near: "Solution | None" = None,
        reached: float = REACHED,
    ) -> "Solution":
        """Find the point on the hyperplane through `guess` across `border`; see `solve`."""
        tracer = self.tracer
        if tracer is None:
            return solve(self, guess, border, near, reached)
        found = tracer.solve(guess, border, None if near is None else near.inverse, reached)
        if found is None:
            raise NotConvergedError("Newton's method has not converged")
        return found

    def correct(self, guess: np.ndarray, border: np.ndarray, near: "Solution") -> "Solution":
        """Find it where a neighbour was sought across the same border; see `correct`."""
        return correct(self, guess, border, near)


def _along(size: int, sign: float) -> np.ndarray:
    """Return the direction of the parameter in which it grows, or falls."""
    unit = np.zeros(size)
    unit[-1] = np.copysign(1.0, sign)
    return unit


def continued(map_: Map, points: np.ndarray, value: Any, period: int) -> np.ndarray:
    """Return the first points of an orbit, shape (k, N), and the images of the last, (p, N)."""
    found = list(points)
    while len(found) < period:
        found.append(map_.images(found[-1][None], value)[0])
    return np.array(found)


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


def miss_of(images: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return F(x_i) - x_{i+1} of all points; `images` is overwritten."""
    images[:-1] -= points[1:]
    images[-1] -= points[0]
    return images.ravel()


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


def solve(
    curve: Any,
    guess: np.ndarray,
    border: np.ndarray,
    near: Solution | None = None,
    reached: float = REACHED,
) -> Solution:
    """Find the point of a curve on the hyperplane through `guess` across `border`.

    Parameters
    ----------
    curve : Curve
        Or another one with `residual`, `linearise` and `bordered`.
    guess, border : ndarray, shape (p N + 1,)
        The tangent that is returned points along `border`.
    near : Solution, optional
        A point whose Jacobian is used first.
    reached : float
        Largest last move, whose square is about the remaining distance: tangent and multipliers are
        those of its start.

    Raises
    ------
    NotConvergedError
        If Newton's method does not converge, or the map fails on its way.
    """
    try:
        return _solve(curve, guess, border, None if near is None else near.inverse, reached)
    except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
        raise NotConvergedError(str(error)) from None


def _solve(
    curve: Any,
    guess: np.ndarray,
    border: np.ndarray,
    inverse: np.ndarray | None,
    reached: float,
) -> Solution:
    y, least, fresh_least = guess, np.inf, np.inf
    for _ in range(STEPS):
        fresh = inverse is None
        if inverse is None:
            misses, matrices, slopes = curve.linearise(y)
            inverse = np.linalg.inv(curve.bordered(matrices, slopes, border))
        else:
            misses = curve.residual(y)
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
    misses, matrices, slopes = curve.linearise(y)
    inverse = np.linalg.inv(curve.bordered(matrices, slopes, border))
    move = _move(misses, y - guess, border, inverse)
    if not np.abs(move).max() <= reached:
        raise NotConvergedError(f"Newton's method has not converged in {STEPS} steps")
    tangent = inverse[:, -1] / np.linalg.norm(inverse[:, -1])
    size = float(np.abs(misses).max())
    return Solution(y - move, tangent, TangentMaps(matrices), size, inverse)


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


def correct(curve: Any, guess: np.ndarray, border: np.ndarray, near: Solution) -> Solution:
    """Find the point of a curve near another one, which was sought across the same border.

    By moves with the Jacobian of that one, whose tangent, tangent maps and inverse the point keeps;
    by `solve` where these do not contract.
    """
    assert near.inverse is not None
    y, least = guess, np.inf
    try:
        for _ in range(STEPS):
            move = _move(curve.residual(y), y - guess, border, near.inverse)
            distance = float(np.abs(move).max())
            if distance <= EXACT:
                return near._replace(y=y - move, signature=None)
            if not distance <= CONTRACTS * least:
                if least <= ROUNDING:
                    return near._replace(y=y, signature=None)
                break
            y, least = y - move, distance
    except ArithmeticError:
        pass
    return solve(curve, guess, border, near)


def solve_at(curve: Curve, points: np.ndarray, value: float) -> Solution:
    """Find the orbit near `points`, shape (p, N), at a value of the parameter; see `solve`."""
    y = curve.join(points, value)
    return curve.solve(y, _along(y.size, 1.0))
