"""Compute runs that skip rules finish, many in one compiled call; see `runs` for the rules."""

from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED
from hpcsweep.dynamics.orbit import smallest_period
from hpcsweep.dynamics.stability import exponent_of_multiplier, orbit_exponent
from hpcsweep.dynamics.verification import verify_orbit
from hpcsweep.solvers.flow.flow_map import FlowMap
from hpcsweep.solvers.flow.orbit.batch import Rules
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.records import Followed, Orbits
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Poll, Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.classification import more_variables
from hpcsweep.studies.variables import EXPONENTS, NOT_TESTED, store

AT_ONCE = 256
"""Runs, at most, for whose results room is made."""
SLOW = 0.99
"""Multiplier above which a jump is verified: it accepts residuals of 1e-11, which a ghost has where
its map bends by more than (1 - multiplier)^2 / 4e-11; 46 of 40,000 jumps of 24 frames of the map of
the study as printed are above."""


class Batch:
    """Runs at one frequency, computed as long as skip rules finish them.

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
        result: Rows,
        first: int,
        amplitudes: np.ndarray,
        state: np.ndarray,
        follow: bool,
        poll: Poll,
    ) -> Followed:
        """Compute at most `AT_ONCE` runs from number `first` on, up to one that is left open.

        Parameters
        ----------
        result : dict of str to ndarray
            Arrays of `rows.empty_rows`.
        first : int
        amplitudes : ndarray, shape (k,)
        state : ndarray, shape (2n,)
            State from which the first of them starts.
        follow : bool
            Whether each other one starts from the end of the previous one.
        poll : callable, optional
            Called before each compiled call; may raise to leave.
        """
        ahead = amplitudes[first : first + AT_ONCE]
        jumps = "newton" in self._settings.skip
        followed = self._followed(ahead, state, follow, jumps, poll)
        ghost = self._ghost(followed.orbits, ahead, poll)
        if ghost is not None:
            # the runs before it; or it alone, without a jump
            ahead = ahead[: max(ghost, 1)]
            followed = self._followed(ahead, state, follow, jumps and ghost > 0, poll)
        done = slice(first, first + len(followed.orbits.rule))
        if done.stop > first:
            rows = {name: array[done] for name, array in result.items()}
            rows["skip_rule"][:] = followed.orbits.rule
            values = self._result(followed, amplitudes[done], poll)
            store(rows, self._solver.structure, self._solver.omega, amplitudes[done], values)
        return followed

    def _followed(self, amplitudes, state, follow: bool, jumps: bool, poll: Poll) -> Followed:
        settings = self._settings
        rules = Rules(
            settings.max_orbit_period,
            SETTLED,
            settings.period_tolerance,
            NEAR if jumps else 0.0,
            settings.transient_cycles,
            settings.sampling_cycles,
            follow,
        )
        norms = "modal_norm" in settings.metrics
        return self._solver.follow_orbits(
            amplitudes, state, rules, self._free, norms, settings.measures, poll
        )

    def _ghost(self, orbits: Orbits, amplitudes: np.ndarray, poll: Poll) -> int | None:
        """Return the first run that has jumped where no orbit is, near the ghost of a fold."""
        for k in np.flatnonzero(orbits.multiplier > SLOW).tolist():
            points, amplitude = orbits.points[k, : orbits.length[k]], float(amplitudes[k])
            if verify_orbit(self._solver, points, amplitude, len(points), poll=poll).orbit is None:
                return int(k)
        return None

    def _result(self, followed: Followed, amplitudes: np.ndarray, poll: Poll) -> dict[str, Any]:
        """Return the results of the orbits; those of motions without contact in closed form."""
        orbits, measures = followed.orbits, followed.measures
        units, same = self._solver.structure.state_units, self._settings.period_tolerance
        for run in np.flatnonzero(orbits.length > 1).tolist():
            points = orbits.points[run, : orbits.length[run]] / units
            orbits.period[run] = smallest_period(points, same)
        exponents = np.full(len(orbits.rule), np.nan)
        if "lyapunov" in self._settings.metrics:
            exponents = self._exponents(orbits, amplitudes)
        free = np.flatnonzero(orbits.rule == SkipRule.LINEAR)
        if self._free is not None and free.size:
            linear = self._free.orbit
            exponents[free] = linear.lyapunov_exponent
            orbits.peak_drift[free] = linear.peak_drift(amplitudes[free])
            if "modal_norm" in self._settings.metrics:
                for k in free:
                    orbits.modal_norm[k] = linear.modal_norm(amplitudes[k])
            if measures is not None:
                for name, values in vars(linear.measures(amplitudes[free])).items():
                    getattr(measures, name)[free] = values
        no_contact = orbits.contact == 0
        return {
            **self._more(orbits, amplitudes, poll),
            "orbit_period": orbits.period,
            "cycles": orbits.cycles,
            "final_state": orbits.points[np.arange(len(orbits.rule)), orbits.length - 1],
            "points": _last_points(orbits),
            "n_points": orbits.period,
            "contact": orbits.contact,
            "peak_drift": orbits.peak_drift,
            "modal_norm": orbits.modal_norm,
            "measures": measures,
            "motion": np.where(no_contact, MotionClass.NO_CONTACT, MotionClass.PERIODIC),
            "window_period": NOT_TESTED,
            **dict.fromkeys(EXPONENTS, exponents),
        }

    def _more(self, orbits: Orbits, amplitudes: np.ndarray, poll: Poll) -> dict[str, Any]:
        """Return the variables of rows and spectra of the orbits, where they are requested."""
        variables: dict[str, list] = {}
        for run, amplitude in enumerate(amplitudes.tolist()):
            points, period = orbits.points[run, : orbits.length[run]], int(orbits.period[run])
            values = more_variables(self._solver, amplitude, points, period, self._settings, poll)
            for name, value in values.items():
                variables.setdefault(name, []).append(value)
        return variables

    def _exponents(self, orbits: Orbits, amplitudes: np.ndarray) -> np.ndarray:
        """Return the largest Lyapunov exponent of each orbit, except of free motions."""
        times = orbits.length * self._solver.structure.forcing.period(self._solver.omega)
        # numpy's logarithm may differ in the last bit between machines
        exponents = np.array(
            [
                exponent_of_multiplier(multiplier, time)
                for multiplier, time in zip(orbits.multiplier.tolist(), times.tolist(), strict=True)
            ]
        )
        for k in np.flatnonzero(orbits.rule == SkipRule.CONVERGED):
            end = orbits.points[k, orbits.length[k] - 1]
            period = int(orbits.period[k])
            exponents[k] = orbit_exponent(self._solver, end, float(amplitudes[k]), period)
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
