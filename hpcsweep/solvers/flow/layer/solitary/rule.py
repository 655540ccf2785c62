"""Constants of a step with one contact in its layer (`solitary`): its Gauss nodes on [0, 1]."""

import numpy as np

from hpcsweep.kernels.vectors import LANES
from hpcsweep.solvers.flow.layer import tableau

N_NODES = 2 * LANES


def _ends(nodes: np.ndarray, barycentric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give the factors with which values at the nodes are extrapolated to 0 and to 1."""
    rows = []
    for end in (0.0, 1.0):
        shares = barycentric / (end - nodes)
        rows.append(shares / shares.sum())
    return rows[0], rows[1]


def _rule():
    x, w = np.polynomial.legendre.leggauss(N_NODES)
    # of Gauss-Legendre nodes: Wang and Xiang, Math. Comp. 81 (2012) 861
    barycentric = (-1.0) ** np.arange(N_NODES) * np.sqrt((1.0 - x * x) * w)
    nodes = 0.5 * (x + 1.0)
    return nodes, 0.5 * w, barycentric, *_ends(nodes, barycentric)


def _responses():
    """Integrate (t - s)^m l_k(s) from 0 to the nodes t of `tableau`.

    Returns
    -------
    ndarray, shape (LANES, N_NODES, N_STAGES)
        By m, k and t.
    """
    found = np.empty((LANES, N_NODES, tableau.N_STAGES))
    for q, (t, lagrange) in enumerate(zip(tableau.NODES, _lagrange(tableau.NODES), strict=True)):
        for m in range(LANES):
            found[m, :, q] = (t * WEIGHTS * (t - t * NODES) ** m) @ lagrange
    return found


def _lagrange(times) -> np.ndarray:
    """Evaluate the Lagrange polynomials at t times each node, for each of some times.

    Returns
    -------
    ndarray, shape (times, N_NODES, N_NODES)
        By time, node and polynomial.
    """
    shares = BARYCENTRIC / (np.multiply.outer(times, NODES)[:, :, None] - NODES)
    return shares / shares.sum(axis=2, keepdims=True)


NODES, WEIGHTS, BARYCENTRIC, AT_START, AT_END = _rule()
LAGRANGE = _lagrange(NODES)
RESPONSES = _responses()
