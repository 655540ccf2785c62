"""Motions with sharp contacts in linear segments: from one change of a contact to the next.

The state of a contact is whether it is past its stop, and whether it pushes (`Segments.past`,
`Segments.pushing`). With both fixed the motion is linear. It changes where x = 0, and, of a dashpot
that never pulls, where beta x + drag x' = 0 (see `hpcsweep.model.dashpot`). A step ends there, at
the root of its interpolant, and the integration starts anew.

A tangent vector w is taken through a change at which the field jumps from f_- to f_+, h(z) = 0, by

    S = I + (f_+ - f_-) grad h^T / (grad h . f_-).

Where a contact closes h = x, grad h . f = x', and the field jumps by -drag x' e: the speeds change
by -drag e times the distance of w, and by + drag e times that where it opens while it pulls. Where
a contact lets go its force is 0, nothing jumps, S = I.
"""

import numpy as np
from scipy.optimize import brentq

from hpcsweep.model.kernel_model import Model

STEP_NODES = 9
"""Times at which the interpolant of a step is searched for changes."""


class Segments:
    """The state of the contacts of one motion, and its linear equations meanwhile.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        self._model = model
        self._n = model.stiffness.shape[0]
        m = model.contacts.gap.size
        self.past = np.zeros(m, bool)
        self.pushing = np.zeros(m, bool)
        self.matrix = np.zeros((2 * self._n, 2 * self._n))
        """Of the linear equations, shape (2R, 2R)."""
        self._constant = np.zeros(2 * self._n)
        self._amplitude = 0.0
        self._changing = 0
        """Place of a contact that changes by its distance, m further on by its force."""

    def begin(self, tau: float, z: np.ndarray, amplitude: float) -> None:
        """Find the state of the contacts of a state, shape (2R,)."""
        contacts, self._amplitude = self._model.contacts, amplitude
        x, w, force = self._contacts(z)
        self.past = (x > 0.0) | ((x == 0.0) & (w > 0.0))
        self.pushing = self.past & ~(contacts.lets_go & (force < 0.0))
        self._write()
        resting = (x == 0.0) & (w == 0.0)
        if resting.any():
            pushed = contacts.sign * self.derivative(tau, z)[self._n + contacts.row]
            self.past |= resting & (pushed > 0.0)
            self.pushing |= resting & (pushed > 0.0)
            self._write()

    def derivative(self, tau: float, z: np.ndarray) -> np.ndarray:
        """Return z' of the segment at hand, shape (2R,)."""
        model = self._model
        ground = sum(
            size * np.sin(order * model.omega * tau + phase)
            for order, size, phase in model.harmonics
        )
        ground += sum(value + rate * tau for value, rate, _ in model.ramp)
        found = self.matrix @ z + self._constant
        found[self._n :] += model.forcing * (self._amplitude * ground)
        return found

    def first_change(self, dense, start: float, end: float) -> tuple[bool, float]:
        """Return whether a contact changes its state within a step, and when, or its end."""
        tau = np.linspace(start, end, STEP_NODES)
        values = self._until_changes(dense(tau))
        first = None
        for place, g in enumerate(values):
            crossed = np.flatnonzero((g[:-1] <= 0.0) & (g[1:] > 0.0))
            if crossed.size:
                left = crossed[0]

                def now(t, place=place):
                    return self._until_changes(dense(t)[:, None])[place, 0]

                time = tau[left]
                if g[left] < 0.0:
                    time = brentq(now, tau[left], tau[left + 1], xtol=1e-15 * end)
            elif g[0] > 0.0 and g.min() > 0.0:
                time = start  # by rounding, at a change of another contact
            else:
                continue
            if first is None or time < first[0]:
                first = float(time), place
        if first is None:
            return False, end
        self._changing = first[1]
        return True, first[0]

    def change(self, z: np.ndarray) -> np.ndarray:
        """Let the contact of the last `first_change` change; return the state, tangents too."""
        contacts, n, m = self._model.contacts, self._n, self.past.size
        k = self._changing % m
        z = z.copy()
        if self._changing >= m:
            self.pushing[k] = not self.pushing[k]
        else:
            row, sign, drag = contacts.row[k], contacts.sign[k], contacts.drag[k]
            z[row] = sign * contacts.gap[k]
            closes = not self.past[k]
            jump = -drag if closes else drag * self.pushing[k]
            tangent = z[2 * n :].reshape(2 * n, -1)
            tangent[n:] += np.outer(jump * contacts.kick[k], sign * tangent[row])
            self.past[k] = self.pushing[k] = closes
        self._write()
        return z

    def _contacts(self, z):
        """Return distances past the stops, speeds and forces over their units, (m, ...)."""
        contacts = self._model.contacts
        shape = (-1, *(1,) * (z.ndim - 1))
        sign = contacts.sign.reshape(shape)
        x = sign * z[contacts.row] - contacts.gap.reshape(shape)
        w = sign * z[self._n + contacts.row]
        law = contacts.law
        return x, w, law[:, 0].reshape(shape) * x + law[:, 1].reshape(shape) * w

    def _until_changes(self, z) -> np.ndarray:
        """Return what rises through 0 where a contact changes: by its distance, its force.

        Shape (2m, any).
        """
        x, _, force = self._contacts(z)
        by_force = np.where(self.pushing[:, None], -force, force)
        searched = self.past & self._model.contacts.lets_go
        by_force[~searched] = -1.0
        return np.concatenate((np.where(self.past[:, None], -x, x), by_force))

    def _write(self) -> None:
        """Write the linear equations of the state of the contacts."""
        model, n = self._model, self._n
        contacts = model.contacts
        self.matrix[:n, n:] = np.eye(n)
        self.matrix[n:, :n] = -model.stiffness
        self.matrix[n:, n:] = -model.damping
        self._constant[:] = 0.0
        for k in np.flatnonzero(self.pushing):
            row, sign, kick = contacts.row[k], contacts.sign[k], contacts.kick[k]
            self.matrix[n:, row] -= contacts.beta[k] * sign * kick
            self.matrix[n:, n + row] -= contacts.drag[k] * sign * kick
            self._constant[n:] += contacts.beta[k] * contacts.gap[k] * kick
