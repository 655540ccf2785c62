"""Gather contact set, drift and modal norms along the steps of `bdf`."""

import math

import numpy as np

from hpcsweep.model.kernel_model import Model

STEP_NODES = 9
"""Times at which the interpolant of a step is searched for extrema and crossings."""
PANEL_NODES, PANEL_WEIGHTS = np.polynomial.legendre.leggauss(6)


class StepTally:
    """Maxima and means over the steps' interpolants.

    Parameters
    ----------
    model : Model
    modal_norm : bool
    """

    def __init__(self, model: Model, modal_norm: bool):
        self.contact = 0
        self.peak_drift = 0.0
        self._modal_transform = model.modal_transform
        self._contacts = model.contacts
        self._n = model.stiffness.shape[0]
        unit = np.vstack((np.eye(self._n), np.zeros(self._n)))  # row -1 is at rest: the base
        upper, lower = model.drift_rows.T
        self._drifts = unit[upper] - unit[lower]
        self._modal = np.zeros(len(model.modal_transform))
        self._free_time = 0.0
        self._modal_norm = modal_norm

    def add(self, interpolant, start: float, end: float) -> None:
        """Add one step."""
        n = self._n
        tau = np.linspace(start, end, STEP_NODES)
        z = interpolant(tau)
        self._add_drifts(interpolant, tau, z)
        contacts = self._contacts
        past = contacts.sign[:, None] * z[contacts.row] - contacts.gap[:, None]
        speed = z[n + contacts.row]
        highest = past.max(axis=1, initial=-math.inf)
        for k, left in zip(*np.nonzero(speed[:, :-1] * speed[:, 1:] < 0), strict=True):
            i, sign = contacts.row[k], contacts.sign[k]
            top = _extremum(
                lambda t, i=i, sign=sign: sign * interpolant(t)[[i, n + i]], *tau[left : left + 2]
            )
            highest[k] = max(highest[k], top - contacts.gap[k])
        for k in np.flatnonzero(highest >= 0.0):
            self.contact |= 1 << int(k)
        if self._modal_norm:
            self._add_modal(interpolant, tau, -past.max(axis=0, initial=-math.inf))

    def _add_drifts(self, interpolant, tau, z) -> None:
        """Raise the peak drift, at the nodes and between those where a slope changes its sign."""
        n, rows = self._n, self._drifts
        values, slopes = rows @ z[:n], rows @ z[n:]
        self.peak_drift = max(self.peak_drift, float(np.abs(values).max(initial=0.0)))
        for i, left in zip(*np.nonzero(slopes[:, :-1] * slopes[:, 1:] < 0), strict=True):

            def pair(t, i=i):
                now = interpolant(t)
                return np.array((rows[i] @ now[:n], rows[i] @ now[n:]))

            top = float(_extremum(pair, *tau[left : left + 2]))
            self.peak_drift = max(self.peak_drift, abs(top))

    def _add_modal(self, interpolant, tau, gap):
        """Integrate |q_j| / ||q|| over the parts of a step without contact."""
        for k in range(STEP_NODES - 1):
            left, right = tau[k], tau[k + 1]
            if gap[k] <= 0 and gap[k + 1] <= 0:
                continue
            if gap[k] * gap[k + 1] < 0:
                touch = left + (right - left) * gap[k] / (gap[k] - gap[k + 1])
                left, right = (left, touch) if gap[k] > 0 else (touch, right)
            half = 0.5 * (right - left)
            q = np.abs(
                self._modal_transform @ interpolant(left + half * (PANEL_NODES + 1))[: self._n]
            )
            size = np.linalg.norm(q, axis=0)
            share = np.divide(q, size, out=np.zeros_like(q), where=size > 0)
            self._modal += half * (share @ PANEL_WEIGHTS)
            self._free_time += 2 * half

    def modal_mean(self) -> np.ndarray:
        """Return the mean modal norms, shape (n,); NaN if there was always contact."""
        if not self._modal_norm or self._free_time == 0:
            return np.full(self._modal.size, math.nan)
        return self._modal / self._free_time


def _extremum(value_and_slope, left: float, right: float) -> float:
    """Return the value where the slope vanishes between two times with slopes of different sign."""
    slope_left, slope_right = value_and_slope(left)[1], value_and_slope(right)[1]
    best = value_and_slope(left)[0]
    for _ in range(8):
        middle = right - slope_right * (right - left) / (slope_right - slope_left)
        best, slope = value_and_slope(middle)
        if slope == 0 or abs(right - left) < 1e-12:
            break
        if slope * slope_right > 0:
            right, slope_right = middle, slope
            slope_left *= 0.5
        else:
            left, slope_left = middle, slope
            slope_right *= 0.5
    return best
