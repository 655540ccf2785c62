"""Likelihood of a fragility, of stripes and of known capacities; see `earthquakes.fragility`."""

import math

import numpy as np
from scipy.special import log_ndtr

ITERATIONS = 200
"""Of Newton's method, with halved steps; some ten are needed."""
CONVERGED = 1e-12
"""Change of l that ends it, relative to the number of records."""


class Likelihood:
    """Likelihood of stripes and of known capacities as a function of b_0 and b_1."""

    def __init__(self, log_x: np.ndarray, k: np.ndarray, n: np.ndarray, capacities=()):
        self.rows, self.known = (
            np.stack([np.ones(len(p)), p], axis=1) for p in (log_x, np.asarray(capacities, float))
        )
        self.k, self.n = k, n

    def value(self, b: np.ndarray) -> float:
        """Return the logarithm of the likelihood, up to a constant."""
        h = self.rows @ b
        total = float(self.k @ log_ndtr(h) + (self.n - self.k) @ log_ndtr(-h))
        if len(self.known):
            if not b[1] > 0:
                return -math.inf
            total += len(self.known) * math.log(b[1]) - 0.5 * float(np.sum((self.known @ b) ** 2))
        return total

    def expected(self, b: np.ndarray) -> np.ndarray:
        """Return Fisher's expected information of the stripes, shape (2, 2)."""
        h = self.rows @ b
        weight = self.n * np.exp(-h * h - math.log(2.0 * math.pi) - log_ndtr(h) - log_ndtr(-h))
        return (self.rows.T * weight) @ self.rows

    def slopes(self, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the gradient, shape (2,), and the observed information, shape (2, 2)."""
        h = self.rows @ b
        # d ln Phi = m, its derivative -m (h + m)
        up = np.exp(-0.5 * h * h - 0.5 * math.log(2.0 * math.pi) - log_ndtr(h))
        down = np.exp(-0.5 * h * h - 0.5 * math.log(2.0 * math.pi) - log_ndtr(-h))
        slope = self.rows.T @ (self.k * up - (self.n - self.k) * down)
        curve = self.k * up * (h + up) + (self.n - self.k) * down * (down - h)
        curves = (self.rows.T * curve) @ self.rows
        if len(self.known):
            slope += np.array([0.0, len(self.known) / b[1]]) - self.known.T @ (self.known @ b)
            curves += np.diag([0.0, len(self.known) / b[1] ** 2]) + self.known.T @ self.known
        return slope, curves

    def largest(
        self, start: np.ndarray, along: np.ndarray, at: np.ndarray | None = None
    ) -> np.ndarray:
        """Maximise over b = start + t along, `along` of shape (1 or 2, 2), from t = `at`."""
        t = np.zeros(len(along)) if at is None else np.array(at, float)
        value = self.value(start + t @ along)
        for _ in range(ITERATIONS):
            slope, curves = self.slopes(start + t @ along)
            move = np.linalg.lstsq(along @ curves @ along.T, along @ slope, rcond=None)[0]
            part = 1.0
            while (better := self.value(start + (t + part * move) @ along)) < value:
                part *= 0.5
                if part < 1e-10:
                    return start + t @ along
            t = t + part * move
            gained, value = better - value, better
            if gained <= CONVERGED * (float(self.n.sum()) + len(self.known)):
                break
        return start + t @ along
