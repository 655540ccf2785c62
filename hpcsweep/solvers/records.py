"""Results of a solver over a stretch of forcing periods."""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from hpcsweep.model.observed import Measures
from hpcsweep.solvers.outcome import Outcome


@dataclass(frozen=True)
class Advance:
    """State after a number of forcing periods.

    Attributes
    ----------
    state : ndarray, shape (2n,)
        State at the end of the last completed period.
    n_periods : int
        Number of periods integrated.
    outcome : Outcome
        COMPLETE, or why it ended early.
    """

    state: np.ndarray
    n_periods: int
    outcome: Outcome


@dataclass(frozen=True)
class Approach:
    """End of a transient.

    Attributes
    ----------
    state : ndarray, shape (2n,)
        State at the end; after a jump the point of the orbit.
    n_periods : int
        Forcing periods of the motion until then.
    n_newton : int
        Further forcing periods, integrated to jump.
    period : int
        Orbit period in forcing periods, 0 if the orbit is unknown.
    multiplier : float
        Modulus of the orbit's largest Floquet multiplier after a jump, else NaN.
    outcome : Outcome
        COMPLETE, or why it ended early.
    """

    state: np.ndarray
    n_periods: int
    n_newton: int
    period: int
    multiplier: float
    outcome: Outcome


class Orbits(NamedTuple):
    """Results of k consecutive runs that skip rules finish.

    Attributes
    ----------
    rule : ndarray of int, shape (k,)
        A `SkipRule`.
    length, period : ndarray of int
        Forcing periods of the orbit as integrated; the caller may find its points to repeat sooner.
    cycles : ndarray of int
        Forcing periods integrated.
    multiplier : ndarray
        Modulus of the largest Floquet multiplier over `length` after a jump, else NaN.
    points : ndarray, shape (k, max_period, 2n)
        The first `length` of each row are the orbit, in the order of the window procedure's last
        points; others are NaN.
    contact : ndarray of uint64
        As in `Observation`; also `peak_drift` and `modal_norm`, shape (k, n), which are NaN here
        for motions free of contact.
    peaks, impacts : ndarray
        As in a `Tally`; empty unless requested.
    """

    rule: np.ndarray
    length: np.ndarray
    period: np.ndarray
    cycles: np.ndarray
    multiplier: np.ndarray
    points: np.ndarray
    contact: np.ndarray
    peak_drift: np.ndarray
    modal_norm: np.ndarray
    peaks: np.ndarray
    impacts: np.ndarray


@dataclass(frozen=True)
class Followed:
    """Results of consecutive runs.

    Attributes
    ----------
    orbits : Orbits
        Runs that skip rules finish, up to the first that they leave open.
    measures : Measures or None
        Of each run, first axis k; None unless requested.
    state : ndarray, shape (2n,)
        State from which the next run starts.
    open : Approach or None
        End of the transient of the run left open; None if there is none.
    """

    orbits: Orbits
    measures: Measures | None
    state: np.ndarray
    open: Approach | None


@dataclass(frozen=True)
class Observation:
    """Results over a window of forcing periods; maxima are over continuous time.

    Attributes
    ----------
    points : ndarray, shape (k, 2n)
        Stroboscopic points z(T), ..., z(kT); k is less than requested only after a failure. With L
        sliders states are (u, u', p), of size 2n + L.
    contact : int
        Bit i - 1 is set if u_i >= 1 at any time of the window.
    peak_drift : float
        max over floors and time of |u_i - u_{i-1}|, u_0 = 0, in gaps.
    modal_norm : ndarray, shape (n,)
        Mean of |q_j| / ||q|| (17) over the time in which no floor touches; NaN if there is none
        or if it was not requested.
    outcome : Outcome
        COMPLETE, or why it ended early.
    growth : float
        Natural logarithm of the factor by which a tangent vector grows over the window
        (`window_growth`); NaN unless it was requested.
    logarithms : ndarray, shape (k,)
        Natural logarithm of that factor in each forcing period; empty unless it was requested.
    measures : Measures or None
        Those that the flags (`hpcsweep.model.observed`) do not request are 0; None if none is
        requested.
    slid : dict of str to ndarray, shape (L,)
        Of each slider, if there are any: ``ductility``, its largest elongation over that at which
        it first slips; ``slider_energy``, what it dissipates a forcing period; ``plastic``,
        the growth of its lasting elongation a forcing period; ``excursions``, how often it slips,
        and ``slipping``, at the end of how many periods it does.
    direction : ndarray, shape (2n,), optional
        As in `Growth`, where it can go on.
    """

    points: np.ndarray
    contact: int
    peak_drift: float
    modal_norm: np.ndarray
    outcome: Outcome
    growth: float = math.nan
    logarithms: np.ndarray = field(default_factory=lambda: np.empty(0))
    measures: Measures | None = None
    slid: dict[str, np.ndarray] = field(default_factory=dict)
    direction: np.ndarray | None = None

    @property
    def is_free(self) -> bool:
        """Whether no contact has closed and no slider has slipped."""
        return not self.contact and not np.any(self.slid.get("slider_energy", 0.0))


@dataclass(frozen=True)
class Growth:
    """Stroboscopic points and growth of a tangent vector, without the rest of an `Observation`.

    Attributes
    ----------
    points, outcome, logarithms
        As in `Observation`.
    direction : ndarray, shape (2n,)
        The tangent vector at the end, with which the next stretch continues.
    """

    points: np.ndarray
    outcome: Outcome
    logarithms: np.ndarray
    direction: np.ndarray

    @property
    def growth(self) -> float:
        """As in `Observation`."""
        return window_growth(self.logarithms)

    def followed_by(self, more: "Growth") -> "Growth":
        """Append a stretch that continues this one."""
        points = np.concatenate((self.points, more.points))
        logarithms = np.concatenate((self.logarithms, more.logarithms))
        return replace(more, points=points, logarithms=logarithms)

    def last(self, n_periods: int) -> "Growth":
        """Return the last `n_periods`."""
        points, logarithms = self.points[-n_periods:], self.logarithms[-n_periods:]
        return replace(self, points=points, logarithms=logarithms)


class RowMotion(NamedTuple):
    """What rows y = d . u of the displacements do over forcing periods, shape (r,) each.

    Attributes
    ----------
    low, high : ndarray
        Smallest and largest value.
    mean, rms : ndarray
        Means of y, and the root of that of y^2.
    amplitude, phase : ndarray, shape (r, H)
        a and phi of the harmonics a sin(h Omega tau + phi), h = 1 .. H, as those of the forcing.
    """

    low: np.ndarray
    high: np.ndarray
    mean: np.ndarray
    rms: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray

    @property
    def range(self) -> np.ndarray:
        """Half peak-to-peak."""
        return 0.5 * (self.high - self.low)


def window_growth(logarithms: np.ndarray) -> float:
    """Return the growth of a tangent vector over a window from its growth in each period.

    The vector first turns into the direction of largest growth: the first tenth of the window is
    dropped, and the growth of the rest is taken for all of it. Over the time of the window it is
    the largest Lyapunov exponent (Benettin et al., Meccanica 15 (1980) 9), to about 1 / (k T).

    Parameters
    ----------
    logarithms : ndarray, shape (k,)
        Logarithms of the factor in each forcing period; without any the growth is NaN.
    """
    if not len(logarithms):
        return math.nan
    return float(logarithms[len(logarithms) // 10 :].mean() * len(logarithms))


def normalised_drift(peak_drift, amplitude, omega: float):
    """Return peak drifts in units of A / Omega^2, one or many; NaN at A = 0."""
    size = np.abs(amplitude)
    return peak_drift * (omega**2 / np.where(size > 0, size, math.nan))
