"""Constants of a step by the forces of contacts in their layers (`layer.volterra`)."""

import numpy as np

from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.solvers.flow.rules import tableau

N_NODES = 2 * LANES
N_POWERS = 3 * LANES
"""Terms of the motion of a mode over a step of at most 2 over its rate: 2^24 / 24! = 3e-17."""


def _rule() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return nodes and weights, and the barycentric weights of interpolation."""
    x, w = np.polynomial.legendre.leggauss(N_NODES)
    # of Gauss-Legendre nodes: Wang and Xiang, Math. Comp. 81 (2012) 861
    barycentric = (-1.0) ** np.arange(N_NODES) * np.sqrt((1.0 - x * x) * w)
    return 0.5 * (x + 1.0), 0.5 * w, barycentric


def _lagrange(times) -> np.ndarray:
    """Evaluate the Lagrange polynomials of the nodes at times (any,), none a node.

    Returns
    -------
    ndarray, shape (any, N_NODES)
    """
    shares = BARYCENTRIC / (np.asarray(times)[..., None] - NODES)
    return shares / shares.sum(axis=-1, keepdims=True)


def _responses(times, n_powers: int) -> np.ndarray:
    """Integrate (t - s)^m l_k(s) from 0 to some times t.

    Returns
    -------
    ndarray, shape (n_powers, N_NODES, times.size)
        By m, k and t.
    """
    found = np.empty((n_powers, N_NODES, len(times)))
    for q, t in enumerate(times):
        for m in range(n_powers):
            found[m, :, q] = (t * WEIGHTS * (t - t * NODES) ** m) @ _lagrange(t * NODES)
    return found


NODES, WEIGHTS, BARYCENTRIC = _rule()
AT_START, AT_END = _lagrange([0.0, 1.0])
"""(N_NODES,) each: factors with which values at the nodes are extrapolated to the ends."""
PARTS = [(part, count) for count in (1, 2, 4) for part in range(count)]
"""Of a step: itself, its halves and its quarters; that of count c begin at c - 1."""
N_PARTS = len(PARTS)
PART_NODES = np.stack([(part + tableau.NODES) / count for part, count in PARTS])
PART_RESPONSES = np.stack([_responses(times, N_POWERS) for times in PART_NODES])
"""By part, m, k and the nodes of `tableau` in it."""
NODE_RESPONSES = _responses(NODES, N_POWERS)
