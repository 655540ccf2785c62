"""What a motion ends in: an orbit that is proved, chaos, a torus, or undecided.

An orbit is claimed where it has closed on itself or where Newton's method jumps to it
(`Solver.settle`). What does not close is observed with a tangent vector: the growth in each of
`WINDOWS` windows gives the largest exponent with its confidence interval, and its points tell a
torus (`hpcsweep.dynamics.classify`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from hpcsweep.dynamics.classify import CHAOS_GROWTH, MotionClass, classify_points
from hpcsweep.dynamics.orbit import orbit_period
from hpcsweep.dynamics.stability import floquet_multipliers
from hpcsweep.solvers.outcome import Outcome

SETTLED, NEAR = 1e-10, 1e-3
"""As `hpcsweep.studies.runs`."""
WINDOWS = 10
"""Windows by which an exponent is told, of the second half of `max_cycles` forcing periods."""
CONFIDENCE = 0.99


@dataclass(frozen=True)
class Motion:
    """What a motion ends in.

    Attributes
    ----------
    kind : MotionClass
        PERIODIC, QUASI_PERIODIC, CHAOTIC, UNDECIDED or FAILED.
    points : ndarray, shape (k, 2n)
        Of an orbit its points in order, of other motions those of the last window.
    period : int
        Of an orbit in forcing periods, else 0.
    multiplier : float
        Modulus of an orbit's largest Floquet multiplier, else NaN.
    exponent, exponent_low, exponent_high : float
        Largest Lyapunov exponent per unit time, and its confidence interval.
    cycles : int
        Forcing periods integrated.
    outcome : Outcome
    """

    kind: MotionClass
    points: np.ndarray
    period: int
    multiplier: float
    exponent: float
    exponent_low: float
    exponent_high: float
    cycles: int
    outcome: Outcome


def decide(
    solver,
    state: np.ndarray,
    amplitude: float,
    settings,
    max_cycles: int,
    poll: Callable[[], None] | None = None,
) -> Motion:
    """Decide what the motion from a state ends in.

    Parameters
    ----------
    solver : Solver
    state : ndarray, shape (2n,)
    amplitude : float
    settings : SweepSettings
        Its ``max_orbit_period`` and ``period_tolerance``.
    max_cycles : int
        Forcing periods after which a motion is left undecided.
    poll : callable, optional
        Called within long integrations; may raise to leave.
    """
    longest, same = settings.max_orbit_period, settings.period_tolerance
    window = max(max_cycles // (2 * WINDOWS), 2)
    transient = max(max_cycles - WINDOWS * window, 0)
    end = solver.settle(state, amplitude, transient, longest, SETTLED, same, NEAR, poll)
    cycles = end.n_periods + end.n_newton
    if end.outcome is not Outcome.COMPLETE:
        return _no_orbit(MotionClass.FAILED, end.state[None], cycles, end.outcome)
    if end.period:
        return _orbit(solver, end.state, amplitude, end.period, same, cycles)
    time = window * 2 * math.pi / solver.omega
    exponents, points, z = [], [], end.state
    for _ in range(WINDOWS):
        seen = solver.observe(z, amplitude, window, False, True, poll)
        cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            return _no_orbit(MotionClass.FAILED, z[None], cycles, seen.outcome)
        exponents.append(seen.growth / time)
        points.append(seen.points)
        z = seen.points[-1]
    mean, half = _interval(np.array(exponents))
    units = solver.structure.state_units
    kind = MotionClass.UNDECIDED
    period = orbit_period(points[-1] / units, window // 2, same)
    if period:
        end = solver.settle(z, amplitude, 40 * period, period, SETTLED, same, NEAR, poll)
        cycles += end.n_periods + end.n_newton
        if end.period:
            return _orbit(solver, end.state, amplitude, end.period, same, cycles)
    elif mean - half > 0 and mean * WINDOWS * time > CHAOS_GROWTH:
        kind = MotionClass.CHAOTIC
    elif abs(mean) <= half:
        kind = classify_points(points[-1] / units, 0.0, same)
    return Motion(
        kind,
        np.concatenate(points),
        0,
        math.nan,
        mean,
        mean - half,
        mean + half,
        cycles,
        Outcome.COMPLETE,
    )


def _interval(values: np.ndarray) -> tuple[float, float]:
    """Give the mean of windows and half its confidence interval, by Student's distribution."""
    error = values.std(ddof=1) / math.sqrt(values.size)
    return float(values.mean()), float(stdtrit(values.size - 1, 0.5 + CONFIDENCE / 2) * error)


def _no_orbit(kind: MotionClass, points: np.ndarray, cycles: int, outcome: Outcome) -> Motion:
    nan = math.nan
    return Motion(kind, points, 0, nan, nan, nan, nan, cycles, outcome)


def _orbit(solver, z, amplitude: float, period: int, same: float, cycles: int) -> Motion:
    """Go once round an orbit: its smallest period, points and multiplier."""
    points, outcome = solver.points(z, amplitude, period)
    cycles += len(points)
    if outcome is not Outcome.COMPLETE:
        return _no_orbit(MotionClass.FAILED, z[None], cycles, outcome)
    units = solver.structure.state_units
    for divisor in range(1, period + 1):
        turned = np.roll(points, -divisor, axis=0)
        if period % divisor == 0 and (np.abs(points - turned) / units).max() <= same:
            period = divisor
            break
    points = points[-period:]
    _, matrix = solver.monodromy(points[-1], amplitude, period)
    multiplier = float(abs(floquet_multipliers(matrix)[0]))
    time = period * 2 * math.pi / solver.omega
    exponent = math.log(multiplier) / time if multiplier > 0 else -math.inf
    kind = MotionClass.PERIODIC if multiplier < 1 else MotionClass.UNDECIDED
    return Motion(
        kind, points, period, multiplier, exponent, exponent, exponent, cycles, Outcome.COMPLETE
    )
