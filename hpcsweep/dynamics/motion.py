"""The motion that a state goes to."""

from dataclasses import dataclass

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.exponent import Interval
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation


@dataclass(frozen=True)
class Motion:
    """The motion that a state goes to.

    Attributes
    ----------
    kind : MotionClass
        PERIODIC, QUASI_PERIODIC, CHAOTIC, UNDECIDED or FAILED.
    points : ndarray, shape (k, 2n)
        The p points of an orbit in order; the last observed points of other motions.
    period : int
        Orbit period p in forcing periods, 0 for other motions.
    multiplier : float
        Modulus of the orbit's largest Floquet multiplier; NaN for other motions.
    exponent, exponent_low, exponent_high : float
        Largest Lyapunov exponent per unit of time with its confidence interval, a point for an
        orbit; NaN if unknown.
    cycles : int
        Forcing periods integrated.
    outcome : Outcome
        Outcome of the solver.
    seen : Observation, optional
        The window, if it classified the motion, and the motion is not an orbit.
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
    seen: Observation | None = None

    @property
    def interval(self) -> Interval:
        """Exponent with its interval."""
        return Interval(self.exponent, self.exponent_low, self.exponent_high)
