"""The solver `bdf`: scipy's backward differentiation formulas on the compiled equations.

The method of Matlab's ode15s, with which the study was specified. Each forcing period is integrated
from tau = 0 to T by a fresh `scipy.integrate.BDF`, so that a period is a function of its start
state alone (a sweep can be cut and resumed anywhere with the same result) and the phase of the
forcing never loses digits. Keeping one object over all periods is no more accurate; the start at
order 1 costs some 20 steps a period, 3 to 8 per cent once there is contact.

It is for the systems of that study (`offers.BDF`); all others are left to `flow`.

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

from hpcsweep.model.arguments import refused
from hpcsweep.model.equations import MODEL, derivative, jacobian_matrix
from hpcsweep.model.kernel_model import Model, kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers import offers
from hpcsweep.solvers.arguments import motion, points_array, solver_arguments, tangent_column
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.records import Advance, Approach, Growth, Observation, window_growth
from hpcsweep.solvers.step_tally import StepTally

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


class BdfMap:
    """Advance states of one structure at one frequency by scipy's BDF.

    Parameters
    ----------
    structure : Structure
    omega : float
        Forcing frequency Omega.
    rtol : float
        Relative tolerance a step; atol is the same number in gaps. The error after a period is
        larger. Measured, in units of rtol: 8 to 700 at beta = 1000, 150 to 900 on a grazing
        orbit, 770 to 16,500 at beta = 1e5; the monodromy matrix 90 to 380 at rho of 1e4 and
        more, up to 7e5 for a soft contact.
    """

    def __init__(self, structure: Structure, omega: float, rtol: float = 1e-6):
        self.structure, self.omega, rtol = solver_arguments(structure, omega, rtol, yields=True)
        if not offers.BDF.of(structure):
            raise refused("solver", f"flow {offers.BDF.lacks}", "bdf")
        self._model = kernel_model(structure, self.omega)
        self._steps = BdfSteps(self._model, rtol)
        self.rtol, self.period = self._steps.rtol, self._model.period
        self._units = Units(structure, self._model)

    def advance(self, state, amplitude, n_periods, poll: Poll = None) -> Advance:
        """Integrate `n_periods` forcing periods; see `hpcsweep.solvers.flow.FlowMap.advance`."""
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        z = self._units.into(z)
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, poll)
            if outcome is not Outcome.COMPLETE:
                return Advance(self._units.out_of(z), done, outcome)
        return Advance(self._units.out_of(z), n_periods, Outcome.COMPLETE)

    def settle(
        self, state, amplitude, n_periods, max_period, settled, same, near=0.0, poll: Poll = None
    ) -> Approach:
        """Integrate the whole transient: the error of a period hides whether an orbit has closed.

        The orbit remains unknown (period 0); see `hpcsweep.solvers.flow.FlowMap.settle`.
        """
        del max_period, settled, same, near
        done = self.advance(state, amplitude, n_periods, poll)
        return Approach(done.state, done.n_periods, 0, 0, math.nan, done.outcome)

    def points(self, state, amplitude, n_periods, poll=None) -> tuple[np.ndarray, Outcome]:
        """Return the stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n)."""
        return self._collect(state, amplitude, n_periods, poll, None)

    def observe(
        self, state, amplitude, n_periods, modal_norm=False, growth=False, poll=None, measures=0
    ) -> Observation:
        """Integrate `n_periods` and gather points, contact set, drift, modal norms and measures.

        With `growth` also the growth of a tangent vector, initially (1, ..., 1), for which the
        window is integrated again.
        """
        tally = StepTally(self._model, modal_norm, measures, self._absolute(amplitude))
        points, outcome = self._collect(state, amplitude, n_periods, poll, tally.add)
        logarithms = np.empty(0)
        if growth and outcome is Outcome.COMPLETE:
            logarithms, _, _ = self._growth(state, amplitude, n_periods, poll)
        return Observation(
            points,
            self.structure.contact_bits(tally.contact),
            tally.peak_drift * self.structure.length_unit,
            tally.modal_mean(),
            outcome,
            window_growth(logarithms),
            logarithms,
            tally.measures(self.structure, len(points)),
        )

    def grow(self, state, amplitude, n_periods, poll=None, direction=None) -> Growth:
        """Integrate `n_periods`, and again with a tangent vector."""
        points, outcome = self.points(state, amplitude, n_periods, poll)
        logarithms, end = np.empty(0), np.empty(0)
        if outcome is Outcome.COMPLETE:
            logarithms, end, outcome = self._growth(state, amplitude, n_periods, poll, direction)
        return Growth(points, outcome, logarithms, end)

    def _growth(self, state, amplitude, n_periods, poll, direction=None):
        """Return a tangent vector's logarithmic growth in each period, its end, and the outcome.

        The first two are empty if the solver fails.
        """
        start = self._units.into(state)
        size = start.size
        vector = self._units.tangent_into(tangent_column(self.structure, direction))
        z = np.concatenate((start, vector.ravel()))
        logarithms = np.empty(n_periods)
        for period in range(n_periods):
            z, outcome = self._period(z, amplitude, poll, columns=1)
            if outcome is not Outcome.COMPLETE:
                return np.empty(0), np.empty(0), outcome
            length = np.linalg.norm(z[size:])
            logarithms[period] = math.log(length) if length > 0 else -math.inf
            z[size:] /= length or 1.0
        end = self._units.tangent_out_of(z[size:, None]).ravel()
        return logarithms, end, Outcome.COMPLETE

    def monodromy(self, state, amplitude, n_periods) -> tuple[np.ndarray, np.ndarray]:
        """Integrate with the tangent map; see `hpcsweep.solvers.flow.FlowMap.monodromy`.

        The 2n variational columns are integrated with the state, to the same tolerance.
        """
        columns = self._units.tangent_into(np.eye(2 * self.structure.n_floors))
        size, n_columns = columns.shape
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        z = np.concatenate((self._units.into(z), columns.ravel()))
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, None, columns=n_columns)
            if outcome is not Outcome.COMPLETE:
                raise ArithmeticError(f"bdf: {outcome.name} in forcing period {done + 1}")
        matrix = z[size:].reshape(size, n_columns)
        return self._units.out_of(z[:size]), self._units.tangent_out_of(matrix)

    def images(self, states, amplitude, tangents=True, poll=None) -> tuple[np.ndarray, ...]:
        """Integrate states over one forcing period each; see `flow.FlowMap.images`.

        The tangent maps are integrated in any case.
        """
        del tangents
        ends, matrices = np.empty_like(states), np.empty((*states.shape, states.shape[1]))
        for k, state in enumerate(states):
            if poll is not None:
                poll()
            ends[k], matrices[k] = self.monodromy(state, amplitude, 1)
        return ends, matrices

    def _absolute(self, amplitude) -> Callable[[Callable, float, np.ndarray], np.ndarray]:
        """Return the absolute accelerations of the floors as a function for `StepTally`."""
        n = self.structure.n_floors
        order, size, phase = self._model.harmonics.T

        def accelerations(field: Callable, tau: float, z: np.ndarray) -> np.ndarray:
            base = amplitude / self._units.amplitude_unit
            ground = base * (size @ np.sin(order * self._model.omega * tau + phase))
            forced = field(tau, z)[len(z) // 2 :][:n]
            return forced + self._model.ground * ground

        return accelerations

    def _collect(self, state, amplitude, n_periods, poll, on_step):
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        z = self._units.into(z)
        points = points_array(n_periods, z.size)
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, poll, on_step)
            if outcome is not Outcome.COMPLETE:
                return self._units.out_of(points[:done]), outcome
            points[done] = z
        return self._units.out_of(points), Outcome.COMPLETE

    def _period(self, z, amplitude, poll, on_step=None, columns=0):
        """Integrate one period; return the state (the old one after a failure) and an outcome."""
        amplitude = amplitude / self._units.amplitude_unit
        return self._steps.advance(z, amplitude, self.period, poll, on_step, columns)


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
