"""The steady state without contact, in closed form, and the proof that it is reached.

Free of contact the modes are uncoupled (12). From a state z the motion is the particular
solution A sum_h Im(U_h exp(i h Omega tau)) plus modal transients whose energy never grows, so that

    d . u(tau) <= A max d . u_1 + sum_j |d . phi_j| a_j,   a_j = sqrt(q_j^2 + (q_j' / omega_j)^2),

u_1 being the particular solution at unit amplitude and q the transient part at 0. If that stays
outside its layer for every contact, contact is impossible. Where a damping matrix couples the modes
their energies are not bounded one by one but together: with E = sum_j omega_j^2 a_j^2 the sum is
replaced by sqrt(d . K^-1 d) sqrt(E), the largest d . u of that energy.
"""

import cmath
import math
from collections.abc import Callable

import numpy as np

from hpcsweep.model.linalg import expm
from hpcsweep.model.modes import trigonometric_maxima, trigonometric_zeros
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation

DECAYED = 0.1
"""Largest transient left after `transient_cycles`, in units of the period tolerance, for which the
closed form is used."""
N_GRADED = 40
"""Panels on either side of a kink of the modal norms, each half as long as the one before."""
N_NODES = 16
"""Gauss-Legendre nodes on each."""


class LinearOrbit:
    """Closed-form period-1 orbit of one structure at one frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    """

    def __init__(self, structure: Structure, omega: float):
        self._structure = structure
        self._omega = omega
        directions = structure.directions
        gaps = np.array([contact.gap for contact in structure.contacts])
        self._levels = gaps - structure.layer_half_width
        try:
            self._orders, self._responses = structure.steady_harmonics(omega)
        except ZeroDivisionError:
            self._responses = None
            return
        self.lyapunov_exponent = _slowest_decay(structure)
        """Of every linear motion: the largest real part of the eigenvalues of the free modes."""
        steady = self._orders, self._responses
        self._largest = [trigonometric_maxima(*steady, sign * directions) for sign in (1.0, -1.0)]
        self._drift = structure.steady_drift(omega)
        self._modal_norm = _mean_modal_norm(
            self._orders, self._responses @ structure.modal_transform.T
        )
        self._decay = _period_maps(structure, 2 * math.pi / omega)
        self._reach = _reach(structure)
        self._powers: dict[tuple[int, int], tuple[np.ndarray, ...]] = {}

    def state(self, amplitude: float) -> np.ndarray:
        """Give the stroboscopic point of the steady state at amplitude A, shape (2n,)."""
        speeds = self._omega * (self._orders @ self._responses.real)
        return amplitude * np.concatenate((self._responses.imag.sum(axis=0), speeds))

    def steady_window(
        self, state: np.ndarray, amplitude: float, transient: int, sampling: int, same: float
    ) -> Observation | None:
        """Give the steady window of the run from `state`, or None if it is not proved linear.

        Parameters
        ----------
        state : ndarray, shape (2n,)
        amplitude : float
        transient, sampling : int
            Forcing periods discarded, and of the window after them.
        same : float
            Distance (gaps, gaps omega_0) between points that count as one.
        """
        if self._responses is None or np.any(self._levels <= 0):
            return None
        away = abs(amplitude) * self._largest[0 if amplitude >= 0 else 1]
        if np.any(away >= self._levels):
            return None
        n = self._structure.n_floors
        phi, omega = self._structure.mode_shapes, self._structure.frequencies
        orbit = self.state(amplitude)
        rest = state - orbit
        transform = self._structure.modal_transform
        q, p = transform @ rest[:n], transform @ rest[n:]
        away = away + self._reach(np.hypot(q, p / omega))
        if not np.all(away < self._levels):
            return None
        left, end = (decay(q, p) for decay in self._decays(transient, sampling))
        units = self._structure.state_units
        if np.abs(phi).max() * np.abs(left / units[[0, -1]]).sum() > DECAYED * same:
            return None
        end_state = orbit + np.concatenate((phi @ end[:, 0], phi @ end[:, 1]))
        return Observation(
            end_state[None, :],
            0,
            abs(amplitude) * self._drift,
            self._modal_norm if amplitude else np.full(n, math.nan),
            Outcome.COMPLETE,
        )

    def _decays(self, transient: int, sampling: int) -> list[Callable]:
        """Give the maps of (q, q') over the transient and to the end; results of shape (n, 2)."""
        found = self._powers.get((transient, sampling))
        if found is None:
            counts = (transient, transient + sampling)
            found = tuple(np.linalg.matrix_power(self._decay, count) for count in counts)
            self._powers[transient, sampling] = found

        def follow(power):
            def decayed(q, p):
                if power.ndim == 3:
                    return (power @ np.stack((q, p), axis=1)[:, :, None])[:, :, 0]
                return (power @ np.concatenate((q, p))).reshape(2, -1).T

            return decayed

        return [follow(power) for power in found]


def _period_maps(structure: Structure, period: float) -> np.ndarray:
    """Give the maps of (q_j, q_j') over a period, (n, 2, 2); of coupled modes one, (2n, 2n)."""
    w, zeta = structure.frequencies, structure.damping_ratios
    if structure.is_modal:
        return np.array(
            [
                expm(period * np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]]))
                for w, zeta in zip(w, zeta, strict=True)
            ]
        )
    zero, drag = np.zeros((w.size, w.size)), structure.modal_damping
    return expm(period * np.block([[zero, np.eye(w.size)], [-np.diag(w**2), -drag]]))


def _reach(structure: Structure) -> Callable[[np.ndarray], np.ndarray]:
    """Make the bound of d . u, for each contact, from the modal amplitudes a_j; see the module."""
    modal = structure.directions @ structure.mode_shapes
    if structure.is_modal:
        return lambda size: np.abs(modal) @ size
    w = structure.frequencies
    softness = np.sqrt(((modal / w) ** 2).sum(axis=1))
    return lambda size: softness * np.linalg.norm(w * size)


def _slowest_decay(structure: Structure) -> float:
    """Largest Re(lambda), lambda^2 + 2 zeta omega lambda + omega^2 = 0, over all modes."""
    if not structure.is_modal:
        return float(np.log(np.abs(np.linalg.eigvals(_period_maps(structure, 1.0)))).max())
    w, zeta = structure.frequencies, structure.damping_ratios
    rates = -zeta * w + w * np.sqrt(np.maximum(zeta**2 - 1.0, 0.0))
    return float(rates.max())


def _mean_modal_norm(orders: np.ndarray, modal: np.ndarray) -> np.ndarray:
    """Average |q_j| / ||q|| (17) over a period of q = sum_h Im(modal_h exp(i h theta)).

    The kinks of |q_j| are its zeros, of one harmonic at theta = -arg(modal_j). Where the largest
    q_j has its kink ||q|| has a dip, as narrow as the other modes are small; panels that shrink
    towards the kinks follow it.
    """
    if modal.shape[1] == 1:
        return np.ones(1)
    length = math.pi
    if orders.size == 1:
        kinks = sorted({(-cmath.phase(value)) % math.pi for value in modal[0]})
    else:
        length = 2 * math.pi
        kinks = sorted({zero for column in modal.T for zero in trigonometric_zeros(orders, column)})
        kinks = kinks or [0.0]
    edges = np.array([*kinks, kinks[0] + length])
    nodes, weights = np.polynomial.legendre.leggauss(N_NODES)
    grade = np.concatenate(([0.0], 0.5 ** np.arange(N_GRADED, 0, -1)))
    grade = np.concatenate((grade, 1.0 - grade[-2::-1]))
    panels = (edges[:-1, None] + np.diff(edges)[:, None] * grade).ravel()
    half = 0.5 * np.maximum(np.diff(panels), 0.0)[:, None]
    theta = (panels[:-1, None] + half * (nodes + 1)).ravel()
    if orders.size == 1:
        q = np.abs(np.imag(modal[0][:, None] * np.exp(1j * theta)))
    else:
        q = np.abs(np.imag(modal.T @ np.exp(1j * np.outer(orders, theta))))
    return (q / np.linalg.norm(q, axis=0)) @ (half * weights).ravel() / length
