"""Solver `flow`: the kernels of this package behind the interface of `solvers.solver`."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from hpcsweep.model.observed import CLOSINGS, IMPACT, ROWS
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import (
    closing_arguments,
    motion,
    points_array,
    solver_arguments,
    tangent_column,
)
from hpcsweep.solvers.flow.observe.gathered import gathered, reset, rows_gathered
from hpcsweep.solvers.flow.orbit import batch, chain, contract
from hpcsweep.solvers.flow.specialised import FOR_ANY, kernels_for
from hpcsweep.solvers.flow.state.shared import (
    ANY_MEASURE,
    MAXIMA,
    NO_TALLY,
    NORMS,
    Watch,
    shared_at,
    watch_of,
)
from hpcsweep.solvers.free import NOTHING
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.measures import measures_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Polling
from hpcsweep.solvers.records import Advance, Approach, Followed, Growth, Observation, RowMotion

MAX_STEPS = 2_000_000
"""Most steps in one forcing period."""
LAYER_TOLERANCE = 1e-5
"""Allowed error of a layer step, per rtol: a period may have a thousand, which passages amplify."""


class FlowMap:
    """Advance states of one structure at one frequency by the exact flow.

    Parameters
    ----------
    structure : Structure
    omega : float
        Forcing frequency Omega.
    rtol : float
        Relative error of a period; sets the tolerance inside the layers. The linear motion and the
        fast passages are exact to about 1e-12 in any case.

    Attributes
    ----------
    counts : ndarray of int, shape (5,)
        Linear steps, fast passages, layer steps, layer visits and tables built so far.
    """

    yields = False
    """Whether it knows sliders."""

    def __init__(self, structure: Structure, omega: float, rtol: float = 1e-9):
        self.structure, self.omega, self.rtol = solver_arguments(
            structure, omega, rtol, yields=self.yields
        )
        tolerance = min(LAYER_TOLERANCE * self.rtol, 1e-9)
        made = shared_at(structure, self.omega, tolerance, MAX_STEPS)
        self._shared, self._packed, shapes = made
        self._units = Units(structure, self._shared.model)
        self._kernels = kernels_for(self._shared.model, shapes)
        self._measures = False  # whether what they call is loaded
        self._watches: dict[int, tuple] = {}
        self._watched = self._units.size
        self.counts = self._shared.counts
        self._polling = Polling()
        self._gathered = partial(gathered, self.structure, self._shared)

    @property
    def is_specialised(self) -> bool:
        """Whether the kernels are specialised to the structure, see `specialised`."""
        return self._kernels is not FOR_ANY

    @property
    def n_tables(self) -> int:
        """Number of contact sets with stored propagators."""
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
            Called before each piece of the work (`polling`).
        """
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        done, outcome = self._march(z, amplitude, n_periods, poll)
        return Advance(self._units.out_of(z), done, outcome)

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
            Most periods of the transient, and of the orbit.
        settled, same : float
            Distance (gaps, gaps omega_0: the units of the structure) from the orbit, and between
            points that count as one.
        near : float
            Distance between points a period apart below which Newton's method tries to jump to the
            orbit; 0: never.
        poll : callable, optional
            Called before each piece of the work (`polling`).
        """
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        closing = closing_arguments(max_period, settled, same, near)
        self._watch_for(closing[0]).since[0] = 0
        done = newton = period = 0
        multiplier, outcome = math.nan, int(Outcome.COMPLETE)
        while done < n_periods:
            most = min(self._polling.begin(poll), n_periods - done)
            more, by_newton, period, multiplier, near, outcome = self._kernels.end_of_transient(
                self._packed, self._packed_watch, z, amplitude, most, closing
            )
            self._polling.end(more)
            closing = (*closing[:3], near)
            done += more
            newton += by_newton
            if period or outcome != Outcome.COMPLETE:
                break
        return Approach(self._units.out_of(z), done, newton, period, multiplier, Outcome(outcome))

    def follow_orbits(
        self,
        amplitudes: np.ndarray,
        state: np.ndarray,
        rules: batch.Rules,
        free: FreeMotion | None,
        modal_norm: bool = False,
        measures: int = 0,
        poll: Callable[[], None] | None = None,
    ) -> Followed:
        """Compute consecutive runs until the rules leave one open; see `orbit.batch`.

        Parameters
        ----------
        amplitudes : ndarray, shape (k,)
        state : ndarray, shape (2n,)
            State from which the first of them starts.
        rules : batch.Rules
        free : FreeMotion, optional
            The rule for motions without contact.
        modal_norm, measures, poll
            As in `observe` and `settle`.
        """
        closing = closing_arguments(rules.max_period, rules.settled, rules.same, rules.near)
        rules = batch.Rules(*closing, *rules[len(closing) :])  # type: ignore[arg-type]
        start = motion(self, state, 0.0, rules.transient)[0]
        self._watch_for(closing[0])
        units, wanted = np.array(self.structure.state_units), self._wanted(modal_norm, measures)
        scale = self._units.amplitude_unit
        new = batch.new_run(rules, len(amplitudes), self._units.size, units, wanted, scale)
        run, packed = batch.RUN.place(new)
        run.amplitudes[:], run.state[:] = amplitudes, start
        tally = self._shared.tally if measures else None
        rows = batch.new_orbits(len(amplitudes), len(start) // 2, closing[0], tally)
        free_packed = NOTHING if free is None else free.packed
        why = batch.MORE
        while why == batch.MORE:
            n_periods = self._polling.begin(poll)
            why, n_periods, outcome = self._kernels.follow_orbits(
                self._packed, self._packed_watch, free_packed, packed, n_periods, rows
            )
            self._polling.end(n_periods)
        n_runs, left_open = int(run.number[0]), None
        if why == batch.OPEN:
            counts = int(run.transient[0]), int(run.newton[0]), int(run.period[0])
            end = self._units.out_of(run.z), *counts, float(run.multiplier[0])
            left_open = Approach(*end, Outcome(outcome))
        orbits, measured = batch.in_units(rows, n_runs, self.structure), None
        if measures:
            length = np.maximum(orbits.length, 1)
            measured = measures_of(self.structure, self._shared.model, orbits, length)
        return Followed(orbits, measured, run.state.copy(), left_open)

    def _watch_for(self, max_period: int) -> Watch:
        """Return the record of a motion's points for orbits of up to `max_period`."""
        if max_period not in self._watches:
            self._watches[max_period] = watch_of(self._watched, max_period)
        self._watch, self._packed_watch = self._watches[max_period]
        return self._watch

    def points(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
    ) -> tuple[np.ndarray, Outcome]:
        """Return the stroboscopic points z(T), z(2T), ..., shape (n_periods, 2n)."""
        return self._points(*self._motion(state, amplitude, n_periods), poll)

    def observe(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        modal_norm: bool = False,
        growth: bool = False,
        poll: Callable[[], None] | None = None,
        measures: int = 0,
    ) -> Observation:
        """Integrate `n_periods` and gather points, contact set, drift, modal norms and measures.

        With `growth` also the growth of a tangent vector, initially (1, ..., 1).
        """
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        wanted = self._wanted(modal_norm, measures)
        reset(self._shared.tally)
        tangent = logarithms = None
        if growth:
            tangent = self._units.tangent_into(tangent_column(self.structure, None))
            logarithms = points_array(n_periods, 1).ravel()
        points, outcome = self._points(z, amplitude, n_periods, poll, wanted, tangent, logarithms)
        seen = self._gathered(points, outcome, modal_norm, measures, logarithms)
        if tangent is not None:
            seen = replace(seen, direction=self._units.tangent_out_of(tangent).ravel())
        return seen

    def observe_each(self, states, amplitude, measures=0, poll=None) -> Observation:
        """Integrate states, shape (p, 2n), over one forcing period each, and gather.

        The points of an unstable orbit stay on it so, which one motion through all of them leaves.
        """
        z, outcome = self._march_each(states, amplitude, self._wanted(False, measures), poll)
        return self._gathered(self._units.out_of(z), outcome, False, measures)

    def rows_of(self, states, amplitude, rows, n_orders: int, poll=None) -> RowMotion:
        """Return what rows do in a forcing period from each state, all together.

        `rows` is of shape (r, n); of each up to `MAX_ORDER` harmonics.
        """
        march = partial(self._march_each, states, amplitude, self._wanted(False, ROWS), poll)
        units = len(states) * self._shared.model.period, self.structure.length_unit
        return rows_gathered(self._shared.asked, rows, n_orders, march, units)

    def closings(self, states, amplitude, poll=None) -> tuple[int, ...]:
        """Count how often each contact closes in a forcing period from each state, all together."""
        _, outcome = self._march_each(states, amplitude, self._wanted(False, IMPACT), poll)
        if outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {outcome.name}")
        return tuple(map(round, self._shared.tally.impacts[CLOSINGS].tolist()))

    def grow(
        self,
        state: np.ndarray,
        amplitude: float,
        n_periods: int,
        poll: Callable[[], None] | None = None,
        direction: np.ndarray | None = None,
    ) -> Growth:
        """Integrate `n_periods` with a tangent vector; gather only points."""
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        tangent = self._units.tangent_into(tangent_column(self.structure, direction))
        logarithms = points_array(n_periods, 1).ravel()
        points, outcome = self._points(z, amplitude, n_periods, poll, NO_TALLY, tangent, logarithms)
        if outcome is not Outcome.COMPLETE:
            logarithms = np.empty(0)
        return Growth(points, outcome, logarithms, self._units.tangent_out_of(tangent).ravel())

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
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        tangent = self._units.tangent_into(np.eye(2 * self.structure.n_floors))
        done, outcome = self._march(z, amplitude, n_periods, tangent=tangent)
        if outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {outcome.name} in forcing period {done + 1}")
        return self._units.out_of(z), self._units.tangent_out_of(tangent)

    def images(self, states, amplitude, tangents=False, poll=None) -> chain.Images:
        """Integrate several states over one forcing period each; see `orbit.chain.images`."""
        march = self._kernels.advance_chain, self._packed, self._units, self._polling
        return chain.images(*march, states, amplitude, tangents, poll)

    def take_round(self, rows, inverse, matrices, scale, unit, rules, poll=None):
        """Take a round of Newton's method for the points of an orbit, see `orbit.contract`.

        `scale` is the unit of the amplitude, `unit` that of the points. Return the largest
        component of the last move that was made and of the next one, and the forcing periods
        integrated.
        """
        scale, unit = scale / self._units.amplitude_unit, unit / self.structure.length_unit
        self._polling.begin(poll)
        outcome, *moves, n_periods = self._kernels.take_round(
            self._packed, rows, inverse, matrices, scale, unit, contract.Round(*rules)
        )
        self._polling.end(n_periods)
        if outcome != Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {Outcome(outcome).name}")
        return *moves, n_periods

    def _motion(self, state, amplitude, n_periods) -> tuple[np.ndarray, float, int]:
        """Return the start of a motion in the units of the kernels."""
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        return self._units.into(z), amplitude / self._units.amplitude_unit, n_periods

    def _wanted(self, modal_norm: bool, measures: int) -> int:
        """Return the flags of what to gather, see `tally`, when what that calls is loaded."""
        if measures and not self._measures:
            self._kernels.load_measures()
            self._measures = True
        return (NORMS if modal_norm else MAXIMA) + (measures & ANY_MEASURE)

    def _points(self, z, amplitude, n_periods, poll, wanted=NO_TALLY, tangent=None, growth=None):
        """Integrate `n_periods`, z in place; return the points reached, and the outcome."""
        points = points_array(n_periods, z.size)
        done, outcome = self._march(z, amplitude, n_periods, poll, points, wanted, tangent, growth)
        return self._units.out_of(points[:done]), outcome

    def _march_each(self, states, amplitude, wanted, poll) -> tuple[np.ndarray, Outcome]:
        """Integrate each state over one forcing period, all into one tally; return their ends."""
        z, amplitude = self._units.into(states), amplitude / self._units.amplitude_unit
        outcome = Outcome.COMPLETE
        reset(self._shared.tally)
        for row in z:
            if outcome is Outcome.COMPLETE:
                _, outcome = self._march(row, amplitude, 1, poll, wanted=wanted)
        return z, outcome

    def _march(
        self,
        z,
        amplitude,
        n_periods,
        poll=None,
        points=None,
        wanted=NO_TALLY,
        tangent=None,
        growth=None,
    ) -> tuple[int, Outcome]:
        """Integrate `n_periods`, z in place; return how many were done, and the outcome."""
        done, outcome = 0, int(Outcome.COMPLETE)
        for first, last in self._polling.cut(n_periods, poll):
            more, outcome = self._kernels.march(
                *(self._packed, z, amplitude, last - first),
                np.empty((0, z.size)) if points is None else points[first:last],
                wanted,
                np.empty((z.size, 0)) if tangent is None else tangent,
                np.empty(0) if growth is None else growth[first:last],
            )
            done += more
            if outcome != Outcome.COMPLETE:
                break
        return done, Outcome(outcome)
