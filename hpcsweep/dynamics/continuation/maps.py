"""What is asked of maps whose orbits are continued, and of curves of such orbits."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from hpcsweep.dynamics.continuation.cycle import Solution


class Map(Protocol):
    """A map with a parameter, or two; points are in units in which they are of order 1."""

    size: int
    """Dimension N."""

    def images(self, points: np.ndarray, value: Any) -> np.ndarray:
        """Return F of each point, shape (p, N); raise `ArithmeticError` where there is none."""
        ...

    def tangents(self, points: np.ndarray, value: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return F and dF/dx of each point, shapes (p, N) and (p, N, N)."""
        ...

    def slopes(self, points: np.ndarray, value: Any, images: np.ndarray, k: int = 0) -> np.ndarray:
        """Return dF/dlambda at each point, whose F is known; of parameter number `k` of two."""
        ...

    def signature(self, points: np.ndarray, value: Any) -> tuple[int, ...]:
        """Count non-smooth events of the map along an orbit, (p, N); () for smooth maps."""
        ...

    def tracer(self, period: int, scale: float, made: Callable[..., "Solution"]) -> Any:
        """Return what finds points of a `Curve` by compiled kernels, None for most maps.

        See `hpcsweep.solvers.flow.orbit.tracer`; `made` makes a point of what that knows of it.
        """
        ...


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
