"""The solver `flow`: the kernels of this package behind the interface of `solvers.solver`."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from hpcsweep.model.frame import Frame
from hpcsweep.model.kernel_model import kernel_model
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.march import march, march_observed
from hpcsweep.solvers.flow.shared import SHARED, WATCH, new_shared, new_watch
from hpcsweep.solvers.flow.tally import empty_tally
from hpcsweep.solvers.flow.transient import end_of_transient
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Advance, Approach, Observation, window_growth

MAX_STEPS = 2_000_000
"""Cap of steps in one forcing period."""
LAYER_TOLERANCE = 1e-5
"""Error allowed a step inside a layer, per relative tolerance asked of a period (measured on
random states: a period has up to some thousand such steps, and passages amplify errors)."""
POLL_PERIODS = 2000
"""Forcing periods between two polls, some tens of milliseconds."""


def _between_polls(n_periods: int, poll: Callable[[], None] | None) -> Iterator[tuple[int, int]]:
    """Cut `n_periods` into stretches (first, last), before each of which `poll` is called."""
    if poll is None:
        yield 0, n_periods
        return
    poll()
    for first in range(0, n_periods, POLL_PERIODS):
        if first:
            poll()
        yield first, min(first + POLL_PERIODS, n_periods)


class FlowMap:
    """Advance states of one structure at one frequency by the exact flow.

    Parameters
    ----------
    structure : Structure
    omega : float
        Forcing frequency Omega.
    rtol : float
        Relative error asked of a period; sets the tolerance inside the layers. The linear
        motion and the fast passages are exact to about 1e-12 whatever is asked.

    Attributes
    ----------
    counts : ndarray of int, shape (4,)
        Linear steps, fast passages, layer steps and layer visits so far.
    """

    def __init__(self, structure: Structure, omega: float, rtol: float = 1e-9):
        self.structure = structure
        self.omega = float(omega)
        self.rtol = float(rtol)
        model = kernel_model(structure, self.omega)
        self._frame = Frame(structure, model)
        tolerance = min(LAYER_TOLERANCE * self.rtol, 1e-9)
        self._shared = new_shared(model, tolerance, MAX_STEPS)
        self._packed = SHARED.pack(self._shared)
        self._watch = new_watch(self._frame.size // 2, 1)
        self._packed_watch = WATCH.pack(self._watch)
        self.counts = self._shared.counts

    @property
    def n_tables(self) -> int:
        """Contact sets for which propagators are kept now."""
        return int(self._shared.tables.count[0])

    def advance(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> Advance:
        """Integrate `n_periods` forcing periods from tau = 0 (mod T).

        Parameters
        ----------
        state : ndarray, shape (2n,)
        amplitude : float
            A.
        n_periods : int
        poll : callable, optional
            Called before the work, and every `POLL_PERIODS`.
        """
        z = self._frame.into(state)
        done, outcome = 0, int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll):
            more, outcome = self._march(z, amplitude, last - first, self._shared.no_points)
            done += more
            if outcome != Outcome.COMPLETE:
                break
        return Advance(self._frame.out_of(z), done, Outcome(outcome))

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
        """Advance until the orbit is known, for at most `n_periods`; see `transient`.

        Parameters
        ----------
        state : ndarray, shape (2n,)
        amplitude : float
            A.
        n_periods, max_period : int
            Of the transient, and of the orbit, at most.
        settled, same : float
            Distance (gaps, gaps omega_0: the units of the structure) from the orbit, and between
            points that count as one.
        near : float
            Distance between points a period apart from which on Newton's method tries to jump to
            the orbit; 0: never.
        poll : callable, optional
            Called before the work, and every `POLL_PERIODS`.
        """
        z = self._frame.into(state)
        watch = self._watch
        if watch.close.size != max_period + 1:
            watch = self._watch = new_watch(z.size // 2, max_period)
            self._packed_watch = WATCH.pack(watch)
        watch.since[0] = 0
        done = newton = period = 0
        multiplier = math.nan
        outcome = int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll):
            more, by_newton, period, multiplier, near, outcome = end_of_transient(
                self._packed,
                self._packed_watch,
                z,
                float(amplitude) / self._frame.amplitude_unit,
                last - first,
                (int(max_period), float(settled), float(same), float(near)),
            )
            done += more
            newton += by_newton
            if period or outcome != Outcome.COMPLETE:
                break
        state = self._frame.out_of(z)
        return Approach(state, done, newton, period, multiplier, Outcome(outcome))

    def points(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> tuple[np.ndarray, Outcome]:
        """Return the stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n)."""
        return self._points(state, amplitude, n_periods, poll)

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

        With `growth` also the growth of a tangent vector, (1, ..., 1) at first.
        """
        n = self.structure.n_floors
        tally = empty_tally(n, modal_norm)
        tangent = logarithms = None
        if growth:
            ones = np.full((2 * n, 1), math.sqrt(0.5 / n)) * self.structure.state_units[:, None]
            tangent = self._frame.tangent_into(ones)
            logarithms = np.full(n_periods, math.nan)
        points, outcome = self._points(
            state, amplitude, n_periods, poll, tally, tangent, logarithms
        )
        free = tally.free_time[0]
        norms = tally.modal / free if modal_norm and free > 0.0 else np.full(n, math.nan)
        return Observation(
            points,
            self.structure.contact_bits(int(tally.contact[0])),
            float(tally.peak_drift[0]) * self.structure.length_unit,
            norms,
            outcome,
            window_growth(logarithms) if growth else math.nan,
        )

    def monodromy(
        self, state: np.ndarray, amplitude: float, n_periods: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Integrate `n_periods` with the tangent map.

        Returns
        -------
        state : ndarray, shape (2n,)
        matrix : ndarray, shape (2n, 2n)
            d z(n_periods T) / d z(0).

        Raises
        ------
        ArithmeticError
            If the solver fails.
        """
        z = self._frame.into(state)
        tangent = self._frame.tangent_into(np.eye(2 * self.structure.n_floors))
        done, outcome = self._march(
            z, amplitude, n_periods, self._shared.no_points, tangent=tangent
        )
        if outcome != Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {Outcome(outcome).name} in forcing period {done + 1}")
        return self._frame.out_of(z), self._frame.tangent_out_of(tangent)

    def _points(self, state, amplitude, n_periods, poll, tally=None, tangent=None, growth=None):
        """Integrate `n_periods`; return the points that were reached, and the outcome."""
        z = self._frame.into(state)
        points = np.empty((n_periods, z.size))
        done, outcome = 0, int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll):
            more, outcome = self._march(
                z,
                amplitude,
                last - first,
                points[first:last],
                tally,
                tangent,
                None if growth is None else growth[first:last],
            )
            done += more
            if outcome != Outcome.COMPLETE:
                break
        return self._frame.out_of(points[:done]), Outcome(outcome)

    def _march(self, z, amplitude, n_periods, points, tally=None, tangent=None, growth=None):
        amplitude = amplitude / self._frame.amplitude_unit
        if tally is None and tangent is None:
            return march(self._packed, z, float(amplitude), n_periods, points)
        return march_observed(
            self._packed,
            z,
            float(amplitude),
            n_periods,
            points,
            self._watch.no_tally if tally is None else tally,
            np.empty((z.size, 0)) if tangent is None else tangent,
            self._watch.no_growth if growth is None else growth,
        )
