"""Steady state without contact, in closed form.

Free of contact the modes are uncoupled (12), or coupled by a damping matrix. The steady state is

    u(tau) = A sum_h Im(U_h exp(i h Omega tau)).

`solvers.free` proves which motions tend to it.
"""

import cmath
import math
from dataclasses import fields
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from hpcsweep.model.modes import trigonometric_maxima, trigonometric_zeros
from hpcsweep.model.observed import PEAKS, Measures
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation

N_GRADED = 40
"""Panels on either side of a kink of the modal norms, each half as long as the previous one."""
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
        b, limits = structure.slider_directions, [slider.limit for slider in structure.sliders]
        self.directions = directions = np.concatenate((structure.directions, b, -b))
        self.levels = np.append(structure.gaps - structure.layer_half_width, 2 * limits)
        self.is_known = False
        """Whether there is one steady state, not many side by side as of what has no spring, and no
        contact is in its layer at rest."""
        try:
            self._orders, self._responses = structure.steady_harmonics(omega)
        except ZeroDivisionError:
            return
        self.is_known = not (np.any(self.levels <= 0) or structure.n_rigid)
        self.lyapunov_exponent = slowest_decay(structure)
        """Of every linear motion: the largest real part of the eigenvalues of the free modes."""
        steady = self._orders, self._responses
        self.largest = np.array(
            [trigonometric_maxima(*steady, sign * directions) for sign in (1.0, -1.0)]
        )
        """Shape (2, C + 2 L): largest displacement of the steady state at A = 1, and at A = -1,
        towards each contact, and along each slider and against it."""

    @cached_property
    def _drift(self) -> float:
        return self._structure.steady_drift(self._omega)

    def state(self, amplitude: float) -> np.ndarray:
        """Return the stroboscopic point of the steady state at amplitude A, shape (2n,)."""
        speeds = self._omega * (self._orders @ self._responses.real)
        return amplitude * np.concatenate((self._responses.imag.sum(axis=0), speeds))

    def window(self, amplitude: float) -> Observation | None:
        """Return one period of the steady state; None if it is unknown, or enters a layer.

        Parameters
        ----------
        amplitude : float
        """
        if not self.is_known:
            return None
        away = abs(amplitude) * self.largest[0 if amplitude >= 0 else 1]
        if np.any(away >= self.levels):
            return None
        return self.observation(amplitude, self.state(amplitude))

    def observation(self, amplitude: float, point: np.ndarray) -> Observation:
        """Return the results of a window of the steady state that ends at a point."""
        return Observation(
            point[None, :],
            0,
            self.peak_drift(amplitude),
            self.modal_norm(amplitude),
            Outcome.COMPLETE,
            slid=self._slid(amplitude),
        )

    def _slid(self, amplitude: float) -> dict[str, np.ndarray]:
        """Return what sliders do that do not slip, see `Observation`."""
        sliders = self._structure.sliders
        if not sliders:
            return {}
        ways = self.largest[:, len(self._structure.contacts) :].max(axis=0)
        ductility = np.maximum(*np.split(ways, 2)) / [slider.limit for slider in sliders]
        nothing = np.zeros(len(sliders))
        rest = {"slider_energy": nothing, "plastic": nothing}
        return {"ductility": abs(amplitude) * ductility, **rest}

    def peak_drift(self, amplitude):
        """Return the largest interstorey drift at amplitudes A."""
        return np.abs(amplitude) * self._drift

    def measures(self, amplitudes) -> Measures:
        """Return the measures of an `Observation` at amplitudes A, of any shape."""
        size, structure = np.abs(np.asarray(amplitudes, float))[..., None], self._structure
        names = (each.name for each in fields(Measures))
        nothing = dict.fromkeys(names, np.zeros(len(structure.contacts)) * size)
        return Measures(**nothing | {name: size * peaks for name, peaks in self._peaks.items()})

    @cached_property
    def _peaks(self) -> dict[str, np.ndarray]:
        """Peaks of storeys and floors at A = 1, by quantity."""
        along = {"storey": self._structure.drift_rows, "floor": np.eye(self._structure.n_floors)}
        peaks = {}
        for quantity in PEAKS:
            if quantity.dim in along:
                harmonics, rows = self._derivative(quantity.order), along[quantity.dim]
                both = [trigonometric_maxima(self._orders, harmonics, way) for way in (rows, -rows)]
                peaks[quantity.name] = np.maximum(*both)
        return peaks

    def _derivative(self, order: int) -> np.ndarray:
        """Return the harmonics of a derivative of u at A = 1, absolute from u'' on, (H, n)."""
        rate = 1j * self._omega * self._orders[:, None]
        harmonics = rate**order * self._responses
        if order > 1 and self._structure.shakes:
            terms = self._structure.forcing.terms
            ground = np.array([[a * cmath.exp(1j * phase)] for _, a, phase in terms])
            harmonics = harmonics + rate ** (order - 2) * ground * self._structure.influence
        return harmonics

    def modal_norm(self, amplitude: float) -> np.ndarray:
        """Return the mean modal norms, shape (n,); NaN at A = 0."""
        n = self._structure.n_floors
        return self._modal_norm if amplitude else np.full(n, math.nan)

    @cached_property
    def _modal_norm(self) -> np.ndarray:
        modal = self._responses @ self._structure.modal_transform.T
        return _mean_modal_norm(self._orders, modal)


def period_map(structure: Structure, period: float) -> np.ndarray:
    """Return the map of (q, q') over a time without forcing, shape (2n, 2n)."""
    w = structure.frequencies
    if not structure.is_modal:
        zero, drag = np.zeros((w.size, w.size)), structure.modal_damping
        return expm(period * np.block([[zero, np.eye(w.size)], [-np.diag(w**2), -drag]]))
    matrix = np.zeros((2 * w.size, 2 * w.size))
    for j, (frequency, zeta) in enumerate(zip(w, structure.damping_ratios, strict=True)):
        pair = expm(period * np.array([[0.0, 1.0], [-(frequency**2), -2 * zeta * frequency]]))
        matrix[np.ix_((j, j + w.size), (j, j + w.size))] = pair
    return matrix


def slowest_decay(structure: Structure) -> float:
    """Return max Re(lambda), lambda^2 + 2 zeta omega lambda + omega^2 = 0, over all modes."""
    if not structure.is_modal:
        return float(np.log(np.abs(np.linalg.eigvals(period_map(structure, 1.0)))).max())
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
