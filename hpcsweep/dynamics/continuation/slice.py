"""The curve that a hyperplane cuts from the orbits of a period over two parameters; see `locus`."""

from typing import NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import Solution, correct, jacobian, miss_of, solve
from hpcsweep.dynamics.continuation.maps import Map


def split(y: np.ndarray, period: int, scale: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """Return the points of y, shape (p, N), and the values of both parameters."""
    first, second = (y[-2:] * scale).tolist()
    return y[:-2].reshape(period, -1), (first, second)


class Slice(NamedTuple):
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

    map: Map
    period: int
    scale: np.ndarray
    across: np.ndarray
    at: np.ndarray

    @property
    def is_fixed(self) -> bool:
        """Whether the hyperplane is that of one lambda_2."""
        return abs(self.across[-1]) == 1.0

    def split(self, y: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
        """Return the points of y, shape (p, N), and the values of the parameters."""
        points, (first, second) = split(y, self.period, self.scale)
        if self.is_fixed:  # to the last bit, so that it is one solver
            second = float(self.at[-1] * self.scale[1])
        return points, (first, second)

    def border(self, way: np.ndarray, *tangents: np.ndarray) -> np.ndarray:
        """Return across what a point is sought: along the slice."""
        del tangents
        return way

    def residual(self, y: np.ndarray) -> np.ndarray:
        """Evaluate G and the distance from the hyperplane, shape (p N + 1,)."""
        points, value = self.split(y)
        return self._misses(self.map.images(points, value), points, y)

    def linearise(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate the residual, the tangent maps, (p, N, N), and the slopes, (p, N, 2)."""
        points, value = self.split(y)
        images, matrices = self.map.tangents(points, value)
        slopes = np.zeros((*points.shape, 2))
        for k in range(1 if self.is_fixed else 2):  # no step goes along a fixed lambda_2
            slopes[..., k] = self.map.slopes(points, value, images, k)
        return self._misses(images, points, y), matrices, slopes

    def bordered(self, matrices: np.ndarray, slopes: np.ndarray, border: np.ndarray) -> np.ndarray:
        """Return the Jacobian of the residual, and `border` below it, shape (p N + 2, p N + 2)."""
        p, n, _ = slopes.shape
        whole = np.zeros((p * n + 2, p * n + 2))
        whole[: p * n, : p * n] = jacobian(matrices)
        whole[: p * n, -2:] = slopes.reshape(-1, 2) * self.scale
        whole[-2], whole[-1] = self.across, border
        return whole

    def solve(
        self, guess: np.ndarray, border: np.ndarray, near: Solution | None = None
    ) -> Solution:
        """Find the point on the hyperplane through `guess` across `border`; see `cycle.solve`."""
        return solve(self, guess, border, near)

    def correct(self, guess: np.ndarray, border: np.ndarray, near: Solution) -> Solution:
        """Find it where a neighbour was sought across the same border; see `cycle.correct`."""
        return correct(self, guess, border, near)

    def _misses(self, images: np.ndarray, points: np.ndarray, y: np.ndarray) -> np.ndarray:
        misses = np.empty(images.size + 1)
        misses[:-1] = miss_of(images, points)
        misses[-1] = self.across @ (y - self.at)
        return misses
