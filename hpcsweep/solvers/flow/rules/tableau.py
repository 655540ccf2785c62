"""Constants of Gauss collocation and of the rule that checks it; see `scheme`.

Gauss rules of weights given by values, such as a force inside its layer.
"""

import numpy as np
from numpy.polynomial import chebyshev, legendre

from hpcsweep.kernels.simd.vectors import LANES


def recurrence(y: np.ndarray, measure: np.ndarray, n_nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the recurrence of the orthogonal polynomials of a discrete measure.

    By the procedure of Stieltjes: p_(k+1) = (y - alpha_k) p_k - beta_k p_(k-1).

    Parameters
    ----------
    y, measure : ndarray, shape (k,)
        Places, and the measure of each.
    n_nodes : int

    Returns
    -------
    alpha, beta : ndarray, shape (n_nodes,)
        beta_0 is the whole measure.
    """
    alpha, beta = np.zeros(n_nodes), np.zeros(n_nodes)
    previous, current = np.zeros_like(y), np.ones_like(y)
    norm_before = 1.0
    for k in range(n_nodes):
        norm = np.sum(measure * current**2)
        alpha[k] = np.sum(measure * y * current**2) / norm
        beta[k] = norm / norm_before if k else norm
        following = (y - alpha[k]) * current - (beta[k] if k else 0.0) * previous
        previous, current, norm_before = current, following, norm
    return alpha, beta


def rule(alpha: np.ndarray, beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights, from the eigenvalues and eigenvectors of the Jacobi matrix.

    Golub and Welsch, Math. Comp. 23 (1969) 221.
    """
    off = np.sqrt(beta[1:])
    nodes, vectors = np.linalg.eigh(np.diag(alpha) + np.diag(off, 1) + np.diag(off, -1))
    return nodes, beta[0] * vectors[0] ** 2


N_STAGES = LANES


def _collocation():
    """Return Gauss nodes and weights on [0, 1], A, A^2 and the Legendre transform."""
    x, w = legendre.leggauss(N_STAGES)
    transform = (np.arange(N_STAGES)[:, None] + 0.5) * legendre.legvander(x, N_STAGES - 1).T * w
    stages = _integrals(x, 1) @ transform
    return 0.5 * (x + 1.0), 0.5 * w, stages, stages @ stages, transform


def _integrals(x, times):
    """Integrate the Legendre polynomials of 2 s - 1 from s = 0 to (x + 1) / 2, `times` times.

    Returns
    -------
    ndarray, shape (x.size, N_STAGES)
    """
    columns = np.empty((x.size, N_STAGES))
    for k in range(N_STAGES):
        series = legendre.legint(np.eye(N_STAGES)[k], times, lbnd=-1)
        columns[:, k] = 0.5**times * legendre.legval(x, series)
    return columns


def _kronrod_nodes():
    """Return the zeros of the Stieltjes polynomial E_(N+1): orthogonal with P_N to lower degrees.

    Returns
    -------
    ndarray, shape (N_STAGES + 1,)
    """
    x, w = legendre.leggauss(2 * N_STAGES + 2)
    values = legendre.legvander(x, N_STAGES + 1)
    weighted = (w * values[:, N_STAGES])[:, None] * values[:, :-1]
    series, *_ = np.linalg.lstsq(
        weighted.T @ values[:, :-1], -weighted.T @ values[:, -1], rcond=None
    )
    return np.sort(legendre.legroots(np.append(series, 1.0)).real)


def _check():
    """Return the rule that checks the Gauss rule.

    Returns
    -------
    nodes : ndarray, shape (N_STAGES,)
        On [0, 1], beside the Gauss nodes and 0.
    rows : ndarray, shape (N_STAGES, N_STAGES)
        Row k: contribution of G_k to the displacements at these nodes, over h^2 G_k.
    gauss, added, start : ndarray, ndarray, float
        Weights of the difference of both rules.
    """
    x, w = legendre.leggauss(N_STAGES)
    new = _kronrod_nodes()[1:]
    nodes = np.concatenate((x, new, [-1.0]))
    moments = np.zeros(nodes.size)
    moments[0] = 1.0
    weights = np.linalg.solve(legendre.legvander(nodes, nodes.size - 1).T, moments)
    rows = _integrals(new, 2) @ LEGENDRE
    return (
        0.5 * (new + 1.0),
        np.ascontiguousarray(rows.T),
        weights[:N_STAGES] - 0.5 * w,
        weights[N_STAGES:-1],
        float(weights[-1]),
    )


def _stage_polynomials():
    """Return the polynomials of a step by its stages.

    Velocities at the Gauss nodes and their slopes have one polynomial of degree 2 N_STAGES - 1; its
    integral, without the last term, is that of the displacement.

    Returns
    -------
    ndarray, shape (2, 2 N_STAGES, 2 N_STAGES)
        Of displacement and h times the velocity, less u_0 + h v_0 s and h v_0: per h (V_j - v_0)
        and per h^2 G_j the coefficients in sigma = 2 s / h - 1, ascending.
    """
    x, last = legendre.leggauss(N_STAGES)[0], 2 * N_STAGES - 1
    slopes = [chebyshev.chebval(x, 2.0 * chebyshev.chebder(row)) for row in np.eye(last + 1)]
    series = np.linalg.inv(np.vstack((chebyshev.chebvander(x, last), np.transpose(slopes))))
    ways = 0.5 * chebyshev.chebint(series[:last], lbnd=-1, axis=0)
    powers = [np.pad(chebyshev.cheb2poly(row), (0, last))[: last + 1] for row in np.eye(last + 1)]
    return np.stack([np.transpose(powers) @ rows for rows in (ways, series)]).transpose(0, 2, 1)


NODES, WEIGHTS, STAGES, STAGES_SQUARED, LEGENDRE = _collocation()
STAGE_POLYNOMIALS = np.ascontiguousarray(_stage_polynomials())
SPEED_ROWS = np.ascontiguousarray(STAGES.T)
POSITION_ROWS = np.ascontiguousarray(STAGES_SQUARED.T)
POSITION_WEIGHTS = WEIGHTS @ STAGES
"""b^T A: u_1 = u_0 + h v_0 + h^2 sum_k (b^T A)_k G_k."""
CHECK_NODES, CHECK_ROWS, CHECK_GAUSS, CHECK_ADDED, CHECK_START = _check()
GAUSS_SLOPE, ADDED_SLOPE = 2.0 * NODES - 1.0, 2.0 * CHECK_NODES - 1.0
