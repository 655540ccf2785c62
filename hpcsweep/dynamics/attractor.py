"""The motion that a state goes to; one attractor, and all at a point (structure, A, Omega)."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.stability import UNKNOWN, MeanInterval
from hpcsweep.model.observed import Measures
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation

UNDECIDED, FAILED, ELSEWHERE = -1, -2, -3
"""In place of an attractor's number; the last: one that is not listed."""


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
    interval : Interval
        Largest Lyapunov exponent per unit of time with its confidence interval, a point for an
        orbit; NaN if unknown.
    cycles : int
        Forcing periods integrated.
    outcome : Outcome
        Outcome of the solver.
    seen : Observation, optional
        The window, if it classified the motion, and the motion is not an orbit.
    families : int
        Multipliers of 1 along the family of an orbit of sliders, which are left out.
    """

    kind: MotionClass
    points: np.ndarray
    period: int = 0
    multiplier: float = math.nan
    interval: MeanInterval = UNKNOWN
    cycles: int = 0
    outcome: Outcome = Outcome.COMPLETE
    seen: Observation | None = None
    families: int = 0


@dataclass(frozen=True)
class Attractor:
    """One attractor.

    Attributes
    ----------
    kind : MotionClass
        PERIODIC, QUASI_PERIODIC or CHAOTIC.
    points : ndarray, shape (k, 2n)
        Stroboscopic points (gaps, gaps omega_0): the p points of an orbit in order, otherwise those
        of a long record.
    orbit_period : int
        p in forcing periods; 0 if the attractor is not an orbit.
    multiplier : float
        Modulus of the orbit's largest Floquet multiplier, otherwise NaN.
    lyapunov, lyapunov_low, lyapunov_high : float
        Largest Lyapunov exponent (omega_0), and its confidence interval.
    contact : int
        Contact set, bit k - 1 for contact k.
    drift : float
        Peak interstorey drift (18) in A / Omega^2; NaN without forcing.
    modal_norm : ndarray, shape (n,)
        Mean modal norms free of contact (17).
    hits : int
        Number of starts that reached it.
    share, share_low, share_high : float
        Share of all starts, and its Clopper-Pearson interval.
    measures : Measures or None
        As in `hpcsweep.solvers.records.Observation`.
    families : int
        Of sliders: in how many directions an orbit is one of a family, which is the attractor
        (`hpcsweep.dynamics.families`); points, peaks and multiplier are those of one member.
    sliders : dict
        ``ductility``, ``slider_energy``, ``plastic`` and ``shakedown``, as files have them;
        empty without sliders.
    """

    kind: MotionClass
    points: np.ndarray
    orbit_period: int
    multiplier: float
    lyapunov: float
    lyapunov_low: float
    lyapunov_high: float
    contact: int
    drift: float
    modal_norm: np.ndarray
    hits: int = 0
    share: float = 0.0
    share_low: float = 0.0
    share_high: float = 1.0
    measures: Measures | None = None
    families: int = 0
    sliders: dict[str, Any] = field(default_factory=dict)


class Found(list[Attractor]):
    """Attractors at a point, and what its starts told of transient chaos.

    Attributes
    ----------
    n_transient : int
        Starts that were transient chaos; they count for the attractors in which they ended.
    lifetime : Interval
        Mean lifetime of transient chaos in forcing periods, with its interval; NaN without any.
    """

    def __init__(self, attractors, n_transient: int, lifetime: MeanInterval):
        super().__init__(attractors)
        self.n_transient, self.lifetime = n_transient, lifetime


@dataclass(frozen=True)
class Portrait:
    """Attractors found at one point.

    Attributes
    ----------
    attractors : list of Attractor
        In the order in which they were found.
    labels : ndarray of int, shape (starts,)
        Index in `attractors` that each start reached, or `UNDECIDED` or `FAILED`.
    cycles : int
        Forcing periods integrated for starts and seeds, without the tests of neighbourhoods.
    outcome : Outcome
        COMPLETE if any start succeeded, otherwise the most frequent failure.
    n_transient : int
        Starts that were transient chaos, whatever they ended in.
    lifetime : Interval
        Mean lifetime of that in forcing periods; NaN without any.
    """

    attractors: list[Attractor]
    labels: np.ndarray
    cycles: int
    outcome: Outcome
    n_transient: int
    lifetime: MeanInterval
