"""The solver `flow`: the kernels of this package behind the interface of `hpcsweep.solver`."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from hpcsweep.flow.metrics import empty_tally
from hpcsweep.flow.period import Work, empty_work, march_period
from hpcsweep.flow.tables import Model, empty_tables
from hpcsweep.jit import kernel
from hpcsweep.observation import Advance, Observation, window_growth
from hpcsweep.outcome import Outcome
from hpcsweep.structure import Structure

MAX_STEPS = 2_000_000
"""Cap of steps in one forcing period."""
LAYER_TOLERANCE = 1e-5
"""Error allowed a step inside a layer, per relative tolerance asked of a period (measured on
random states: a period has up to some thousand such steps, and passages amplify errors)."""
NEGLIGIBLE_FORCE = 1e-13
"""Contact force (gaps omega_0^2) at the edge of the layer that is neglected outside it."""
ROUNDING = 2e-14
"""Points closer than this (relative) are the same to rounding."""
POLL_PERIODS = 2000
"""Forcing periods between two polls, some tens of milliseconds."""


def layer_half_width(beta: float, rho: float) -> float:
    """Choose the half-width of the contact layer, in gaps.

    Outside it the neglected force r = beta/rho y exp(-y), y = rho |u - 1|, is below
    `NEGLIGIBLE_FORCE`.
    """
    if rho == math.inf or beta == 0.0:
        return 0.0
    if rho == 0.0:
        return math.inf
    y = 20.0
    for _ in range(50):
        y = max(20.0, math.log(beta / rho * y / NEGLIGIBLE_FORCE))
    return y / rho


@kernel
def march(
    z,
    amplitude,
    n_periods,
    model,
    tables,
    tolerance,
    max_steps,
    work,
    counts,
    points,
    previous,
    stop_below,
    tally=None,
    tangent=None,
    growth=None,
):
    """Advance z over `n_periods` forcing periods, in place, and keep the stroboscopic points.

    Parameters
    ----------
    points : ndarray, shape (n_periods, 2n) or (0, 2n)
        Receives z(T), z(2T), ...; not written if empty.
    previous : ndarray, shape (2n,)
        Room.
    stop_below : float
        Stop early once the state moved by no more than this over a period, three times in a row.
    tally, tangent
        See `period.march_period`.
    growth : ndarray, shape (n_periods,), optional
        The first column of `tangent` is scaled to length 1 after each period, and the logarithm of
        what it was written here.

    Returns
    -------
    n_done : int
    outcome : int
    """
    still = 0
    for period in range(n_periods):
        for k in range(z.shape[0]):
            previous[k] = z[k]
        outcome = march_period(
            z,
            amplitude,
            model,
            tables,
            tolerance,
            max_steps,
            work,
            counts,
            tally,
            tangent,
        )
        if outcome != 1:
            for k in range(z.shape[0]):
                z[k] = previous[k]
            return period, outcome
        if growth is not None:
            square = 0.0
            for k in range(z.shape[0]):
                square += tangent[k, 0] ** 2
            size = math.sqrt(square)
            growth[period] = math.log(size) if size > 0.0 else -math.inf
            for k in range(z.shape[0]):
                tangent[k, 0] /= size if size > 0.0 else 1.0
        moved = 0.0
        for k in range(z.shape[0]):
            moved = max(moved, abs(z[k] - previous[k]))
        if points.shape[0] > 0:
            for k in range(z.shape[0]):
                points[period, k] = z[k]
        still = still + 1 if moved <= stop_below else 0
        if still == 3:
            return period + 1, 1
    return n_periods, 1


@kernel
def settle(
    z,
    amplitude,
    first,
    n_periods,
    max_period,
    settled,
    same,
    near,
    model,
    tables,
    tolerance,
    max_steps,
    work,
    counts,
    history,
    distance,
    close,
    falling,
):
    """Advance z until its orbit has closed on itself, to period `n_periods` at most.

    Let e_k(p) be the largest difference of z(kT) and z((k - p)T). The orbit has period p, and
    distance e r / (1 - r) to go with r = e_k / e_(k-p), once that is at most `settled` at every
    point of two orbits in a row. An orbit that closes after p also closes after multiples of p,
    and may be seen to do so earlier: the answer is the smallest divisor of p for which the last
    two points are the `same`.

    Before that, once e_k(p) is at most `near` and has fallen at every point of two orbits in a
    row, the orbit is approached: the period is returned with a minus sign.

    Parameters
    ----------
    first : int
        0, or the number of periods done by calls before, with the arrays they left.
    history : ndarray, shape (2 max_period + 1, 2n)
        Room: the last points, cyclic.
    distance : ndarray, shape (max_period + 1, max_period + 1)
        Room: the last e_k of every p, cyclic.
    close, falling : ndarray of int, shape (max_period + 1,)
        Zeros at first: for how many points each p has been closed, or approached.

    Returns
    -------
    n_done, period, outcome : int
        `period` is 0 if the orbit has not closed, negative if it is only approached.
    """
    size = z.shape[0]
    ring = max_period + 1
    long = history.shape[0]
    if first == 0:
        for k in range(size):
            history[0, k] = z[k]
    for period in range(first + 1, n_periods + 1):
        outcome = march_period(
            z,
            amplitude,
            model,
            tables,
            tolerance,
            max_steps,
            work,
            counts,
        )
        slot = period % ring
        if outcome != 1:
            for k in range(size):
                z[k] = history[(period - 1) % long, k]
            return period - 1, 0, outcome
        largest = 0.0
        for k in range(size):
            history[period % long, k] = z[k]
            largest = max(largest, abs(z[k]))
        for p in range(1, min(max_period, period) + 1):
            past = (period - p) % ring
            e = 0.0
            for k in range(size):
                e = max(e, abs(z[k] - history[(period - p) % long, k]))
            to_go = math.inf
            approached = False
            if period >= 2 * p:
                before = distance[p, past]
                approached = e <= near and e < before
                if e <= ROUNDING * (1.0 + largest):
                    to_go = 0.0
                elif e < before:
                    to_go = e * e / (before - e)
            distance[p, slot] = e
            close[p] = close[p] + 1 if to_go <= settled else 0
            if close[p] >= 2 * p + 1:
                for divisor in range(1, p):
                    if p % divisor == 0 and distance[divisor, slot] <= same:
                        return period, divisor, 1
                return period, p, 1
            falling[p] = falling[p] + 1 if approached else 0
            if falling[p] >= 2 * p + 1:
                return period, -p, 1
    return n_periods, 0, 1


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
        beta, rho = structure.stiffness_ratio, structure.sharpness
        layer = layer_half_width(beta, rho)
        self._model = Model(
            stiffness=structure.stiffness_matrix.copy(),
            damping=np.ascontiguousarray(structure.damping_matrix),
            shapes=np.ascontiguousarray(structure.mode_shapes.T),
            beta=beta,
            rho=rho,
            omega=self.omega,
            layer=layer,
        )
        self._tables = empty_tables(structure)
        self._work: Work = empty_work(structure.n_floors)
        self._tolerance = min(LAYER_TOLERANCE * self.rtol, 1e-9)
        self.counts = np.zeros(4, np.int64)
        self._no_points = np.empty((0, 2 * structure.n_floors))
        self._previous = np.empty(2 * structure.n_floors)

    @property
    def n_tables(self) -> int:
        """Contact sets for which propagators are kept now."""
        return int(self._tables.count[0])

    def advance(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        tol: float = -1.0,
        poll: Callable[[], None] | None = None,
    ) -> Advance:
        """Integrate `n_periods` forcing periods from tau = 0 (mod T).

        Parameters
        ----------
        state : ndarray, shape (2n,)
        amplitude : float
            A.
        n_periods : int
        tol : float
            Stop early once the state moves by no more than this over a period, three times in
            a row; negative: never.
        poll : callable, optional
            Called before the work and, without `tol`, every `POLL_PERIODS`.
        """
        z = np.array(state, dtype=float)
        done, outcome = 0, int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll if tol < 0 else None):
            more, outcome = self._march(z, amplitude, last - first, self._no_points, tol)
            done += more
            if outcome != Outcome.COMPLETE:
                break
        return Advance(z, done, Outcome(outcome))

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
    ) -> tuple[Advance, int, np.ndarray]:
        """Advance until the orbit has closed on itself, for at most `n_periods`; see `settle`.

        Returns
        -------
        advance : Advance
        period : int
            Orbit period, 0 if the orbit has not closed, negative if it is only approached.
        points : ndarray, shape (3, 2n)
            The motion two orbit periods ago, one orbit period ago, and now, if `period` is not 0.
        """
        z = np.array(state, dtype=float)
        ring = max_period + 1
        room = (
            np.empty((2 * max_period + 1, z.size)),
            np.empty((ring, ring)),
            np.zeros(ring, np.int64),
            np.zeros(ring, np.int64),
        )
        done, period, outcome = 0, 0, int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll):
            done, period, outcome = settle(
                z,
                float(amplitude),
                first,
                last,
                max_period,
                settled,
                same,
                near,
                self._model,
                self._tables,
                self._tolerance,
                MAX_STEPS,
                self._work,
                self.counts,
                *room,
            )
            if period != 0 or outcome != Outcome.COMPLETE:
                break
        history = room[0]
        past = history[[(done - k * abs(period)) % len(history) for k in (2, 1, 0)]]
        return Advance(z, done, Outcome(outcome)), period, past

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
            tangent = np.full((2 * n, 1), math.sqrt(0.5 / n))
            logarithms = np.full(n_periods, math.nan)
        points, outcome = self._points(
            state, amplitude, n_periods, poll, tally, tangent, logarithms
        )
        free = tally.free_time[0]
        norms = tally.modal / free if modal_norm and free > 0.0 else np.full(n, math.nan)
        return Observation(
            points,
            int(tally.contact[0]),
            float(tally.peak_drift[0]),
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
        z = np.array(state, dtype=float)
        tangent = np.eye(z.size)
        done, outcome = self._march(z, amplitude, n_periods, self._no_points, tangent=tangent)
        if outcome != Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {Outcome(outcome).name} in forcing period {done + 1}")
        return z, tangent

    def _points(self, state, amplitude, n_periods, poll, tally=None, tangent=None, growth=None):
        """Integrate `n_periods`; return the points that were reached, and the outcome."""
        z = np.array(state, dtype=float)
        points = np.empty((n_periods, z.size))
        done, outcome = 0, int(Outcome.COMPLETE)
        for first, last in _between_polls(n_periods, poll):
            more, outcome = self._march(
                z,
                amplitude,
                last - first,
                points[first:last],
                -1.0,
                tally,
                tangent,
                None if growth is None else growth[first:last],
            )
            done += more
            if outcome != Outcome.COMPLETE:
                break
        return points[:done], Outcome(outcome)

    def _march(
        self, z, amplitude, n_periods, points, tol=-1.0, tally=None, tangent=None, growth=None
    ):
        return march(
            z,
            float(amplitude),
            n_periods,
            self._model,
            self._tables,
            self._tolerance,
            MAX_STEPS,
            self._work,
            self.counts,
            points,
            self._previous,
            float(tol),
            tally,
            tangent,
            growth,
        )
