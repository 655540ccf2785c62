"""What a map whose orbits are continued has."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np


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

    def tracer(self, period: int, scale: float, made: Callable[..., Any]) -> Any:
        """Return what finds points of a `Curve` by compiled kernels, None for most maps.

        See `hpcsweep.solvers.flow.orbit.tracer`; `made` makes a point of what that knows of it.
        """
        ...
