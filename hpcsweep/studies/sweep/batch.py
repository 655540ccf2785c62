"""Runs that rules settle, many in one call, and their results; see `runs` for the rules."""

from collections.abc import Callable

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED
from hpcsweep.dynamics.stability import exponent_of_multiplier
from hpcsweep.solvers.flow.flow_map import FlowMap
from hpcsweep.solvers.flow.orbit.batch import Rules
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.linear import LinearOrbit
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Orbits, normalised_drift
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.classification import NOT_TESTED, exponent_of_orbit
from hpcsweep.studies.sweep.measures import store_measures

AT_ONCE = 256
"""Runs, at most, for whose results room is made."""


class Batch:
    """Does runs at one frequency as long as rules settle them.

    Parameters
    ----------
    solver : FlowMap
    settings : SweepSettings
    free : FreeMotion, optional
        The rule ``linear``.
    """

    def __init__(self, solver: FlowMap, settings: SweepSettings, free: FreeMotion | None):
        self._solver, self._settings, self._free = solver, settings, free

    def into(
        self,
        result: dict[str, np.ndarray],
        first: int,
        amplitudes: np.ndarray,
        state: np.ndarray,
        follow: bool,
        poll: Callable[[], None] | None,
    ) -> Orbits:
        """Do `AT_ONCE` runs from number `first` on, or fewer, up to one that is left open.

        Parameters
        ----------
        result : dict of str to ndarray
            Of `runs.empty_rows`.
        first : int
        amplitudes : ndarray, shape (k,)
        state : ndarray, shape (2n,)
            From which the first of them starts.
        follow : bool
            Whether the others start from where the one before ended.
        poll : callable, optional
            Called before each piece of work; may raise to leave.
        """
        settings = self._settings
        rules = Rules(
            settings.max_orbit_period,
            SETTLED,
            settings.period_tolerance,
            NEAR if "newton" in settings.skip else 0.0,
            settings.transient_cycles,
            settings.sampling_cycles,
            follow,
        )
        orbits = self._solver.follow_orbits(
            amplitudes[first : first + AT_ONCE],
            state,
            rules,
            self._free,
            "modal_norm" in settings.metrics,
            settings.measures,
            poll,
        )
        rows = slice(first, first + len(orbits.rule))
        if rows.stop > first:
            part = {name: array[rows] for name, array in result.items()}
            self._store(part, orbits, amplitudes[rows])
        return orbits

    def _store(self, rows: dict[str, np.ndarray], orbits: Orbits, amplitudes: np.ndarray) -> None:
        rows["orbit_period"][:] = orbits.period
        rows["cycles"][:] = orbits.cycles
        rows["outcome"][:] = Outcome.COMPLETE
        each = np.arange(len(orbits.rule))
        rows["final_state"][:] = orbits.points[each, orbits.length - 1]
        rows["skip_rule"][:] = orbits.rule
        if "poincare" in rows:
            rows["n_points"][:] = orbits.period
            longest = min(orbits.points.shape[1], rows["poincare"].shape[1])
            rows["poincare"][:, :longest] = _last_points(orbits)[:, :longest]
        if "contact" in rows:
            rows["contact"][:] = orbits.contact
        if "drift" in rows:
            rows["drift"][:] = normalised_drift(orbits.peak_drift, amplitudes, self._solver.omega)
        if "modal_norm" in rows:
            rows["modal_norm"][:] = orbits.modal_norm
        if "lyapunov" in rows:
            rows["lyapunov"][:] = self._exponents(orbits, amplitudes)
        if orbits.measures.shape[1]:
            measures = orbits.measures
            free = orbits.rule == SkipRule.LINEAR
            if self._free is not None and free.any():
                measures = measures.copy()
                measures[free] = self._free.orbit.measures(amplitudes[free])
            store_measures(rows, self._solver.structure, measures)
        if self._free is not None:
            free = np.flatnonzero(orbits.rule == SkipRule.LINEAR)
            self._store_free(rows, free, amplitudes, self._free.orbit)
        if "lyapunov_low" in rows:
            rows["lyapunov_low"][:] = rows["lyapunov_high"][:] = rows["lyapunov"]
        if "window_period" in rows:
            rows["window_period"][:] = NOT_TESTED
        if "motion" in rows:
            no_contact = orbits.contact == 0
            rows["motion"][:] = np.where(no_contact, MotionClass.NO_CONTACT, MotionClass.PERIODIC)

    def _store_free(
        self, rows: dict[str, np.ndarray], free, amplitudes, orbit: LinearOrbit
    ) -> None:
        """Store what is known in closed form of the motions without contact, of numbers `free`."""
        if "drift" in rows:
            peak = orbit.peak_drift(amplitudes[free])
            rows["drift"][free] = normalised_drift(peak, amplitudes[free], self._solver.omega)
        if "modal_norm" in rows:
            for k in free:
                rows["modal_norm"][k] = orbit.modal_norm(amplitudes[k])
        if "lyapunov" in rows and free.size:
            rows["lyapunov"][free] = orbit.lyapunov_exponent

    def _exponents(self, orbits: Orbits, amplitudes: np.ndarray) -> np.ndarray:
        """Return the largest Lyapunov exponent of each orbit; not of free motions."""
        times = orbits.length * self._solver.structure.forcing.period(self._solver.omega)
        # not by numpy, whose logarithm may differ in the last bit from machine to machine
        exponents = np.array(
            [
                exponent_of_multiplier(multiplier, time)
                for multiplier, time in zip(orbits.multiplier.tolist(), times.tolist(), strict=True)
            ]
        )
        for k in np.flatnonzero(orbits.rule == SkipRule.CONVERGED):
            end = orbits.points[k, orbits.length[k] - 1]
            period = int(orbits.period[k])
            exponents[k] = exponent_of_orbit(self._solver, end, float(amplitudes[k]), period)
        return exponents


def _last_points(orbits: Orbits) -> np.ndarray:
    """Return the last `period` points of each orbit, (k, max_period, 2n); others are NaN."""
    points = orbits.points
    turned = orbits.length != orbits.period
    if turned.any():
        points = points.copy()
        for k in np.flatnonzero(turned):
            length, period = orbits.length[k], orbits.period[k]
            points[k, :period] = orbits.points[k, length - period : length]
            points[k, period:] = np.nan
    return points
