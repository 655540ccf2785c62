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
    jumps to it, if it is proved that the present state goes there (`flow.transient`).
    Orbits whose multipliers are close to the unit circle, which the plain procedure leaves
    unsettled, are then decided.

A run that fails is data: its results are NaN, its outcome says why, and its final state is the
last one that was reached.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from hpcsweep.dynamics.orbit import orbit_period
from hpcsweep.dynamics.stability import exponent_of_multiplier, orbit_exponent
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Observation
from hpcsweep.solvers.solver import SOLVERS, Solver, make_solver
from hpcsweep.studies.settings import METRICS, SweepSettings
from hpcsweep.studies.shortcut import Shortcut
from hpcsweep.studies.study import Amplitudes

SETTLED = 1e-10
"""Largest estimated distance (gaps, gaps omega_0) from the orbit at which a transient ends."""
NEAR = 1e-3
"""Distance between points a period apart from which on a jump is tried."""


class FrameRuns:
    """Runs of one structure at one forcing frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    settings : SweepSettings
    """

    def __init__(self, structure: Structure, omega: float, settings: SweepSettings):
        self.structure = structure
        self.settings = settings
        self.solver: Solver = make_solver(settings.solver, structure, omega, settings.rtol)
        self._drift_scale = omega**2
        self._linear = None
        if "linear" in settings.skip:
            # here and in `warm_up`, where runs are computed: who only reads them loads no kernel
            from hpcsweep.solvers.linear import LinearOrbit

            self._linear = LinearOrbit(structure, omega)

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
        """Run amplitudes from a state, or from where the one before ended."""
        result = empty_rows(self.structure.n_floors, len(amplitudes), self.settings)
        start = np.array(state, dtype=float)
        for index, amplitude in enumerate(amplitudes):
            if poll is not None:
                poll()
            end = self._run(float(amplitude), start, result, index, poll)
            start = end if follow else start
        return result

    def _run(self, amplitude, z, result, index, poll):
        """Do one run into row `index` of `result`; return the state the next one starts from."""
        settings = self.settings
        row = {name: array[index] for name, array in result.items() if array.ndim > 1}
        if self._linear is not None:
            closed = self._linear.steady_window(
                z,
                amplitude,
                settings.transient_cycles,
                settings.sampling_cycles,
                settings.period_tolerance,
            )
            if closed is not None:
                self._store(result, row, index, amplitude, closed, 1, 0)
                result["shortcut"][index] = Shortcut.LINEAR
                if "lyapunov" in result:
                    result["lyapunov"][index] = self._linear.lyapunov_exponent
                return closed.points[-1].copy()
        end = self._transient(z, amplitude, poll)
        z, period = end.state, end.period
        cycles = end.n_periods + end.n_newton
        jumped = not math.isnan(end.multiplier)
        if period:
            result["shortcut"][index] = Shortcut.NEWTON if jumped else Shortcut.CONVERGED
        if end.outcome is not Outcome.COMPLETE:
            return self._store_failure(result, row, index, z, cycles, end.outcome)
        window = period or settings.sampling_cycles
        growth = "lyapunov" in result and not period
        seen = self.solver.observe(
            z, amplitude, window, "modal_norm" in settings.metrics, growth, poll
        )
        cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            z = seen.points[-1].copy() if len(seen.points) else z
            return self._store_failure(result, row, index, z, cycles, seen.outcome)
        if period:
            seen, period = self._as_the_plain_end(seen, end.n_periods, settings.period_tolerance)
        else:
            points = seen.points / self.structure.state_units
            period = orbit_period(points, settings.max_orbit_period, settings.period_tolerance)
        self._store(result, row, index, amplitude, seen, period, cycles)
        if "lyapunov" in result:
            time = window * 2 * math.pi / self.solver.omega
            if jumped:
                exponent = exponent_of_multiplier(end.multiplier, time)
            elif period:
                exponent = self._orbit_exponent(seen.points[-1], amplitude, period)
            else:
                exponent = seen.growth / time
            result["lyapunov"][index] = exponent
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

    def _as_the_plain_end(self, seen: Observation, phase: int, same: float):
        """Give the points of an orbit in the order of the plain procedure's last ones.

        Which of the p points of an orbit the next amplitude starts from can decide which
        attractor it reaches, so a run that was cut short must not end at another one.

        Returns
        -------
        seen : Observation
        period : int
            The smallest period of the points.
        """
        points = seen.points
        period = len(points)
        if period == 1:
            return seen, 1
        for divisor in range(1, period):
            if period % divisor:
                continue
            apart = np.abs(points - _turned(points, divisor)) / self.structure.state_units
            if apart.max() <= same:
                period = divisor
                break
        plain = self.settings.transient_cycles + self.settings.sampling_cycles
        shift = (plain - phase - len(points)) % len(points)
        return replace(seen, points=_turned(points, shift)), period

    def _orbit_exponent(self, z, amplitude, period):
        """Largest Lyapunov exponent of the orbit from z; NaN where the solver fails."""
        try:
            return orbit_exponent(self.solver, z, amplitude, period)
        except (ArithmeticError, np.linalg.LinAlgError):
            return math.nan

    def _store(self, result, row, index, amplitude, seen: Observation, period, cycles):
        result["orbit_period"][index] = period
        result["cycles"][index] = cycles
        result["outcome"][index] = seen.outcome
        row["final_state"][:] = seen.points[-1]
        if "poincare" in result:
            n_points = min(period or len(seen.points), row["poincare"].shape[0])
            row["poincare"][:n_points] = seen.points[-n_points:]
            result["n_points"][index] = n_points
        if "contact" in result:
            result["contact"][index] = seen.contact
        if "drift" in result:
            scale = self._drift_scale / abs(amplitude) if amplitude else math.nan
            result["drift"][index] = seen.peak_drift * scale
        if "modal_norm" in result:
            row["modal_norm"][:] = seen.modal_norm

    def _store_failure(self, result, row, index, z, cycles, outcome):
        result["cycles"][index] = cycles
        result["outcome"][index] = outcome
        row["final_state"][:] = z
        return z


def _turned(points: np.ndarray, by: int) -> np.ndarray:
    """Let the points of an orbit begin with number `by`."""
    return np.concatenate((points[by:], points[:by]))


def empty_rows(n: int, n_runs: int, settings: SweepSettings) -> dict[str, np.ndarray]:
    """Allocate the results of `n_runs` runs, as for runs that all failed.

    Returns
    -------
    dict of str to ndarray
        The variables that `settings.metrics` asks for, first axis the run.
    """
    nan = math.nan
    arrays = {
        "orbit_period": np.zeros(n_runs, np.int32),
        "final_state": np.full((n_runs, 2 * n), nan),
        "cycles": np.zeros(n_runs, np.int32),
        "outcome": np.zeros(n_runs, np.int8),
        "shortcut": np.zeros(n_runs, np.int8),
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
    if "lyapunov" in settings.metrics:
        arrays["lyapunov"] = np.full(n_runs, nan)
    return arrays


@lru_cache(maxsize=4)
def frame_runs(structure: Structure, omega: float, settings: SweepSettings) -> FrameRuns:
    """Give the runs of a frame; the tables of the last few frames are kept."""
    return FrameRuns(structure, omega, settings)


def is_compiled(settings: SweepSettings) -> bool:
    """Tell whether the cache is known to have what runs with these settings call."""
    from hpcsweep.kernels.warm import missing

    SOLVERS[settings.solver].load()
    return settings.solver == "flow" and not missing()


def warm_up(
    settings: SweepSettings,
    say: Callable[[str], None] | None = None,
    jobs: int | None = None,
) -> None:
    """Compile what runs with these settings call, or load it from the disk, by a few periods.

    Parameters
    ----------
    settings : SweepSettings
    say : callable, optional
        Told how far the compilation has come, if there is anything to compile.
    jobs : int, optional
        Processes that compile; default one for each processor at hand.
    """
    import hpcsweep.model.linalg  # noqa: F401  before a kernel loads scipy, and all of numpy
    from hpcsweep.kernels.warm import load_all, processors
    from hpcsweep.studies.compilation import Report

    SOLVERS[settings.solver].load()
    if settings.solver == "flow":
        tell = None if say is None else Report(say)
        load_all(tell, processors() if jobs is None else jobs)
    solver = make_solver(settings.solver, Structure(1, 10.0), 1.0, settings.rtol)
    z = np.zeros(2)
    if "converged" in settings.skip:
        solver.settle(z, 1.0, 1, 1, SETTLED, SETTLED)
    else:
        solver.advance(z, 1.0, 1)
    solver.observe(z, 1.0, 1)
    if "lyapunov" in settings.metrics:
        solver.observe(z, 1.0, 1, growth=True)
        solver.monodromy(z, 1.0, 1)


def warm_up_all(say: Callable[[str], None] | None = None, jobs: int | None = None) -> None:
    """Compile what runs of any settings call, or load it from the disk."""
    for name in SOLVERS:
        warm_up(SweepSettings(solver=name, metrics=frozenset(METRICS)), say, jobs)
