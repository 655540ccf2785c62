"""Runs at one forcing frequency: what is computed at each amplitude, whatever study asks for it.

In one run `transient_cycles` forcing periods are discarded, `sampling_cycles` more are the
steady-state window. Rules that spare periods whose result is known (`skip`):

``linear``
    If no floor can reach the stop from the present state (`linear.LinearOrbit`, proved), the
    motion is the free linear one; once its transient has decayed, all results are closed form.
``converged``
    The transient ends when the orbit has closed on itself (`FlowMap.settle`): with p the period,
    e_k the distance between points p periods apart and r = e_k / e_(k-p) their ratio, the
    distance still to go is e r / (1 - r), which must be below `SETTLED` over two orbits in a
    row. The window is then one orbit, p forcing periods, which is all it holds.
``newton``
    While the orbit is still approached, from `NEAR` on, Newton's method with the exact tangent map
    jumps to it, if it is verified that the present state goes there (`flow.transient`).
    Orbits whose multipliers are close to the unit circle, which the window procedure leaves
    unsettled, are then verified.

What the window leaves open may be classified after it (`classification`).

A run that fails is data: its results are NaN, its outcome says why, and its final state is the
last one that was reached.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, cast

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED
from hpcsweep.dynamics.exponent import UNKNOWN, Interval
from hpcsweep.dynamics.orbit import smallest_period
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Observation, normalised_drift
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.solvers.solver import SOLVERS, Solver, make_solver
from hpcsweep.studies.settings import MEASURES, SweepSettings
from hpcsweep.studies.study import Amplitudes
from hpcsweep.studies.sweep.classification import Classification, classify_orbit, classify_window
from hpcsweep.studies.sweep.measures import empty_measures, store_measures

if TYPE_CHECKING:
    from hpcsweep.solvers.flow.flow_map import FlowMap


class FrameRuns:
    """Runs of one structure at one forcing frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    settings : SweepSettings
    solver : Solver, optional
        In place of one made by the settings.
    """

    def __init__(self, structure, omega: float, settings: SweepSettings, solver=None):
        self.structure, self.settings = structure, settings
        self._given = solver is not None
        self._measured: dict[float, FrameRuns] = {}
        made = settings.solver, structure, omega, settings.rtol
        self.solver: Solver = solver or make_solver(*made)
        self._free = None
        if "linear" in settings.skip:
            # here, where runs are computed: who only reads them loads no kernel
            from hpcsweep.solvers.free_motion import FreeMotion

            self._free = FreeMotion(
                structure,
                omega,
                settings.transient_cycles,
                settings.sampling_cycles,
                settings.period_tolerance,
            )
        self._path = None
        if "converged" in settings.skip and SOLVERS[settings.solver].follows_orbits:
            from hpcsweep.studies.sweep.batch import Batch

            self._path = Batch(cast("FlowMap", self.solver), settings, self._free)

    def follow(
        self,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Run amplitudes one after the other, each from where the one before ended.

        Parameters
        ----------
        amplitudes : sequence of k floats
            In the order in which they are followed.
        state : ndarray, shape (2n,)
            State at tau = 0 of the first run.
        poll : callable, optional
            Called before each run and within long ones; may raise to leave.

        Returns
        -------
        dict of str to ndarray
            The variables of `empty_rows`, first axis the k runs. The next stretch starts from
            ``final_state[-1]``, and gives exactly what one long stretch would have given.
        """
        return self._rows(amplitudes, state, poll, follow=True)

    def each(
        self,
        amplitudes: Amplitudes,
        state: np.ndarray,
        poll: Callable[[], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """Run amplitudes, each from the same state; otherwise as `follow`."""
        return self._rows(amplitudes, state, poll, follow=False)

    def _rows(self, amplitudes, state, poll, follow: bool) -> dict[str, np.ndarray]:
        """Run amplitudes, each measured by its own length (`Structure.lengths`)."""
        amplitudes = np.array(amplitudes, dtype=float)
        if self._given or not amplitudes.size:
            return self._stretch(amplitudes, state, poll, follow)
        lengths = self.structure.lengths(self.solver.omega, amplitudes)
        parts = []
        for at in np.split(np.arange(amplitudes.size), 1 + np.flatnonzero(np.diff(lengths))):
            runs = self._measured_by(float(lengths[at[0]]))
            parts.append(runs._stretch(amplitudes[at], state, poll, follow))
            state = parts[-1]["final_state"][-1] if follow else state
        if len(parts) == 1:
            return parts[0]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _measured_by(self, length: float) -> "FrameRuns":
        """Return the runs of the structure measured by a length; the last two are kept."""
        if length == self.structure.length_unit:
            return self
        if length not in self._measured:
            while len(self._measured) > 1:
                del self._measured[next(iter(self._measured))]
            structure = self.structure.measured_by(length)
            self._measured[length] = FrameRuns(structure, self.solver.omega, self.settings)
        return self._measured[length]

    def _stretch(self, amplitudes, state, poll, follow: bool) -> dict[str, np.ndarray]:
        """Run amplitudes from a state, or from where the one before ended."""
        result = empty_rows(self.structure, len(amplitudes), self.settings)
        start = np.array(state, dtype=float)
        index = 0
        while index < len(amplitudes):
            if self._path is None:
                if poll is not None:
                    poll()
                state = self._run(float(amplitudes[index]), start, result, index, poll)
            else:
                done = self._path.into(result, index, amplitudes, start, follow, poll)
                index, start = index + len(done.rule), done.state
                if done.open is None:
                    continue
                state = self._end(done.open, float(amplitudes[index]), result, index, poll)
            start = state if follow else start
            index += 1
        return result

    def _run(self, amplitude, z, result, index, poll):
        """Do one run into row `index` of `result`; return the state the next one starts from."""
        if self._free is not None:
            closed = self._free.window(z, amplitude)
            if closed is not None:
                exponent = Interval.exact(self._free.orbit.lyapunov_exponent)
                if self.settings.measures:
                    closed = replace(closed, measures=self._free.orbit.measures(amplitude)[0])
                told = Classification(closed, 1, exponent, MotionClass.NO_CONTACT)
                self._store(result, _row(result, index), index, amplitude, told, 0)
                result["skip_rule"][index] = SkipRule.LINEAR
                result["final_state"][index] = closed.points[-1]
                return closed.points[-1].copy()
        return self._end(self._transient(z, amplitude, poll), amplitude, result, index, poll)

    def _end(self, end: Approach, amplitude, result, index, poll):
        """Do what comes after the transient; see `_run`."""
        settings = self.settings
        row = _row(result, index)
        z, period = end.state, end.period
        cycles = end.n_periods + end.n_newton
        if period:
            jumped = not math.isnan(end.multiplier)
            result["skip_rule"][index] = SkipRule.NEWTON if jumped else SkipRule.CONVERGED
        if end.outcome is not Outcome.COMPLETE:
            return self._store_failure(result, row, index, z, cycles, end.outcome)
        window = period or settings.sampling_cycles
        growth = not period and bool("lyapunov" in result or settings.classify_cycles)
        seen = self.solver.observe(
            z,
            amplitude,
            window,
            "modal_norm" in settings.metrics,
            growth,
            poll,
            settings.measures,
        )
        cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            z = seen.points[-1].copy() if len(seen.points) else z
            return self._store_failure(result, row, index, z, cycles, seen.outcome)
        if period:
            seen, period = self._as_the_window_end(seen, end.n_periods, settings.period_tolerance)
            told = Classification(seen, period, UNKNOWN)
            if "lyapunov" in result or settings.classify_cycles:
                told = classify_orbit(self.solver, amplitude, seen, period, end.multiplier)
        else:
            told = classify_window(self.solver, amplitude, seen, settings, poll)
        self._store(result, row, index, amplitude, told, cycles)
        row["final_state"][:] = seen.points[-1]
        return seen.points[-1].copy()

    def _transient(self, z, amplitude, poll) -> Approach:
        """Integrate the transient, or what of it is needed."""
        settings = self.settings
        if "converged" not in settings.skip:
            done = self.solver.advance(z, amplitude, settings.transient_cycles, poll=poll)
            return Approach(done.state, done.n_periods, 0, 0, math.nan, done.outcome)
        return self.solver.settle(
            z,
            amplitude,
            settings.transient_cycles,
            settings.max_orbit_period,
            SETTLED,
            settings.period_tolerance,
            NEAR if "newton" in settings.skip else 0.0,
            poll,
        )

    def _as_the_window_end(self, seen: Observation, phase: int, same: float):
        """Return the points of an orbit in the order of the window procedure's last ones.

        Which of the p points of an orbit the next amplitude starts from can decide which
        attractor it reaches, so a run that was cut short must not end at another one.

        Returns
        -------
        seen : Observation
        period : int
            The smallest period of the points.
        """
        period = len(seen.points)
        if period == 1:
            return seen, 1
        smallest = smallest_period(seen.points / self.structure.state_units, same)
        whole_run = self.settings.transient_cycles + self.settings.sampling_cycles
        shift = (whole_run - phase - period) % period
        return replace(seen, points=np.roll(seen.points, -shift, axis=0)), smallest

    def _store(self, result, row, index, amplitude, told: Classification, cycles):
        seen, period = told.seen, told.period
        result["orbit_period"][index] = period
        result["cycles"][index] = cycles
        result["outcome"][index] = seen.outcome
        if "poincare" in result:
            n_points = min(period or len(seen.points), row["poincare"].shape[0])
            row["poincare"][:n_points] = seen.points[-n_points:]
            result["n_points"][index] = n_points
        if "contact" in result:
            result["contact"][index] = seen.contact
        if "drift" in result:
            result["drift"][index] = normalised_drift(seen.peak_drift, amplitude, self.solver.omega)
        if "modal_norm" in result:
            row["modal_norm"][:] = seen.modal_norm
        if seen.measures.size:
            own = {name: row[name][None] for name in MEASURES if name in row}
            store_measures(own, self.structure, seen.measures[None])
        if "lyapunov" in result:
            result["lyapunov"][index] = told.exponent.mean
        if "lyapunov_low" in result:
            result["lyapunov_low"][index] = told.exponent.low
            result["lyapunov_high"][index] = told.exponent.high
        if "window_period" in result:
            result["window_period"][index] = told.window_period
        if "motion" in result:
            result["motion"][index] = told.kind
            result["classification_cycles"][index] = told.cycles

    def _store_failure(self, result, row, index, z, cycles, outcome):
        result["cycles"][index] = cycles
        result["outcome"][index] = outcome
        if "motion" in result:
            result["motion"][index] = MotionClass.FAILED
        row["final_state"][:] = z
        return z


def _row(result: dict[str, np.ndarray], index: int) -> dict[str, np.ndarray]:
    """Return one row of the results that have more than a number in it."""
    return {name: array[index] for name, array in result.items() if array.ndim > 1}


def empty_rows(structure: Structure, n_runs: int, settings: SweepSettings) -> dict[str, np.ndarray]:
    """Allocate the results of `n_runs` runs, as for runs that all failed.

    Returns
    -------
    dict of str to ndarray
        The variables that `settings.metrics` asks for, first axis the run.
    """
    nan, n = math.nan, structure.n_floors
    arrays = {
        "orbit_period": np.zeros(n_runs, np.int32),
        "final_state": np.full((n_runs, 2 * n), nan),
        "cycles": np.zeros(n_runs, np.int32),
        "outcome": np.zeros(n_runs, np.int8),
        "skip_rule": np.zeros(n_runs, np.int8),
    }
    if "poincare" in settings.metrics:
        arrays["poincare"] = np.full((n_runs, settings.stored_points, 2 * n), nan)
        arrays["n_points"] = np.zeros(n_runs, np.int32)
    if "contact" in settings.metrics:
        arrays["contact"] = np.zeros(n_runs, np.uint64)
    if "drift" in settings.metrics:
        arrays["drift"] = np.full(n_runs, nan)
    if "modal_norm" in settings.metrics:
        arrays["modal_norm"] = np.full((n_runs, n), nan)
    arrays |= empty_measures(structure, n_runs, settings)
    if "lyapunov" in settings.metrics:
        arrays["lyapunov"] = np.full(n_runs, nan)
        if settings.classify_cycles is not None:
            arrays["lyapunov_low"] = np.full(n_runs, nan)
            arrays["lyapunov_high"] = np.full(n_runs, nan)
    if settings.classify_cycles is not None:
        arrays["window_period"] = np.zeros(n_runs, np.int32)
    if settings.classify_cycles:
        arrays["motion"] = np.zeros(n_runs, np.int8)
        arrays["classification_cycles"] = np.zeros(n_runs, np.int32)
    return arrays


@lru_cache(maxsize=4)
def frame_runs(structure: Structure, omega: float, settings: SweepSettings) -> FrameRuns:
    """Return the runs of a frame; the tables of the last few frames are kept."""
    return FrameRuns(structure, omega, settings)
