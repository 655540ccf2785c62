"""The solver `bdf`: scipy's backward differentiation formulas on the compiled equations.

The method of Matlab's ode15s, with which the study was specified. Each forcing period is
integrated from tau = 0 to T by a fresh `scipy.integrate.BDF`, so that a period is a function of
its start state alone (a sweep can be cut and resumed anywhere with the same result) and the
phase of the forcing never loses digits. One object kept over all periods is no more accurate; the
start at order 1 costs some 20 steps a period, which is 3 to 8 per cent once there is contact.

A short contact inside a long step would be invisible to the error estimate, and so would a short
release inside a contact. Before each step the step is therefore limited to the time in which the
nearest floor could reach the stop from its side, but to no less than `BdfMap.least_limit`: a
contact of duration d under an acceleration a gives the impulse beta a d^3 / 12, and the limit is
the d at which that is the relative tolerance. What is shorter may be stepped over. The layer in
which the sigmoid is neither 0 nor 1 is as invisible when it is thin: it changes v^2 / 2 by
beta pi^2 / (6 rho^2) on the way in, and if that is more than the tolerance of v it is crossed in
steps of its length scale 1 / rho.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import BDF

from hpcsweep.model.contact import STOP
from hpcsweep.model.equations import jacobian, right_hand_side
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import motion, points_array, solver_arguments
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Advance, Approach, Observation, window_growth

MAX_STEPS = 200_000
"""Cap of steps in one forcing period."""
POLL_STEPS = 500
"""Steps between two calls of ``poll`` inside a period: about a tenth of a second."""
SMALLEST_RTOL = 1e-13
"""Smaller relative tolerances are raised to this one: scipy refuses those below 2.2e-14."""
LAYER_HALF_WIDTH = 5.0
"""Half-width of the contact layer, in units of 1 / rho."""
FLATTEST = 1e-3
"""Smaller rho are this one when steps are limited: such a layer is wider than any motion."""
STEP_NODES = 9
"""Times at which the interpolant of a step is searched for extrema and crossings."""
PANEL_NODES, PANEL_WEIGHTS = np.polynomial.legendre.leggauss(6)
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
        self.structure, self.omega, rtol = solver_arguments(structure, omega, rtol)
        self.rtol = max(rtol, SMALLEST_RTOL)
        self.period = 2 * math.pi / self.omega
        self._stiffness = structure.stiffness_matrix.copy()
        self._damping = np.ascontiguousarray(structure.damping_matrix)
        beta, rho = structure.stiffness_ratio, structure.sharpness
        self._layer = 1.0 / max(rho, FLATTEST)
        self._layer_step = beta * (math.pi * self._layer) ** 2 / 6 if rho > FLATTEST else 0.0
        stiffest = structure.stiffness_bound + structure.stiffness_ratio
        self.least_limit = (12 * self.rtol / stiffest) ** (1 / 3)

    def advance(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> Advance:
        """Integrate `n_periods` forcing periods; see `hpcsweep.solvers.flow.FlowMap.advance`."""
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, poll)
            if outcome is not Outcome.COMPLETE:
                return Advance(z, done, outcome)
        return Advance(z, n_periods, Outcome.COMPLETE)

    def settle(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        max_period: int,
        settled: float,
        same: float,
        near: float = 0.0,
        poll: Callable[[], None] | None = None,
    ) -> Approach:
        """Integrate the whole transient: the error of a period hides whether an orbit has closed.

        The orbit stays unknown (period 0); see `hpcsweep.solvers.flow.FlowMap.settle`.
        """
        del max_period, settled, same, near
        done = self.advance(state, amplitude, n_periods, poll)
        return Approach(done.state, done.n_periods, 0, 0, math.nan, done.outcome)

    def points(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
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
        poll: Callable[[], None] | None = None,
    ) -> Observation:
        """Integrate `n_periods` and gather points, contact set, drift and modal norms.

        With `growth` also the growth of a tangent vector, (1, ..., 1) at first; for that the window
        is integrated once more.
        """
        tally = _Tally(self.structure, modal_norm)
        points, outcome = self._collect(state, amplitude, n_periods, poll, tally.add)
        total = math.nan
        if growth and outcome is Outcome.COMPLETE:
            total = self._growth(state, amplitude, n_periods, poll)
        return Observation(
            points, tally.contact, tally.peak_drift, tally.modal_mean(), outcome, total
        )

    def _growth(self, state, amplitude, n_periods, poll):
        """Logarithm of the growth of a tangent vector; NaN if the solver fails."""
        size = 2 * self.structure.n_floors
        z = np.concatenate((np.asarray(state, dtype=float), np.full(size, size**-0.5)))
        logarithms = np.empty(n_periods)
        for period in range(n_periods):
            z, outcome = self._period(z, amplitude, poll, columns=1)
            if outcome is not Outcome.COMPLETE:
                return math.nan
            length = np.linalg.norm(z[size:])
            logarithms[period] = math.log(length) if length > 0 else -math.inf
            z[size:] /= length or 1.0
        return window_growth(logarithms)

    def monodromy(
        self, state: np.ndarray, amplitude: float, n_periods: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate with the tangent map; see `hpcsweep.solvers.flow.FlowMap.monodromy`.

        The 2n variational columns are integrated with the state, to the same tolerance.
        """
        size = 2 * self.structure.n_floors
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        z = np.concatenate((z, np.eye(size).ravel()))
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, None, columns=size)
            if outcome is not Outcome.COMPLETE:
                raise ArithmeticError(f"bdf: {outcome.name} in forcing period {done + 1}")
        return z[:size], z[size:].reshape(size, size)

    def _collect(self, state, amplitude, n_periods, poll, on_step):
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        points = points_array(n_periods, z.size)
        for done in range(n_periods):
            z, outcome = self._period(z, amplitude, poll, on_step)
            if outcome is not Outcome.COMPLETE:
                return points[:done], outcome
            points[done] = z
        return points, Outcome.COMPLETE

    def _equations(self, amplitude, columns):
        """Right-hand side and Jacobian for scipy, of the state with so many tangent columns."""
        beta, rho = self.structure.stiffness_ratio, self.structure.sharpness
        stiffness, damping = self._stiffness, self._damping
        size = 2 * self.structure.n_floors

        def derivative(tau, z):
            out = np.empty(size)
            return right_hand_side(
                tau, z, amplitude, self.omega, beta, rho, stiffness, damping, out
            )

        def matrix(_tau, z):
            return jacobian(z, beta, rho, stiffness, damping, np.empty((size, size)))

        def derivative_with_tangent(tau, z):
            product = matrix(tau, z[:size]) @ z[size:].reshape(size, columns)
            return np.concatenate((derivative(tau, z[:size]), product.ravel()))

        def matrix_with_tangent(tau, z):
            # the second derivative of the field is left out: Newton converges without it
            return np.kron(np.eye(columns + 1), matrix(tau, z[:size]))[order][:, order]

        # state first, then the tangent matrix row by row
        tail = size + np.arange(size * columns).reshape(columns, size).T.ravel()
        order = np.concatenate((np.arange(size), tail))
        if columns:
            return derivative_with_tangent, matrix_with_tangent
        return derivative, matrix

    def _period(self, z, amplitude, poll, on_step=None, columns=0):
        """Integrate one period; return the state (the old one after a failure) and an outcome."""
        if poll is not None:
            poll()
        derivative, matrix = self._equations(float(amplitude), columns)
        with np.errstate(all="ignore"):
            try:
                solver = BDF(
                    derivative,
                    0.0,
                    z,
                    self.period,
                    rtol=self.rtol,
                    atol=self.rtol * ABSOLUTE,
                    jac=matrix,
                )
                for step in range(1, MAX_STEPS + 1):
                    if poll is not None and step % POLL_STEPS == 0:
                        poll()
                    solver.max_step = self._step_limit(solver.t, solver.y, derivative)
                    solver.step()
                    if not np.all(np.isfinite(solver.y)):
                        return z, Outcome.NON_FINITE
                    if solver.status == "failed":
                        slope = derivative(solver.t, solver.y)
                        finite = np.all(np.isfinite(slope))
                        return z, Outcome.SOLVER_FAILED if finite else Outcome.NON_FINITE
                    if on_step is not None:
                        on_step(solver.dense_output(), solver.t_old, solver.t)
                    if solver.status == "finished":
                        return solver.y, Outcome.COMPLETE
            except (ValueError, np.linalg.LinAlgError, FloatingPointError, OverflowError):
                return z, Outcome.NON_FINITE
        return z, Outcome.STEP_LIMIT

    def _step_limit(self, tau, z, derivative):
        """Time in which a floor could reach its contact layer, or cross a part of it."""
        n = self.structure.n_floors
        past = z[:n] - STOP
        speed = z[n : 2 * n]
        gap = np.maximum(np.abs(past) - LAYER_HALF_WIDTH * self._layer, 0.0)
        # outside the layer only the motion towards it counts
        speed = np.where(gap > 0.0, np.maximum(-np.sign(past) * speed, 0.0), np.abs(speed))
        push = np.abs(derivative(tau, z)[n : 2 * n]) + 1.0
        room = gap + self._layer
        time = 2.0 * room / (speed + np.sqrt(speed**2 + 2.0 * push * room))
        seen = self._layer_step > self.rtol * np.maximum(speed, self.rtol)
        return float(np.where(seen, time, np.maximum(time, self.least_limit)).min())


class _Tally:
    """Maxima and means over the steps' interpolants."""

    def __init__(self, structure: Structure, modal_norm: bool):
        self.contact = 0
        self.peak_drift = 0.0
        self._modal_transform = structure.modal_transform
        self._n = structure.n_floors
        self._modal = np.zeros(self._n)
        self._free_time = 0.0
        self._modal_norm = modal_norm

    def add(self, interpolant, start: float, end: float) -> None:
        """Add one step."""
        n = self._n
        tau = np.linspace(start, end, STEP_NODES)
        z = interpolant(tau)
        drift = np.diff(z[:n], axis=0, prepend=np.zeros((1, STEP_NODES)))
        slope = np.diff(z[n:], axis=0, prepend=np.zeros((1, STEP_NODES)))
        self.peak_drift = max(self.peak_drift, float(np.abs(drift).max()))
        highest = z[:n].max(axis=1)
        for i, left in zip(*np.nonzero(z[n:, :-1] * z[n:, 1:] < 0), strict=True):
            top = _extremum(lambda t, i=i: interpolant(t)[[i, n + i]], *tau[left : left + 2])
            highest[i] = max(highest[i], top)
        for i, left in zip(*np.nonzero(slope[:, :-1] * slope[:, 1:] < 0), strict=True):

            def pair(t, i=i):
                now = interpolant(t)
                below = now[[i - 1, n + i - 1]] if i else 0.0
                return now[[i, n + i]] - below

            top = abs(_extremum(pair, *tau[left : left + 2]))
            self.peak_drift = max(self.peak_drift, float(top))
        for i in np.flatnonzero(highest >= STOP):
            self.contact |= 1 << int(i)
        if self._modal_norm:
            self._add_modal(interpolant, tau, z)

    def _add_modal(self, interpolant, tau, z):
        """Integrate |q_j| / ||q|| over the parts of a step in which no floor touches."""
        gap = STOP - z[: self._n].max(axis=0)
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
        """Mean modal norms, shape (n,); NaN where no floor was ever free of contact."""
        if not self._modal_norm or self._free_time == 0:
            return np.full(self._n, math.nan)
        return self._modal / self._free_time


def _extremum(value_and_slope, left: float, right: float) -> float:
    """Value where the slope vanishes between two times with slopes of different sign."""
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
