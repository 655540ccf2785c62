"""The solver `bdf`: scipy's backward differentiation formulas on the compiled equations.

The method of Matlab's ode15s, with which the study was specified. Each forcing period is integrated
from tau = 0 to T by a fresh `scipy.integrate.BDF`, so that a period is a function of its start
state alone (a sweep can be cut and resumed anywhere with the same result) and the phase of the
forcing never loses digits. Keeping one object over all periods is no more accurate; the start at
order 1 costs some 20 steps a period, 3 to 8 per cent once there is contact.

`bdf_steps` integrates a period. It is for the systems of that study (`offers.BDF`); all others are
left to `flow`.
"""

import math
from collections.abc import Callable

import numpy as np

from hpcsweep.model.arguments import refused
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import motion, points_array, solver_arguments, tangent_column
from hpcsweep.solvers.bdf_steps import BdfSteps
from hpcsweep.solvers.offers import BDF
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.records import Advance, Approach, Growth, Observation, window_growth
from hpcsweep.solvers.step_tally import StepTally


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
        if not BDF.of(structure):
            raise refused("solver", f"flow {BDF.lacks}", "bdf")
        self._model = kernel_model(structure, self.omega)
        self._steps = BdfSteps(self._model, rtol)
        self.rtol, self.period = self._steps.rtol, self._model.period
        self._units = Units(structure, self._model)

    def advance(
        self, state: np.ndarray, amplitude: float, n_periods: int, poll: Poll = None
    ) -> Advance:
        """Integrate `n_periods` forcing periods; see `hpcsweep.solvers.flow.FlowMap.advance`."""
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        z = self._units.into(z)
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, poll)
            if outcome is not Outcome.COMPLETE:
                return Advance(self._units.out_of(z), done, outcome)
        return Advance(self._units.out_of(z), n_periods, Outcome.COMPLETE)

    def settle(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        max_period: int,
        settled: float,
        same: float,
        near: float = 0.0,
        poll: Poll = None,
    ) -> Approach:
        """Integrate the whole transient: the error of a period hides whether an orbit has closed.

        The orbit remains unknown (period 0); see `hpcsweep.solvers.flow.FlowMap.settle`.
        """
        del max_period, settled, same, near
        done = self.advance(state, amplitude, n_periods, poll)
        return Approach(done.state, done.n_periods, 0, 0, math.nan, done.outcome)

    def points(
        self, state: np.ndarray, amplitude: float, n_periods: int, poll: Poll = None
    ) -> tuple[np.ndarray, Outcome]:
        """Return the stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n)."""
        return self._collect(state, amplitude, n_periods, poll, None)

    def observe(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        modal_norm: bool = False,
        growth: bool = False,
        poll: Poll = None,
        measures: int = 0,
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

    def grow(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Poll = None,
        direction: np.ndarray | None = None,
    ) -> Growth:
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

    def monodromy(
        self, state: np.ndarray, amplitude: float, n_periods: int
    ) -> tuple[np.ndarray, np.ndarray]:
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

    def images(
        self, states: np.ndarray, amplitude: float, tangents: bool = True, poll: Poll = None
    ) -> tuple[np.ndarray, np.ndarray]:
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
