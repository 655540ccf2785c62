r"""Bound the motions of a structure by their energy, including contacts.

With |.| the norm of the masses, |w|^2 = w . M w, U^2 = u . K u and the potentials W_k of the
contacts, the energy is

    H = |u'|^2 / 2 + U^2 / 2 + sum_k kappa_k W_k,    W_k(x) = int_(-inf)^x S(rho s) s ds + e >= 0,

e = pi^2 / (12 rho^2), at most that of an open contact. Let c_1 and c_2 be the
least and the largest eigenvalue of M^-1 C, omega_1 the lowest frequency, p = |M^-1 b| and G the
sum of |a_h|. Of V = H + eps u' . M u, with eps <= omega_1 / 4,

    3/4 H <= V <= 5/4 H,
    V' = -u' . C u' + A G b . u' + eps (|u'|^2 - u . C u' - U^2 - sum_k kappa_k d_k . u S x_k
                                         + A G b . u).

A contact with gap g_k >= 0 does work (x_k + g_k) S x_k >= W_k - e - 0.28 g_k / rho, since
s S(rho s) is -0.28 / rho at least. The mixed term is below U^2 / 2 + (c_2 / omega_1)^2 |u'|^2 / 2,
so that with eps = c_1 / (2 + (c_2 / omega_1)^2) at most

    V' <= -eps H + a sqrt(H) + eps P,    a = 1.5 |A| G p,
    P = sum_k kappa_k (e + 0.28 g_k / rho).

Where sqrt(H) is above a / eps + sqrt(P), V falls: H stays below 5/3 of the square of that, or of
the initial energy, however the amplitude varies below A.

Dashpots take energy. While a contact pushes with F = kappa x + c x', its terms of V' are

    -c x'^2 - eps (x + g) F <= -eps kappa x^2 / 2 + eps^2 c g^2 / 2    for eps <= kappa / c,

since half of c x'^2 outweighs eps c x x' and half of it eps g c |x'|; the last term, by which P
grows, is needed only where F may pull. Once it has let go x' < -kappa x / c, and the energy of the
spring falls by kappa x |x'| >= eps kappa x^2 / 2. A dashpot without a spring has no bound.

A row d then moves no farther than |d . u| <= sqrt(d . K^-1 d) sqrt(2 H). Without damping, or with
a negative gap, there is no bound.
"""

import math

import numpy as np


def reach_of_motions(structure, amplitude: float, states: np.ndarray) -> np.ndarray:
    """Bound |d_k . u| over all time for every contact k.

    Parameters
    ----------
    structure : Structure
    amplitude : float
        Largest amplitude, of either sign, that drives the motions.
    states : ndarray, shape (m, 2n)
        Initial states, or others with no component nearer to 0.

    Returns
    -------
    ndarray, shape (C,)
        inf where there is no bound.
    """
    directions = structure.directions
    gaps = np.array([contact.gap for contact in structure.contacts])
    mass, stiffness = structure.mass_matrix, structure.stiffness_matrix
    root = np.linalg.cholesky(mass)
    damping = np.linalg.solve(root, np.linalg.solve(root, structure.damping_matrix).T)
    drags = np.linalg.eigvalsh(damping)
    least, most, lowest = float(drags[0]), float(drags[-1]), float(structure.frequencies[0])
    nothing = np.full(len(gaps), math.inf)
    kappa, rho = structure.contact_stiffness, structure.sharpness
    drag = structure.contact_damping
    if not least > 0 or np.any(gaps < 0) or rho**2 == 0 or np.any((drag > 0) & (kappa == 0)):
        return nothing
    eps = min(least / (2.0 + (most / lowest) ** 2), lowest / 4.0)
    has = drag > 0
    eps = min(eps, float((kappa[has] / drag[has]).min(initial=eps)))
    push = np.linalg.norm(np.linalg.solve(root, structure.forcing_vector))
    a = 1.5 * abs(amplitude) * structure.forcing.size * push
    open_energy = math.pi**2 / (12.0 * rho**2)
    pulls = np.array([contact.tension for contact in structure.contacts], bool)
    held = float(kappa @ (open_energy + 0.28 * gaps / rho))
    held = math.sqrt(held + 0.5 * eps * float((drag * pulls) @ gaps**2))
    n = structure.n_floors
    states = np.abs(np.asarray(states, float).reshape(-1, 2 * n))
    u, v = states[:, :n], states[:, n:]
    beyond = np.maximum(u @ np.abs(directions).T - gaps, 0.0)
    energy = 0.5 * np.einsum("si,ij,sj->s", v, np.abs(mass), v)
    energy += 0.5 * np.einsum("si,ij,sj->s", u, np.abs(stiffness), u)
    energy += (0.5 * beyond**2 + 2.0 * open_energy) @ kappa
    with np.errstate(over="ignore"):
        largest = 5.0 / 3.0 * max((a / eps + held) ** 2, float(energy.max(initial=0.0)))
        soft = np.einsum("ki,ki->k", directions, np.linalg.solve(stiffness, directions.T).T)
        bound = np.sqrt(soft) * math.sqrt(2.0 * largest)
    return np.where(np.isfinite(bound), bound, nothing)
