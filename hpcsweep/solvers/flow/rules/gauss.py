"""Gauss rules of weights given by values, such as a force inside its layer."""

import numpy as np


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
