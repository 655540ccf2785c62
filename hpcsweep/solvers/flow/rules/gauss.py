"""Gauss rules of weights given by values, such as a force inside its layer.

Gauss rule of the weight 1 / (1 + exp(y)) on [0, REACH], and its partial integrals
----------------------------------------------------------------------------------
The weight is that of the force inside a contact layer, y = rho |x| (`slow_passage`).
"""

import math

import numpy as np

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


N_PASSAGE = 2 * LANES
REACH = 26.0
"""The impulse of the force y / (1 + exp(y)) beyond is 2e-10 of all of it."""


def gauss_rule(n_nodes: int):
    """Return the Gauss rule of the weight 1 / (1 + exp(y)) on [0, REACH].

    From a fine discretisation of the weight.

    Returns
    -------
    nodes, weights : ndarray, shape (n_nodes,)
    departing, arriving : ndarray, shape (n_nodes, n_nodes)
        Row j: contribution of a value at node j to the integrals from 0 to each node, and from each
        node to the far end.
    derivative : ndarray, shape (n_nodes,)
        Values at the nodes with which the rule integrates polynomials times the derivative of
        y / (1 + exp(y)) exactly; the error for 1 - y S(y), whose poles are near, would be 3e-9.
    """
    panel, panel_weight = np.polynomial.legendre.leggauss(40)

    def discretised(first: float, last: float):
        half = 0.5 * np.diff(np.linspace(first, last, 61))[:, None]
        middle = np.linspace(first, last, 61)[:-1, None] + half
        y = (middle + half * panel).ravel()
        return y, (half * panel_weight).ravel() / (1.0 + np.exp(y))

    def orthonormal(y):
        values = [np.full_like(y, 1.0 / math.sqrt(beta[0]))]
        before = np.zeros_like(y)
        for k in range(n_nodes - 1):
            following = (y - alpha[k]) * values[k] - (math.sqrt(beta[k]) if k else 0.0) * before
            before = values[k]
            values.append(following / math.sqrt(beta[k + 1]))
        return np.array(values)

    y, measure = discretised(0.0, REACH)
    alpha, beta = recurrence(y, measure, n_nodes)
    nodes, weights = rule(alpha, beta)
    interpolation = weights[:, None] * orthonormal(nodes).T
    departing, arriving = np.empty((n_nodes, n_nodes)), np.empty((n_nodes, n_nodes))
    for i, node in enumerate(nodes):
        at, share = discretised(0.0, node)
        departing[:, i] = interpolation @ (orthonormal(at) @ share)
        at, share = discretised(node, REACH)
        arriving[:, i] = interpolation @ (orthonormal(at) @ share)
    at, share = discretised(0.0, REACH)
    derivative = orthonormal(nodes).T @ (
        orthonormal(at) @ (share * (1.0 - at / (1.0 + np.exp(-at))))
    )
    return nodes, weights, departing, arriving, derivative


NODES, WEIGHTS, DEPARTING, ARRIVING, DERIVATIVE = gauss_rule(N_PASSAGE)
SWITCHED = 1.0 / (1.0 + np.exp(-NODES))
DERIVATIVE_EXCESS = DERIVATIVE - (1.0 - NODES * SWITCHED)
