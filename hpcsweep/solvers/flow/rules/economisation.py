"""Lower the degree of polynomials by Chebyshev economisation."""

import math

import numpy as np


def economisation(taylor: int, degree: int) -> np.ndarray:
    """Return the map of monomial coefficients up to x^taylor on [-1, 1] to degree + 1 ones.

    x^k = 2^(1-k) sum_j binomial(k, j) T_(k-2j)(x), the term T_0 halved; terms above T_degree are
    dropped. All numbers are integers over 2^(taylor-1); a double holds them up to taylor = 30.

    Returns
    -------
    ndarray, shape (taylor + 1, degree + 1)
    """
    chebyshev = np.zeros((degree + 1, degree + 1))  # column d: coefficients of T_d
    chebyshev[0, 0] = chebyshev[1, 1] = 1.0
    for d in range(2, degree + 1):
        chebyshev[1:, d] = 2.0 * chebyshev[:-1, d - 1]
        chebyshev[:, d] -= chebyshev[:, d - 2]
    parts = np.zeros((degree + 1, taylor + 1))
    for k in range(taylor + 1):
        for j in range(k // 2 + 1):
            if k - 2 * j <= degree:
                half = 0.5 if k == 2 * j else 1.0
                parts[k - 2 * j, k] = half * math.comb(k, j) * 2.0 ** (1 - k)
    return np.ascontiguousarray((chebyshev @ parts).T)
