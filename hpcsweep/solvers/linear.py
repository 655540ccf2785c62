"""The steady state without contact, in closed form, and the proof that it is reached.

Free of contact the modes are uncoupled (12). From a state z the motion is the particular
solution A Im(U exp(i Omega tau)) plus modal transients whose energy never grows, so that

    u_i(tau) <= |A| |U_i| + sum_j |phi_ij| a_j,    a_j = sqrt(q_j^2 + (q_j' / omega_j)^2) at 0,

q being the transient part. If that stays outside the contact layer for every floor, contact is
impossible.
"""

import cmath
import math

import numpy as np
from scipy.linalg import expm

from hpcsweep.model.contact import STOP
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
        self._level = STOP - structure.layer_half_width
        try:
            self._response = structure.linear_steady_state(omega)
        except ZeroDivisionError:
            self._response = None
            return
        self.lyapunov_exponent = _slowest_decay(structure)
        """Of every linear motion: the largest real part of the eigenvalues of the free modes."""
        self._largest = float(np.abs(self._response).max())
        self._drift = float(np.abs(np.diff(self._response, prepend=0.0)).max())
        self._modal_norm = _mean_modal_norm(structure.modal_transform @ self._response)
        period = 2 * math.pi / omega
        self._decay = np.array(
            [
                expm(period * np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]]))
                for w, zeta in zip(structure.frequencies, structure.damping_ratios, strict=True)
            ]
        )
        self._powers: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def state(self, amplitude: float) -> np.ndarray:
        """Give the stroboscopic point of the steady state at amplitude A, shape (2n,)."""
        return amplitude * np.concatenate((self._response.imag, self._omega * self._response.real))

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
        if self._response is None or self._level <= 0:
            return None
        if abs(amplitude) * self._largest >= self._level:
            return None
        n = self._structure.n_floors
        phi, omega = self._structure.mode_shapes, self._structure.frequencies
        orbit = self.state(amplitude)
        rest = state - orbit
        transform = self._structure.modal_transform
        q, p = transform @ rest[:n], transform @ rest[n:]
        reach = abs(amplitude) * np.abs(self._response)
        reach = reach + np.abs(phi) @ np.hypot(q, p / omega)
        if not reach.max() < self._level:
            return None
        modal = np.stack((q, p), axis=1)[:, :, None]
        left, end = ((decay @ modal)[:, :, 0] for decay in self._decays(transient, sampling))
        if np.abs(phi).max() * np.abs(left).sum() > DECAYED * same:
            return None
        end_state = orbit + np.concatenate((phi @ end[:, 0], phi @ end[:, 1]))
        return Observation(
            end_state[None, :],
            0,
            abs(amplitude) * self._drift,
            self._modal_norm if amplitude else np.full(n, math.nan),
            Outcome.COMPLETE,
        )

    def _decays(self, transient: int, sampling: int) -> tuple[np.ndarray, np.ndarray]:
        """Give the maps of (q_j, q_j') over the transient and to the end, (n, 2, 2) each."""
        found = self._powers.get((transient, sampling))
        if found is None:
            counts = (transient, transient + sampling)
            found = tuple(np.linalg.matrix_power(self._decay, count) for count in counts)
            self._powers[transient, sampling] = found
        return found


def _slowest_decay(structure: Structure) -> float:
    """Largest Re(lambda), lambda^2 + 2 zeta omega lambda + omega^2 = 0, over all modes."""
    w, zeta = structure.frequencies, structure.damping_ratios
    rates = -zeta * w + w * np.sqrt(np.maximum(zeta**2 - 1.0, 0.0))
    return float(rates.max())


def _mean_modal_norm(modal: np.ndarray) -> np.ndarray:
    """Average |q_j| / ||q|| (17) over a period of q = Im(modal exp(i theta)).

    The kinks of |q_j| are at theta = -arg(modal_j). Where the largest q_j has its kink ||q|| has a
    dip, as narrow as the other modes are small; panels that shrink towards the kinks follow it.
    """
    if modal.size == 1:
        return np.ones(1)
    kinks = sorted({(-cmath.phase(value)) % math.pi for value in modal})
    edges = np.array([*kinks, kinks[0] + math.pi])
    nodes, weights = np.polynomial.legendre.leggauss(N_NODES)
    grade = np.concatenate(([0.0], 0.5 ** np.arange(N_GRADED, 0, -1)))
    grade = np.concatenate((grade, 1.0 - grade[-2::-1]))
    panels = (edges[:-1, None] + np.diff(edges)[:, None] * grade).ravel()
    half = 0.5 * np.maximum(np.diff(panels), 0.0)[:, None]
    theta = (panels[:-1, None] + half * (nodes + 1)).ravel()
    q = np.abs(np.imag(modal[:, None] * np.exp(1j * theta)))
    return (q / np.linalg.norm(q, axis=0)) @ (half * weights).ravel() / math.pi
