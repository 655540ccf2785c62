r"""Follow a special point of orbits, or where a measure of theirs is given, over two parameters.

The orbits of period p over two parameters are a surface in p N + 2 dimensions, with y = (X,
lambda_1 / scale_1, lambda_2 / scale_2). A hyperplane, across . (y - at) = 0, cuts it in a curve, a
`Slice`, which is like a branch: special points of a kind are sought on it as they are on a branch,
where a function of the orbit vanishes or its signature changes (`events`). So no second derivative
of the map is needed, and at a grazing there is none. Where lambda_2 changes along the locus the
hyperplane is that of one lambda_2: if that is the frequency of a structure, a point needs few
solvers. Elsewhere it is across the locus, so that turning points and cusps are passed.

A step goes along the tangent, as on a branch, and is corrected across it. The tangent is the
direction of a second point of the locus, at `APART` of the step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from hpcsweep.dynamics.continuation.branch import on_cubic
from hpcsweep.dynamics.continuation.cycle import Curve, NotConvergedError, Solution, unit
from hpcsweep.dynamics.continuation.events import PRECISION, Kind, locate, locate_change

STEEP, FLAT = 0.005, 0.0005
"""Component along lambda_2 from which points are sought at one lambda_2: of a tangent's part in the
plane of the parameters, of length 1, and of the whole tangent. The first ends it where a curve
turns back in lambda_2, the second at a cusp. In Figure 6 a point at one frequency takes 4 to 11 ms,
one across such a curve 12 to 90: each of its moves needs a solver."""
WIDTHS = (1e-4, 2e-3, 0.02, 0.2, 2.0, 20.0)
"""Shares of a step to either side of a guess within which the locus is sought, as they are tried.
A step is refused where more than `branch.ASTRAY` was needed."""
APART, MIN_APART = 1e-4, 1e-6
"""Distance of the point that gives the tangent: share of the step, and the least, in units of y."""
OF_TANGENT = 1e-4
"""Share of that distance to which the second point is known: the error of the tangent."""
SECANTS = 8
"""Most moves of the secant method, of which the last one is at most `PRECISION`. It takes 6 points
of a slice where Brent's method between two sides takes 15."""
FIRST = 1e-3
"""Distance that counts as the step to the first point, in units of y."""


@dataclass(frozen=True, eq=False)
class Slice(Curve):
    """The curve of the orbits of one period on a hyperplane, over two parameters.

    Attributes
    ----------
    map : Map
        Its value is a pair.
    period : int
    scale : ndarray, shape (2,)
    across, at : ndarray, shape (p N + 2,)
        The hyperplane across . (y - at) = 0.
    """

    across: np.ndarray
    at: np.ndarray

    @property
    def is_fixed(self) -> bool:
        """Whether the hyperplane is that of one lambda_2."""
        return abs(self.across[-1]) == 1.0

    def split(self, y: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
        """Return the points of y, shape (p, N), and the values of the parameters."""
        points, (first, second) = super().split(y)
        if self.is_fixed:  # to the last bit, so that it is one solver
            second = float(self.at[-1] * self.scale[1])
        return points, (first, second)

    def misses(self, images: np.ndarray, points: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return G and the distance from the hyperplane, shape (p N + 1,)."""
        return np.append(super().misses(images, points, y), self.across @ (y - self.at))

    @property
    def varied(self) -> int:
        """1 where no step goes along a fixed lambda_2, otherwise 2."""
        return 1 if self.is_fixed else 2

    def bordered(self, matrices: np.ndarray, slopes: np.ndarray, border: np.ndarray) -> np.ndarray:
        """Return the Jacobian of the misses, and `border` below it, shape (p N + 2, p N + 2)."""
        both = np.zeros((*slopes.shape[:2], 2))
        both[..., : self.varied] = slopes
        whole = super().bordered(matrices, both, border)
        whole[-2] = self.across
        return whole


@dataclass(frozen=True, eq=False)
class Locus(Curve):
    """The curve over two parameters on which a special point lies.

    Attributes
    ----------
    map : Map
        Its value is a pair.
    period : int
    scale : ndarray, shape (2,)
    spans : ((float, float), (float, float))
        Of both parameters.
    kind : Kind or None
        None where `side` is given.
    change : tuple of int
        Of a grazing: of the signature, along or against the normal.
    side : callable, optional
        Function of the points of an orbit, shape (p, N), and of the values that vanishes on it.
    """

    spans: tuple[tuple[float, float], tuple[float, float]]
    kind: Kind | None
    change: tuple[int, ...] = ()
    side: Callable[[np.ndarray, tuple[float, float]], float] | None = None

    def start(self, points: np.ndarray, values: tuple[float, float]) -> Solution:
        """Find the point of the locus near an orbit, shape (p, N).

        It is sought at the same lambda_2, or, where the locus keeps that, at the same lambda_1.

        Raises
        ------
        NotConvergedError
            If there is none.
        """
        return self._near(self.join(points, values))

    def through(self, guess: np.ndarray, _tangent: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return y of the point near `guess`, with the lambda_2 of an orbit."""
        return np.append(self._near(np.append(guess[:-1], y[-1])).y[:-1], y[-1])

    def _near(self, y: np.ndarray) -> Solution:
        try:
            return self._start(y, unit(y.size, -1))
        except NotConvergedError:
            return self._start(y, unit(y.size, -2))

    def _start(self, y: np.ndarray, across: np.ndarray) -> Solution:
        cut = Slice(self.map, self.period, self.scale, across, y)
        try:
            _, matrices, slopes = cut.linearise(y)
        except ArithmeticError as error:
            raise NotConvergedError(str(error)) from None
        # the direction of the branch: the null vector of the other rows
        normal = np.linalg.svd(cut.bordered(matrices, slopes, across)[:-1])[2][-1]
        at = self._cross(y, normal, across, None, FIRST)
        return self._with_tangent(at, across, across, FIRST, across)

    def solve(self, guess, border, near=None, reached=0.0, keeps=False) -> Solution:
        """Find the point of the locus near a guess, to its own `PRECISION` whatever was reached.

        Parameters
        ----------
        guess, border : ndarray, shape (p N + 2,)
            Near the tangent, which is returned pointing along it.
        near : Solution
            A point of the locus, with its inverse.
        """
        steep = abs(border[-1]) >= max(STEEP * math.hypot(*border[-2:]), FLAT)
        across = unit(border.size, -1) if steep else border / np.linalg.norm(border)
        step = max(float(np.linalg.norm(guess - near.y)), MIN_APART)
        point = self._cross(guess, near.inverse[:, -1], across, near, step)
        chord, way = point.y - near.y, near.tangent
        if np.linalg.norm(chord) > MIN_APART:  # that of a circle through both points
            way = 2.0 * (chord @ way) / (chord @ chord) * chord - way
        way = way if way @ border > 0 else -way
        return self._with_tangent(point, border, across, step, way)

    def clipped(self, last: Solution, point: Solution) -> tuple[Solution, str]:
        """Return the point where a step leaves the spans, and that it does; else the step's."""
        values = self.split(point.y)[1]
        for k, (low, high) in enumerate(self.spans):
            if not low <= values[k] <= high:
                border = (low if values[k] < low else high) / self.scale[k]
                component = k - 2
                guess, _ = on_cubic(last, point, component, border)
                guess[component] = border
                assert point.inverse is not None
                across = unit(guess.size, component)
                step = float(np.linalg.norm(point.y - last.y))
                at = self._cross(guess, point.inverse[:, -1], across, point, step)
                at.y[component] = border
                return at._replace(tangent=point.tangent), "end of the span"
        return point, ""

    def _with_tangent(
        self, at: Solution, border: np.ndarray, across: np.ndarray, step: float, way: np.ndarray
    ) -> Solution:
        """Return a point with its tangent, which is near `way` and points along `border`."""
        apart = max(APART * step, MIN_APART)
        assert at.inverse is not None
        guess = at.y + apart * way
        other = self._cross(guess, at.inverse[:, -1], across, at, apart, OF_TANGENT)
        away = other.y - at.y
        tangent = away / np.linalg.norm(away)
        return at._replace(tangent=tangent if tangent @ border > 0 else -tangent)

    def _cross(
        self,
        guess: np.ndarray,
        normal: np.ndarray,
        across: np.ndarray,
        near: Solution | None,
        step: float,
        rough: float = 0.0,
    ) -> Solution:
        """Find the point of the locus near a guess, on the hyperplane through it.

        It is sought along `normal`, the direction of the slice, to both sides; to the share `rough`
        of a step if that is given.
        """
        cut = Slice(self.map, self.period, self.scale, across, guess)
        normal = normal - (across @ normal) * across
        normal = normal / np.linalg.norm(normal)
        centre = cut.solve(guess, normal, near)
        point = None if self.kind is Kind.GRAZING else self._secant(cut, centre, step, rough)
        for share in WIDTHS if point is None else ():
            low, high = (
                cut.solve(centre.y + way * share * step * centre.tangent, centre.tangent, centre)
                for way in (-1.0, 1.0)
            )
            point = self._between(cut, low, high, centre if share <= rough else None)
            if point is not None:
                break
        if point is None:
            raise NotConvergedError("the locus is not near")
        if cut.is_fixed:
            point.y[-1] = guess[-1]
        return point

    def _secant(self, cut: Slice, centre: Solution, step: float, rough: float) -> Solution | None:
        """Find the point of the locus on a slice by the secant method, None if it fails."""
        place = WIDTHS[0] * step
        point = cut.solve(centre.y + place * centre.tangent, centre.tangent, centre)
        move, before = place, self._side(cut, centre)
        for _ in range(SECANTS):
            value = self._side(cut, point)
            if value == before:
                break
            move, before = -value * move / (value - before), value
            place += move
            if not abs(place) <= WIDTHS[-1] * step:
                break
            if abs(move) <= rough * step:
                return point._replace(y=point.y + move * point.tangent)
            point = cut.solve(centre.y + place * centre.tangent, centre.tangent, point)
            if abs(move) <= PRECISION:
                return point
        return None

    def _side(self, cut: Slice, point: Solution) -> float:
        """Evaluate the function that vanishes on the locus."""
        if self.side:
            return self.side(*cut.split(point.y))
        assert self.kind
        return getattr(point.tests, self.kind.name.lower())

    def _between(
        self, cut: Slice, low: Solution, high: Solution, middle: Solution | None
    ) -> Solution | None:
        """Return the point of the locus between two of a slice, None if there is none.

        The one in the middle if that is near enough.
        """
        precision = PRECISION / min(1.0, float(np.linalg.norm(high.y - low.y)))
        if self.kind is Kind.GRAZING:

            def counted(point: Solution) -> tuple[int, ...]:  # of the contacts that graze
                whole = self.map.signature(*cut.split(point.y))
                return tuple(n for n, c in zip(whole, self.change, strict=True) if c)

            graze = np.array([c for c in self.change if c])
            before, after = counted(low), counted(high)
            change = np.subtract(after, before)
            if not (np.array_equal(change, graze) or np.array_equal(change, -graze)):
                return None
            if middle is not None:
                return middle
            return locate_change(cut, low, high, counted, 0.0, before, precision)[0]

        side = partial(self._side, cut)
        if (side(low) < 0) == (side(high) < 0):
            return None
        return middle or locate(cut, low, high, side, precision)[0]
