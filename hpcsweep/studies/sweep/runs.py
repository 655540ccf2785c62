"""Sweeps, path-following; and how runs at one forcing frequency are computed, for any study.

In a sweep each run starts from the end state of the previous one. A frame is one path, up and then,
if requested, down from the end of the way up: along the amplitude, as in the study of the paper, or
along another parameter (`hpcsweep.studies.path_grid`).

In one run `transient_cycles` forcing periods are discarded, `sampling_cycles` more are the
steady-state window. Rules that spare periods whose result is known (`skip`):

``linear``
    If no floor can reach the stop from the present state (`linear.LinearOrbit`, proved), the motion
    is the free linear one; once its transient has decayed, all results are in closed form.
``converged``
    The transient ends when the orbit has closed on itself (`FlowMap.settle`): with p the period,
    e_k the distance between points p periods apart and r = e_k / e_(k-p) their ratio, the remaining
    distance is e r / (1 - r), which must be below `SETTLED` over two orbits in a row. The window is
    then one orbit, p forcing periods.
``newton``
    While the orbit is still approached, from `NEAR` on, Newton's method with the exact tangent map
    jumps to it, if it is verified that the present state goes there (`flow.orbit.transient`).
    Orbits whose multipliers are close to the unit circle, which the window procedure leaves
    open, are then verified.

A motion that the window leaves open may be classified after it (`classification`).

Motions of sliders (`solvers.yielding_map`) have a tangent map on their orbits alone: `newton` jumps
where none slips any more, which is proved, and `linear` needs that none has slipped before.

A run that fails is data: its results are NaN, its outcome says why, and its final state is the
last one that was reached. After a collapse the path goes on from rest.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.classify_motion import NEAR, SETTLED
from hpcsweep.dynamics.families import told_of_sliders
from hpcsweep.dynamics.stability import MeanInterval
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.offers import BATCHES, CLOSING, TANGENTS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.solvers.solver import SOLVERS, make_solver
from hpcsweep.studies.blocks import Amplitudes, Poll, Rows, joined
from hpcsweep.studies.grid import DOWN, UP
from hpcsweep.studies.keys import OMEGA, Key, Tables
from hpcsweep.studies.path_grid import ALONG, Followed, PathGrid
from hpcsweep.studies.settings import SKIP_RULES, SweepSettings
from hpcsweep.studies.study import Lines
from hpcsweep.studies.sweep import classification
from hpcsweep.studies.variables import EXPONENTS, empty_rows, store, store_failure

DIRECTIONS = Key(
    "directions",
    'ways along the path: `["up"]`, or `["up", "down"]`, the way back too',
    [UP, DOWN],
)
ON_PATH, ALONE = 160, 5
"""Parts of ``classify_cycles`` that the chaos of a run on a path, and of an independent run, must
outlive before it is told: 312 and 10,000 periods of 50,000. Of 10 chaotic windows of the map of
Figure 6 as described that ended within 3,000 periods 8 did so within 300."""
POOLED, LESS, FADES = 64, 4, 32
"""Part of these periods, and of those of the run before, that suffices on a path where the chaos of
that run was followed for as much: neighbours are one test. With a rate of escape kappa all runs of
a band outlive S_1, S_2, ... periods with probability exp(-kappa (S_1 + S_2 + ...)), so that the
band refuses what its first run refuses (`lifetime`), and each run adds to it. What ends in it
begins a new band. Below grazing, where the first run is long, all before it in a band count, less
1/32 for each run between them that has no chaos."""


class FrameRuns:
    """Runs of one structure at one forcing frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    settings : SweepSettings
    solver : Solver, optional
        Replaces the solver of the settings.
    """

    def __init__(self, structure: Structure, omega: float, settings: SweepSettings, solver=None):
        self.structure, self.omega, self.settings = structure, omega, settings
        self._given = solver is not None
        if solver is not None:
            self.solver = solver

    @cached_property
    def solver(self):
        """Made where it is needed: runs measured by another length have their own."""
        made = self.settings.solver, self.structure, self.omega, self.settings.rtol
        return make_solver(*made, yields=True)

    @cached_property
    def _free(self):
        if "linear" not in self.settings.skip:
            return None
        # imported here: reading results needs no kernels
        from hpcsweep.solvers.free_motion import FreeMotion

        of = self.settings
        window = of.transient_cycles, of.sampling_cycles, of.period_tolerance
        free = FreeMotion(self.structure, self.omega, *window)
        if not CLOSING.of(self.structure):
            self.solver.free = free
        return free

    @cached_property
    def _batch(self):
        settings = self.settings
        if "converged" in settings.skip and SOLVERS[settings.solver].batches(self.structure):
            from hpcsweep.studies.sweep.batch import Batch

            return Batch(self.solver, settings, self._free)
        return None

    def follow(self, amplitudes: Amplitudes, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute runs at consecutive amplitudes, each from the end of the previous one.

        Parameters
        ----------
        amplitudes : sequence of k floats
            In the order in which they are followed.
        state : ndarray, shape (2n,) or (2n + 1,), of L sliders (2n + L,) or (2n + L + 1,)
            State at tau = 0 of the first run; or what `end_of` tells of the run before it.
        poll : callable, optional
            Called before each run and within long ones; may raise to leave.

        Returns
        -------
        dict of str to ndarray
            The variables of `empty_rows`, first axis the k runs. The next stretch starts from
            `end_of` the last one, with exactly the results of one long stretch.
        """
        return self._rows(amplitudes, state, poll, follow=True)

    def each(self, amplitudes: Amplitudes, state: np.ndarray, poll: Poll = None) -> Rows:
        """Compute runs, each from the same state; otherwise like `follow`."""
        return self._rows(amplitudes, state, poll, follow=False)

    def _rows(self, amplitudes, state, poll, follow: bool) -> Rows:
        """Compute runs, each measured by its own length (`Structure.lengths`)."""
        amplitudes = np.array(amplitudes, dtype=float)
        if self._given or not amplitudes.size:
            return self._stretch(amplitudes, state, poll, follow)
        lengths = self.structure.lengths(self.omega, amplitudes)
        parts = []
        for at in np.split(np.arange(amplitudes.size), 1 + np.flatnonzero(np.diff(lengths))):
            runs, measured = self, self.structure.measured_by(float(lengths[at[0]]))
            if measured is not self.structure:
                runs = frame_runs(measured, self.omega, self.settings)
            parts.append(runs._stretch(amplitudes[at], state, poll, follow))
            state = end_of(parts[-1], -1) if follow else state
        return joined(parts)

    def _stretch(self, amplitudes, state, poll, follow: bool) -> Rows:
        """Compute runs from a state, or from the end of the previous one."""
        result = empty_rows(self.structure, len(amplitudes), self.settings)
        size = self.structure.state_units.size
        start, index, before = np.array(state[:size], dtype=float), 0, int(sum(state[size:]))
        while index < len(amplitudes):
            first = index
            if self._batch is None:
                if poll is not None:
                    poll()
                left = self._transient(result, index, float(amplitudes[index]), start, poll)
            else:
                done = self._batch.into(result, index, amplitudes, start, follow, poll)
                index, start, left = index + len(done.orbits.rule), done.state, done.open
                before = self._band(result, amplitudes, range(first, index), before)
                if left is None:
                    continue
            if left is not None:
                outlived = self._outlived(float(amplitudes[index]), follow, before)
                self._window(left, float(amplitudes[index]), _row(result, index), outlived, poll)
            if follow:
                before = self._band(result, amplitudes, range(index, index + 1), before)
            start = result["final_state"][index].copy() if follow else start
            index += 1
        return result

    def _transient(self, result, index, amplitude: float, z, poll: Poll) -> Approach | None:
        """Integrate the transient of a run; return None if it is proved linear, and stored."""
        closed = self._free.window(z, amplitude) if self._free is not None else None
        single = "converged" in self.settings.skip and not BATCHES.of(self.structure)
        if closed is None and single:
            return self._settled(z, amplitude, poll)
        if self._free is None or closed is None:
            done = self.solver.advance(z, amplitude, self.settings.transient_cycles, poll=poll)
            return Approach(done.state, done.n_periods, 0, 0, math.nan, done.outcome)
        if self.settings.measures:
            closed = replace(closed, measures=self._free.orbit.measures(amplitude))
        exponent = MeanInterval.exact(self._free.orbit.lyapunov_exponent)
        classified = classification.Classification(closed, 1, exponent, MotionClass.NO_CONTACT)
        row = _row(result, index)
        self._store(row, amplitude, classified, closed.points[-1], 0, poll)
        row["skip_rule"][:] = SkipRule.LINEAR
        return None

    def _settled(self, z, amplitude: float, poll: Poll) -> Approach:
        """Advance until the orbit has closed, then to the point at which its window would end."""
        of = self.settings
        rules = of.transient_cycles, of.max_orbit_period, SETTLED, of.period_tolerance
        near = NEAR if "newton" in of.skip else 0.0
        end = self.solver.settle(z, amplitude, *rules, near, poll)
        if not end.period or end.outcome is not Outcome.COMPLETE:
            return end
        more = (of.transient_cycles + of.sampling_cycles - end.n_periods) % end.period
        done = self.solver.advance(end.state, amplitude, more, poll)
        cycles = end.n_periods + done.n_periods
        return replace(end, state=done.state, n_periods=cycles, outcome=done.outcome)

    def _outlived(self, amplitude: float, follow: bool, before: int) -> int:
        """Return the forcing periods that chaos must outlive.

        Below grazing a motion without contact attracts, and chaos beside it is likely to be a
        transient: it is followed for as long as a run may be. In both cases for less where chaos
        `before` was followed for so many forcing periods.
        """
        most = self.settings.classify_cycles or 0
        if amplitude < self._grazing_amplitude:  # which need not be known
            return min(max(most - before, most // POOLED, 1), most)
        most //= ON_PATH if follow else ALONE
        least = max(most // POOLED, 1)
        return min(max(before // LESS, least), most) if before >= least else most

    def _band(self, rows: Rows, amplitudes: np.ndarray, runs: range, before: int) -> int:
        """Store for how long chaos was followed up to each of some runs, `before` these; see LESS.

        Return what is stored of the last one.
        """
        for run in runs if "band_cycles" in rows else ():
            below = amplitudes[run] < self._grazing_amplitude
            if rows["motion"][run] == MotionClass.CHAOTIC:
                before = int(rows["classification_cycles"][run]) + before * int(below)
                before = min(before, int(self.settings.classify_cycles or 0))
            elif below and rows["window_class"][run] != MotionClass.CHAOTIC:
                before = before * (FADES - 1) // FADES
            else:
                before = 0
            rows["band_cycles"][run] = before
        return before

    @cached_property
    def _grazing_amplitude(self) -> float:
        return float(self.structure.grazing_amplitude(self.solver.omega))

    def _window(self, end: Approach, amplitude: float, row, outlived: int, poll: Poll) -> None:
        """Integrate the window that follows a transient, and classify its motion."""
        settings = self.settings
        z, cycles = end.state, end.n_periods + end.n_newton
        if end.period:
            # the solver fails on the orbit that a rule has found
            jumped = not math.isnan(end.multiplier)
            row["skip_rule"][:] = SkipRule.NEWTON if jumped else SkipRule.CONVERGED
        if end.outcome is not Outcome.COMPLETE:
            store_failure(row, z, cycles, end.outcome)
            return
        seen = self.solver.observe(
            z,
            amplitude,
            end.period or settings.sampling_cycles,
            "modal_norm" in settings.metrics,
            bool("lyapunov" in row or settings.classify_cycles) and TANGENTS.of(self.structure),
            poll,
            settings.measures,
        )
        cycles += len(seen.points)
        if seen.outcome is not Outcome.COMPLETE:
            store_failure(row, seen.points[-1] if len(seen.points) else z, cycles, seen.outcome)
            return
        if end.period and not CLOSING.of(self.structure):
            kind = MotionClass.NO_CONTACT if seen.is_free else MotionClass.PERIODIC
            exponent = classification.interval_of_orbit(
                self.solver, seen.points[-1], amplitude, end.period, settings
            )
            classified = classification.Classification(seen, end.period, exponent, kind)
        else:
            classified = classification.classify_window(
                self.solver, amplitude, seen, settings, outlived, poll
            )
        self._store(row, amplitude, classified, seen.points[-1], cycles, poll)

    def _store(
        self,
        row,
        amplitude: float,
        classified: classification.Classification,
        end,
        cycles: int,
        poll: Poll,
    ) -> None:
        """Write a run and the classification of its motion into its row."""
        seen = classified.seen
        n_points = min(classified.orbit_period or len(seen.points), self.settings.stored_points)
        result = (
            vars(seen) | vars(classified) | dict(zip(EXPONENTS, classified.exponent, strict=True))
        )
        result |= {"cycles": cycles, "final_state": end}
        if seen.slid:
            slid = seen.slid, classified.orbit_period, self.settings.period_tolerance
            result |= told_of_sliders(self.structure, *slid)
        result |= {"points": seen.points[-n_points:], "n_points": n_points}
        moved = self.solver, amplitude, seen.points, classified.orbit_period
        result |= classification.more_variables(*moved, self.settings, poll)
        store(row, self.structure, self.solver.omega, amplitude, result)


def end_of(rows: Rows, row: int) -> np.ndarray:
    """Return what a path carries from a run to the next: its end state, and ``band_cycles``."""
    end = rows["final_state"][row]
    return np.append(end, rows["band_cycles"][row]) if "band_cycles" in rows else end


def _row(result: Rows, index: int) -> Rows:
    """Return one row of the results, first axis 1."""
    return {name: array[index : index + 1] for name, array in result.items()}


def frame_runs(structure: Structure, omega: float, settings: SweepSettings) -> FrameRuns:
    """Return the runs of a frame; the tables of the last few frames are cached.

    Of what has few parts, of 50 kB a frequency, so many that a path along the frequency finds them
    again on its way back.
    """
    parts = structure.n_floors + len(structure.contacts) + len(structure.sliders)
    return (_many if parts <= 2 else _few)(structure, omega, settings)


_few, _many = (lru_cache(maxsize=count)(FrameRuns) for count in (4, 512))


@dataclass(frozen=True, eq=False)
class AmplitudeSweep(PathGrid):
    """Sweeps, a frame a task; see `PathGrid`."""

    kind: ClassVar[str] = "amplitude_sweep"
    summary: ClassVar[str] = (
        "at each frequency the amplitudes in their order, each from where the one before it ended; "
        "or so along any other parameter"
    )
    words: ClassVar[dict[str, str]] = {UP: "sweep up", DOWN: "sweep down"}
    keys: ClassVar[Tables] = {"sweep": (*OMEGA, ALONG, DIRECTIONS)}
    default_block: ClassVar[int] = 50
    carries: ClassVar[str] = "the state is carried"

    @classmethod
    def read(cls, values, followed: Followed | None = None, **common) -> "AmplitudeSweep":
        """Read the sweeps of a job; see `RunGrid.read`."""
        ways = values.get("sweep.directions", DIRECTIONS.default)
        if ways not in ([UP], [UP, DOWN]):
            raise values.error("sweep.directions", ways, f'must be ["{UP}"] or ["{UP}", "{DOWN}"]')
        return cls(directions=tuple(ways), **cls.read_grid(values, followed), **common)

    @property
    def direction_name(self) -> str:  # type: ignore[override]
        """Long name of the first dimension."""
        return f"direction of the {'' if self.steps else 'amplitude '}sweep"

    def lines(self) -> Lines:
        """Tell the path, and which rules hold along it."""
        yield from super().lines()
        if self.steps:
            mapped = SKIP_RULES[: 3 if TANGENTS.of(self.structure) else 2]  # newton needs them
            rules = [name for name in mapped if name in self.settings.skip]
            yield "skip rules", ", ".join(rules or ["none"]) + ": all hold along any path"

    @property
    def carried(self) -> tuple[str, ...]:  # type: ignore[override]
        """Variables that hold the start of the next run."""
        tested = ("band_cycles",) if self.settings.classify_cycles else ()
        return ("final_state", *tested)

    def end_state(self, rows: Rows, row: int) -> np.ndarray:
        """Return the state from which the next run starts, and how long its chaos was followed."""
        return end_of(rows, row)

    def runs_of(self, structure: Structure, omega: float) -> FrameRuns:
        """Return what computes runs of one structure at one frequency."""
        return frame_runs(structure, omega, self.settings)
