r"""Static equilibrium of a structure with its contacts, the ground at rest.

The displacements u at which all forces balance,

    r(u) = K u + sum_k d_k F_k(x_k) = 0,    x_k = d_k . u - g_k,    F_k = kappa_k S(rho x_k) x_k,

are where the potential u . K u / 2 + sum_k kappa_k W_k(x_k), W_k' = S x, is least. With sharp stops
W is max(x, 0)^2 / 2: the potential is convex, strictly as K > 0, so that there is one equilibrium,
at which the contacts that are closed are found with it. Dashpots exert no force at rest.

Newton's method solves r = 0 with K + sum_k kappa_k (S x)' d_k d_k^T. It descends, since that
matrix is positive definite ((S x)' is negative, -0.1 at least, only where a smooth stop is nearly
open, and taken as 0 if the matrix is not), and a step that would go beyond the least value along
its line ends there. Between sharp stops r is linear: the first step that leaves the set of the
closed contacts as it is ends at the solution. From there smooth ones are solved, whose equilibrium
is the one beside it.

Where K is singular what no spring and no closed contact opposes stays where it is: along these
motions N there is no force either, and Newton's matrix has a spring along each of them.

Contacts with g_k < 0 are *pressed*. Where there is none rest is u = 0, as a job says: that smooth
stops pull before they are reached is not taken for a state of rest.
"""

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.special import expit

from hpcsweep.model.linear_dynamics import ROUNDED

MAX_STEPS = 200
SAME = 1e-15
"""Relative size of the last step."""


def pressed(structure) -> np.ndarray:
    """Return which contacts are pressed, shape (m,) of bool."""
    return (structure.gaps < 0.0) & (structure.contact_stiffness > 0.0)


def static_equilibrium(
    structure, plastic: np.ndarray | None = None, share: np.ndarray | None = None
) -> np.ndarray:
    """Return the displacements at which a structure rests on its contacts, shape (n,).

    Exactly 0 if no contact is pressed and no slider has slipped.

    Parameters
    ----------
    structure : Structure
    plastic : ndarray, shape (L,), optional
        Lasting elongations p of the sliders, which stick: the loads k p.
    share : ndarray, shape (L,), optional
        Part of k that each of these still has; the result is NaN where K is then not definite.

    Raises
    ------
    ArithmeticError
        If it is not found.
    """
    load = np.zeros(structure.n_floors)
    stiffness, held = structure.stiffness_matrix, structure.held_stiffness
    if plastic is not None and share is not None:
        spring = np.array([slider.stiffness for slider in structure.sliders])
        load = (spring * share * plastic) @ structure.slider_directions
        if (share != 1.0).any():
            less = structure.of_sliders(spring * (1.0 - share))
            stiffness, held = stiffness - less, held - less
            if np.linalg.eigvalsh(held)[0] <= ROUNDED * np.trace(structure.stiffness_matrix):
                return np.full(structure.n_floors, np.nan)
    u = np.linalg.solve(held, load) if load.any() else load
    is_closed = structure.directions @ u > np.maximum(structure.gaps, 0.0)
    if not pressed(structure).any() and not is_closed.any():
        return u
    for rho in dict.fromkeys((np.inf, structure.sharpness)):
        u = _solved(structure, stiffness, rho, u, load)
    return u


def _solved(structure, stiffness, rho: float, u: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Solve r = 0 for contacts of sharpness rho, from u on."""
    from scipy.optimize import brentq  # takes 0.2 s to load, and few contacts are pressed

    rows = structure.directions
    kappa, gaps = structure.contact_stiffness, structure.gaps

    def law(u):
        """Return S x and its derivative."""
        x = rows @ u - gaps
        if np.isinf(rho):
            return np.maximum(x, 0.0), (x > 0.0).astype(float)
        s = expit(rho * x)
        return s * x, s * (1.0 + rho * x * (1.0 - s))

    def residual(u):
        return stiffness @ u - load + rows.T @ (kappa * law(u)[0])

    for _ in range(MAX_STEPS):
        stiff = kappa * law(u)[1]
        held = stiffness + _springs(structure, rows[(stiff > 0.0) & (rows @ u >= gaps)])
        step = _descent(held, rows, stiff, residual(u))
        share = 1.0
        if step @ residual(u + step) > 0.0 > step @ residual(u):
            share = brentq(lambda t, u=u, step=step: step @ residual(u + t * step), 0.0, 1.0)
        u = u + share * step
        small = np.abs(step).max() <= SAME * np.abs(u).max()
        if small or (np.isinf(rho) and share == 1.0 and np.array_equal(stiff, kappa * law(u)[1])):
            return u
    if np.abs(step).max() <= 1e-12 * np.abs(u).max():
        return u
    raise ArithmeticError("no static equilibrium of the structure with its contacts was found")


def _springs(structure, closed: np.ndarray) -> np.ndarray | float:
    """Return springs along what neither springs nor rows that are closed oppose, (n, n)."""
    n_rigid = structure.n_rigid
    if not n_rigid:
        return 0.0
    _, sizes, ways = np.linalg.svd(closed @ structure.modes[:, :n_rigid])
    free = ways[np.count_nonzero(sizes > ROUNDED * sizes.max(initial=0.0)) :]
    rigid = structure.frequency_unit * free @ structure.modal_transform[:n_rigid]
    return rigid.T @ rigid


def _descent(stiffness, rows, stiff, residual) -> np.ndarray:
    """Return Newton's step; contacts whose stiffness makes K indefinite count as 0."""
    for contact_stiffness in (stiff, np.maximum(stiff, 0.0)):
        try:
            return -cho_solve(cho_factor(stiffness + (rows.T * contact_stiffness) @ rows), residual)
        except LinAlgError:
            continue
    raise ArithmeticError("the stiffness matrix is not positive definite")
