"""The uniform building, written down independently of the package."""

import numpy as np


def generator(structure, key, omega):
    """Return M of its linear motion x' = M x with the floors of `key` at their stops, one harmonic.

    x = (u, u', A sin, A cos, 1), shape (2n + 3,).
    """
    n = structure.n_floors
    pushing = structure.stiffness_ratio * np.array([key >> i & 1 for i in range(n)], float)
    matrix = np.zeros((2 * n + 3, 2 * n + 3))
    matrix[:n, n : 2 * n] = np.eye(n)
    matrix[n : 2 * n, :n] = -structure.stiffness_matrix - np.diag(pushing)
    matrix[n : 2 * n, n : 2 * n] = -structure.damping_matrix
    matrix[n : 2 * n, 2 * n] = -1.0
    matrix[n : 2 * n, -1] = pushing
    matrix[2 * n, 2 * n + 1], matrix[2 * n + 1, 2 * n] = omega, -omega
    return matrix
