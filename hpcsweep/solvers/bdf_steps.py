"""A time integrated by scipy's BDF with steps that see every contact.

A short contact inside a long step would be invisible to the error estimate, and so would a short
release inside a contact. Before each step the step is therefore limited to the time in which the
nearest floor could reach the stop from its side, but to no less than `BdfSteps.least_limit`: a
contact of duration d under an acceleration a gives the impulse beta a d^3 / 12, and the limit is
the d at which that is the relative tolerance. Shorter contacts may be stepped over. The layer in
which the sigmoid is neither 0 nor 1 is as invisible when it is thin: it changes v^2 / 2 by
beta pi^2 / (6 rho^2) on the way in, and if that is more than the tolerance of v it is crossed in
steps of its length scale 1 / rho.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import BDF

from hpcsweep.model.equations import MODEL, derivative, jacobian_matrix
from hpcsweep.model.kernel_model import Model
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll

MAX_STEPS = 200_000
"""Most steps in one forcing period."""
POLL_STEPS = 500
"""Steps between two calls of ``poll`` inside a period: about a tenth of a second."""
MIN_RTOL = 1e-13
"""Smaller relative tolerances are raised to this one: scipy refuses those below 2.2e-14."""
LAYER_HALF_WIDTH = 5.0
"""Half-width of the contact layer, in units of 1 / rho."""
FLATTEST = 1e-3
"""Smaller rho are raised to this one to limit steps: such a layer is wider than any motion."""
ABSOLUTE = 1.0
"""atol = rtol * ABSOLUTE: lengths are measured in gaps and near contact u is about 1, so the
absolute tolerance is the relative one of a displacement of one gap."""


class BdfSteps:
    """Integrates states of the kernels over times that begin at tau = 0.

    Parameters
    ----------
    model : Model
    rtol : float
        Relative tolerance a step.
    """

    def __init__(self, model: Model, rtol: float):
        self.rtol = max(rtol, MIN_RTOL)
        self.model, self._packed = MODEL.place(model)
        self._size = 2 * model.stiffness.shape[0]
        self._layer = 1.0 / max(model.rho, FLATTEST)
        sharp = model.rho > FLATTEST
        self._layer_steps = model.contacts.beta * (math.pi * self._layer) ** 2 / 6 * sharp
        self.least_limit = (12 * self.rtol / (model.stiffness_bound + model.hardest)) ** (1 / 3)

    def advance(
        self,
        z: np.ndarray,
        amplitude: float,
        length: float,
        poll: Poll = None,
        on_step: Callable | None = None,
        columns: int = 0,
    ) -> tuple[np.ndarray, Outcome]:
        """Integrate from tau = 0 to `length`.

        Parameters
        ----------
        z : ndarray, shape (2R (1 + columns),)
            State, then a matrix of tangent vectors row by row.
        amplitude, length : float
        poll : callable, optional
        on_step : callable, optional
            Called with the interpolant of each step, its ends and the right-hand side.
        columns : int

        Returns
        -------
        ndarray
            State at the end, the old one after a failure.
        Outcome
        """
        if poll is not None:
            poll()
        field, matrix = self._equations(amplitude, columns)
        tolerance, steps = {"rtol": self.rtol, "atol": self.rtol * ABSOLUTE}, 0
        with np.errstate(all="ignore"):
            try:
                solver = BDF(field, 0.0, z, length, jac=matrix, **tolerance)
                while solver.status == "running":
                    steps += 1
                    if steps > MAX_STEPS:
                        return z, Outcome.STEP_LIMIT
                    if poll is not None and steps % POLL_STEPS == 0:
                        poll()
                    solver.max_step = self._step_limit(solver.t, solver.y, field)
                    solver.step()
                    if not np.all(np.isfinite(solver.y)):
                        return z, Outcome.NON_FINITE
                    if solver.status == "failed":
                        finite = np.all(np.isfinite(field(solver.t, solver.y)))
                        return z, Outcome.SOLVER_FAILED if finite else Outcome.NON_FINITE
                    if on_step is not None:
                        on_step(solver.dense_output(), solver.t_old, solver.t, field)
            except (ValueError, np.linalg.LinAlgError, FloatingPointError, OverflowError):
                return z, Outcome.NON_FINITE
        return solver.y, Outcome.COMPLETE

    def _equations(self, amplitude, columns):
        """Return right-hand side and Jacobian of the state and `columns` tangent vectors."""
        packed, size = self._packed, self._size

        def motion(tau, z):
            return derivative(tau, z, amplitude, packed)

        def matrix(_tau, z):
            return jacobian_matrix(z, packed)

        def motion_with_tangent(tau, z):
            product = matrix(tau, z[:size]) @ z[size:].reshape(size, columns)
            return np.concatenate((motion(tau, z[:size]), product.ravel()))

        def matrix_with_tangent(tau, z):
            # the second derivative of the field is left out: Newton converges without it
            return np.kron(np.eye(columns + 1), matrix(tau, z[:size]))[order][:, order]

        # state first, then the tangent matrix row by row
        tail = size + np.arange(size * columns).reshape(columns, size).T.ravel()
        order = np.concatenate((np.arange(size), tail))
        if columns:
            return motion_with_tangent, matrix_with_tangent
        return motion, matrix

    def _step_limit(self, tau, z, motion):
        """Return the time in which a contact could reach its layer, or cross a part of it."""
        contacts, n = self.model.contacts, self._size // 2
        if not contacts.row.size:
            return math.inf
        past = contacts.sign * z[contacts.row] - contacts.gap
        speed = contacts.sign * z[n + contacts.row]
        gap = np.maximum(np.abs(past) - LAYER_HALF_WIDTH * self._layer, 0.0)
        # outside the layer only the motion towards it counts
        speed = np.where(gap > 0.0, np.maximum(-np.sign(past) * speed, 0.0), np.abs(speed))
        push = np.abs(motion(tau, z)[n + contacts.row]) + 1.0
        room = gap + self._layer
        time = 2.0 * room / (speed + np.sqrt(speed**2 + 2.0 * push * room))
        seen = self._layer_steps > self.rtol * np.maximum(speed, self.rtol)
        return float(np.where(seen, time, np.maximum(time, self.least_limit)).min())
