"""Classify runs: by the motion of their windows, or by continuing them.

The window procedure takes a window for the motion. A motion that the window leaves open is
continued from its end, off the path, for at most `classify_cycles` forcing periods
(`dynamics.classify_motion`). Chaos is told only where it has outlived a number of them, since it
may be a transient (`runs.ON_PATH`). Points, contact set, drift, modal norms and exponent are then
those of the motion found; what the window shows is kept beside them. The next run starts from the
end of the window nevertheless.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hpcsweep.dynamics import stability
from hpcsweep.dynamics.attractor import Motion
from hpcsweep.dynamics.classify import CHAOS_GROWTH, MotionClass
from hpcsweep.dynamics.classify_motion import LONGEST, NEAR, SETTLED, classify_motion
from hpcsweep.dynamics.lyapunov import LyapunovSpectrum, spectrum_of_motion, spectrum_of_orbit
from hpcsweep.dynamics.orbit import closed_period, orbit_period
from hpcsweep.model.coordinates import coordinate_of
from hpcsweep.solvers.offers import CLOSING
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation, RowMotion
from hpcsweep.studies.blocks import Poll
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variables import NOT_TESTED

DIMENSIONS = ("kaplan_yorke", "kaplan_yorke_low", "kaplan_yorke_high")
"""Variables of the Kaplan-Yorke dimension and of its interval."""


@dataclass(frozen=True)
class Classification:
    """Classified motion of a run; other fields than `seen` and `exponent` are variables of it.

    Attributes
    ----------
    seen : Observation
        Over one orbit, if it is not longer than the job looks for; otherwise over a window.
    orbit_period : int
        Orbit period, 0 if there is none, or it is longer than the job looks for.
    exponent : Interval
        Largest Lyapunov exponent per unit of time.
    motion : MotionClass
    window_period : int
        Period that the window test finds; `NOT_TESTED` if there is no window.
    window_class : MotionClass
        What the window shows by itself; NOT_COMPUTED if there is no window.
    classification_cycles : int
        Forcing periods integrated to classify.
    """

    seen: Observation
    orbit_period: int
    exponent: stability.MeanInterval
    motion: MotionClass = MotionClass.UNDECIDED
    window_period: int = NOT_TESTED
    window_class: MotionClass = MotionClass.NOT_COMPUTED
    classification_cycles: int = 0


def classify_window(
    solver,
    amplitude: float,
    seen: Observation,
    settings: SweepSettings,
    outlived: int = 0,
    poll: Poll = None,
) -> Classification:
    """Classify the motion of a window, or of its continuation.

    Parameters
    ----------
    solver : Solver
    amplitude : float
    seen : Observation
        Of the window; with the growth of a tangent vector if exponents are requested or motions
        classified.
    settings : SweepSettings
    outlived : int
        Forcing periods that chaos must outlive before it is claimed.
    poll : callable, optional
        Called within long work; may raise to leave.
    """
    structure = solver.structure
    points = structure.without_drift(seen.points) / structure.state_units
    longest, same = settings.max_orbit_period, settings.period_tolerance
    window = orbit_period(points, longest, same)
    if not CLOSING.of(structure):
        return _classify_yielding(solver, amplitude, seen, settings, points, poll)
    if settings.classify_cycles:
        motion = classify_motion(
            solver,
            seen.points[-1],
            amplitude,
            settings,
            settings.classify_cycles,
            poll,
            seen,
            outlived,
        )
        shown = window_class(seen, window)
        if motion.kind not in (MotionClass.UNDECIDED, MotionClass.FAILED):
            classified = _classify_known(solver, amplitude, settings, motion, poll)
            if classified is not None:
                return replace(classified, window_period=window, window_class=shown)
        # an orbit is claimed only where it is verified
        kind = _kind(MotionClass.UNDECIDED, seen)
        return Classification(seen, 0, motion.interval, kind, window, shown, motion.cycles)
    period = window if settings.classify_cycles is None else closed_period(points, longest, same)
    exponent = stability.UNKNOWN
    if "lyapunov" in settings.metrics:
        if period:
            exponent = interval_of_orbit(solver, seen.points[-1], amplitude, period, settings)
        else:
            time = solver.structure.forcing.period(solver.omega)
            within = stability.growth_interval(stability.aligned(seen.logarithms)).times(1.0 / time)
            exponent = within._replace(mean=seen.growth / (len(seen.points) * time))
    return Classification(seen, period, exponent, window_period=window)


def _classify_yielding(
    solver, amplitude: float, seen: Observation, settings: SweepSettings, points, poll: Poll
) -> Classification:
    """Classify a window of a structure with sliders, or the orbit on which it closes later.

    No tangent vector is followed: what does not close is undecided.
    """
    longest, same = settings.max_orbit_period, settings.period_tolerance
    window, cycles, shown = orbit_period(points, longest, same), 0, MotionClass.NOT_COMPUTED
    period = window if settings.classify_cycles is None else closed_period(points, longest, same)
    if settings.classify_cycles:
        shown = window_class(seen, window)
        rules = settings.classify_cycles, LONGEST, SETTLED, same, NEAR
        end, period = solver.settle(seen.points[-1], amplitude, *rules, poll), 0
        cycles = end.n_periods
        if end.outcome is Outcome.COMPLETE and end.period:
            length = end.period if end.period <= longest else settings.sampling_cycles
            orbit = solver.observe(
                *(end.state, amplitude, length, "modal_norm" in settings.metrics),
                poll=poll,
                measures=settings.measures,
            )
            if orbit.outcome is Outcome.COMPLETE:
                seen, cycles, period = orbit, cycles + length, end.period
    kind = MotionClass.PERIODIC if period <= longest else MotionClass.LONG_PERIOD
    kind = _kind(kind if period else MotionClass.UNDECIDED, seen)
    exponent = interval_of_orbit(solver, seen.points[-1], amplitude, period, settings)
    period = period if period <= longest else 0
    return Classification(seen, period, exponent, kind, window, shown, cycles)


def window_class(seen: Observation, period: int) -> MotionClass:
    """Return the class of motion that a window shows by itself.

    Parameters
    ----------
    seen : Observation
    period : int
        After which its points repeat, 0 if they do not.

    Returns
    -------
    MotionClass
        Chaotic windows are those whose small differences grew by `CHAOS_GROWTH`; closed curves are
        not looked for.
    """
    if seen.is_free:
        return MotionClass.NO_CONTACT
    if period:
        return MotionClass.PERIODIC
    return MotionClass.CHAOTIC if seen.growth > CHAOS_GROWTH else MotionClass.UNDECIDED


def _classify_known(
    solver, amplitude: float, settings: SweepSettings, motion: Motion, poll
) -> Classification | None:
    """Observe the motion that was classified; None if the solver fails on it."""
    period = motion.period if motion.period <= settings.max_orbit_period else 0
    kind = MotionClass.LONG_PERIOD if motion.period > period else motion.kind
    cycles = motion.cycles
    length = period or settings.sampling_cycles
    seen = motion.seen
    norms, measures = "modal_norm" in settings.metrics, settings.measures
    if seen is None or len(seen.points) != length or (measures and not seen.measures):
        seen = solver.observe(
            motion.points[-1], amplitude, length, norms, poll=poll, measures=measures
        )
        cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return None
    return Classification(
        seen, period, motion.interval, _kind(kind, seen), classification_cycles=cycles
    )


def _kind(kind: MotionClass, seen: Observation) -> MotionClass:
    return MotionClass.NO_CONTACT if seen.is_free else kind


def interval_of_orbit(
    solver, z: np.ndarray, amplitude: float, period: int, settings: SweepSettings
) -> stability.MeanInterval:
    """Return the exponent of the orbit from z, if there is one and a job asks for it."""
    if not (period and "lyapunov" in settings.metrics):
        return stability.UNKNOWN
    return stability.MeanInterval.exact(stability.orbit_exponent(solver, z, amplitude, period))


def more_variables(
    solver, amplitude: float, points: np.ndarray, period: int, settings: SweepSettings, poll: Poll
) -> dict[str, Any]:
    """Return the variables of rows and of the Lyapunov spectrum of a motion, if requested.

    NaN where the solver fails. `points` are the last ones of the motion, at least one turn of its
    period, 0 if it has none.
    """
    values = {}
    if settings.rows:
        rows = [coordinate_of(solver.structure, word).row for word in settings.rows]
        try:
            asked = np.array(rows), settings.n_harmonics, poll
            seen = solver.rows_of(points[-period:], amplitude, *asked)
        except ArithmeticError:
            each = np.full((len(rows), settings.n_harmonics), math.nan)
            one = each[:, 0]
            seen = RowMotion(one, one, one, one, each, each)
        values = {f"row_{name}": value for name, value in seen._asdict().items()}
        values["row_range"] = seen.range
    if "lyapunov_spectrum" in settings.metrics:
        values |= _spectrum_variables(solver, amplitude, points, period, settings, poll)
    return values


def _spectrum_variables(solver, amplitude: float, points, period: int, settings, poll):
    """Return those of the spectrum."""
    try:
        if period:
            spectrum = spectrum_of_orbit(solver, points[-period:], amplitude)
        else:
            limits = settings.spectrum_error, settings.spectrum_cycles
            spectrum = spectrum_of_motion(solver, points[-1], amplitude, *limits, poll)
    except (ArithmeticError, np.linalg.LinAlgError):
        unknown = np.full(solver.structure.state_units.size, math.nan)
        spectrum = LyapunovSpectrum(unknown, unknown, stability.UNKNOWN, 0)
    return {
        "lyapunov_spectrum": spectrum.exponents,
        "lyapunov_spectrum_error": spectrum.errors,
        "spectrum_cycles": spectrum.n_periods,
        **dict(zip(DIMENSIONS, spectrum.dimension, strict=True)),
    }
