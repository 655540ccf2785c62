"""Gather contact set, drift, modal norms and measures along the steps of `bdf`."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from hpcsweep.model import observed
from hpcsweep.model.contact import FAR, contact_force
from hpcsweep.model.kernel_model import Model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.measures import measures_of

STEP_NODES = 9
"""Times at which the interpolant of a step is searched for extrema and crossings."""
PANEL_NODES, PANEL_WEIGHTS = np.polynomial.legendre.leggauss(6)


class StepTally:
    """Maxima and means over the steps' interpolants.

    Parameters
    ----------
    model : Model
    modal_norm : bool
    measures : int
        Flags, see `Observation`.
    accelerate : callable (field, tau, z), optional
        Return the absolute accelerations of the floors, shape (n,), by the right-hand side `field`.
    """

    def __init__(
        self,
        model: Model,
        modal_norm: bool,
        measures: int = 0,
        accelerate: Callable[[Callable, float, np.ndarray], np.ndarray] | None = None,
    ):
        self._model = model
        self.contact = 0
        self.peak_drift = 0.0
        self._modal_transform = model.modal_transform
        self._contacts = model.contacts
        self._n = model.stiffness.shape[0]
        unit = np.vstack((np.eye(self._n), np.zeros(self._n)))  # row -1 is at rest: the base
        upper, lower = model.drift_rows.T
        self._drifts = unit[upper] - unit[lower]
        flags = model.watched[:, 3]
        displacements = observed.DRIFT | observed.FLOOR | observed.CONTACT
        self._places = np.flatnonzero(flags & measures & displacements)
        rows, below, self._sides, _ = model.watched[self._places].T
        self._watched = unit[rows] - unit[below]
        self._watched[self._sides < 0] *= -1.0
        self._levels = np.zeros(len(flags))
        self._levels[flags == observed.CONTACT] = model.contacts.gap
        self._levels = self._levels[self._places]
        self._accelerate = accelerate if measures & observed.ACCELERATION else None
        self._accelerated = np.flatnonzero(flags == observed.ACCELERATION)
        self._wants_any, self._wants_impacts = bool(measures), bool(measures & observed.IMPACT)
        self.peaks = np.full(len(flags), math.nan)  # of what is not known here
        self.peaks[flags & (displacements | observed.ACCELERATION) != 0] = 0.0
        self.impacts = np.zeros((observed.N_IMPACTS, model.contacts.gap.size))
        self._closed = np.empty(0, bool)  # of no contact before the first step
        self._beside = np.zeros(model.contacts.gap.size, bool)
        """Contacts that have not come apart since they have last been closed, see `ROUNDING`."""
        self._size = 0.0
        self._modal = np.zeros(len(model.modal_transform))
        self._free_time = 0.0
        self._modal_norm = modal_norm

    def add(self, interpolant, start: float, end: float, field: Callable) -> None:
        """Add one step; `field` is the right-hand side, as a function of time and state."""
        n = self._n
        tau = np.linspace(start, end, STEP_NODES)
        z = interpolant(tau)
        drifts = self._tops(self._drifts, np.ones(len(self._drifts), bool), interpolant, tau, z)
        self.peak_drift = max(self.peak_drift, float(drifts.max(initial=0.0)))
        tops = self._tops(self._watched, self._sides == 0, interpolant, tau, z) - self._levels
        contacts = self._contacts
        self.peaks[self._places] = np.maximum(self.peaks[self._places], tops)
        if self._accelerate is not None:
            self._add_accelerations(interpolant, tau, z, partial(self._accelerate, field))
        signs = contacts.sign[:, None]
        past = signs * z[contacts.row] - contacts.gap[:, None]
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
        if self._wants_impacts:
            if not self._closed.size:
                self._closed = past[:, 0] >= 0.0
            self._note_apart(past[:, 0])
            for k in np.flatnonzero(highest >= -FAR / max(self._model.rho, 1e-300)):
                self._add_impacts(int(k), interpolant, tau, signs[k, 0] * speed[k])
            self._size = max(self._size, float(np.abs(z).max()))
            self._note_apart(past[:, -1])
        if self._modal_norm:
            self._add_modal(interpolant, tau, -past.max(axis=0, initial=-math.inf))

    def _tops(self, rows, both, interpolant, tau, z) -> np.ndarray:
        """Return the largest row . u of a step, |row . u| for those of `both` sides.

        At the nodes, and between those where a slope changes its sign.
        """
        n = self._n
        values, slopes = rows @ z[:n], rows @ z[n:]
        highest = np.where(both[:, None], np.abs(values), values).max(axis=1, initial=-math.inf)
        for i, left in zip(*np.nonzero(slopes[:, :-1] * slopes[:, 1:] < 0), strict=True):

            def pair(t, i=i):
                now = interpolant(t)
                return np.array((rows[i] @ now[:n], rows[i] @ now[n:]))

            top = float(_extremum(pair, *tau[left : left + 2]))
            highest[i] = max(highest[i], abs(top) if both[i] else top)
        return highest

    def _add_accelerations(self, interpolant, tau, z, accelerate) -> None:
        """Raise the peaks of absolute accelerations, at the nodes and beside the largest."""
        values = np.abs([accelerate(*at) for at in zip(tau, z.T, strict=True)]).T
        for i, place in enumerate(self._accelerated):
            top = values[i].max()
            k = int(values[i].argmax())
            left, right = max(k - 1, 0), min(k + 1, len(tau) - 1)
            if 2 * top - min(values[i, left], values[i, right]) > self.peaks[place]:
                peak = minimize_scalar(
                    lambda t, i=i: -abs(accelerate(t, interpolant(t))[i]),
                    bounds=(tau[left], tau[right]),
                    method="bounded",
                    options={"xatol": 1e-7 * (tau[-1] - tau[0])},
                )
                top = max(top, -peak.fun)
            self.peaks[place] = max(self.peaks[place], top)

    def _add_impacts(self, k, interpolant, tau, speed):
        """Add a contact's closings, force and time of a step, between nodes, tops and crossings."""
        n, contacts = self._n, self._contacts
        i, sign, gap = contacts.row[k], contacts.sign[k], contacts.gap[k]

        def distance(t):
            return sign * interpolant(t)[i] - gap

        def closing_speed(t):
            return sign * interpolant(t)[n + i]

        turns = np.flatnonzero(speed[:-1] * speed[1:] < 0)
        tops = [brentq(closing_speed, *tau[left : left + 2]) for left in turns]
        times = np.sort(np.concatenate((tau, tops)))
        values = distance(times)
        crossed = np.flatnonzero((values[:-1] >= 0) != (values[1:] >= 0))
        changes = [_crossing(distance, *times[left : left + 2]) for left in crossed]
        impacts = self.impacts[:, k]
        begun = tau[0]
        for t in changes:
            if self._closed[k]:
                impacts[observed.TIME] += t - begun
                self._beside[k] = True
            else:
                self._note_apart(values[(times >= begun) & (times <= t)].min(initial=0.0), k)
                self._close(k, abs(closing_speed(t)))
            begun = t
            self._closed[k] = not self._closed[k]
        if self._closed[k]:
            impacts[observed.TIME] += tau[-1] - begun
        ends = np.sort(np.concatenate((tau, changes)))
        half = 0.5 * np.diff(ends)[:, None]
        x = distance((ends[:-1, None] + half * (PANEL_NODES + 1)).ravel())
        force = [contact_force(value, 1.0, self._model.rho) for value in x]
        impacts[observed.FORCE] += np.sum(half * PANEL_WEIGHTS * np.reshape(force, (len(half), -1)))

    def _note_apart(self, past, k=slice(None)) -> None:
        """Note which contacts, or whether contact k, have come apart."""
        size = np.maximum(np.abs(self._contacts.gap[k]), self._size)
        self._beside[k] &= past >= -observed.ROUNDING * size

    def _close(self, k, speed: float) -> None:
        """Record that a contact closes, as `flow.observe.impacts.record` does."""
        if not self._beside[k] and speed >= observed.ROUNDING * self._size:
            self.impacts[observed.CLOSINGS, k] += 1
            self.impacts[observed.SPEED, k] = max(self.impacts[observed.SPEED, k], speed)
        self._beside[k] = True

    def measures(self, structure: Structure, n_periods: int) -> observed.Measures | None:
        """Return the measures of an `Observation` of a window; None if none is requested."""
        if not self._wants_any or not n_periods:
            return None
        return measures_of(structure, self._model, self, n_periods)

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


def _crossing(distance, left: float, right: float) -> float:
    """Return the time at which a distance crosses 0 between two times, inclusive."""
    if distance(left) * distance(right) >= 0:
        return left if distance(left) == 0 else right
    return float(brentq(distance, left, right))


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
