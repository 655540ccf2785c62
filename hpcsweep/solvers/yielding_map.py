"""Motions of structures with sliders under a harmonic forcing: the state is (u, u', p).

The kernels take (u, u') over a period, with the modes of sliders beside it. Those of contacts
follow from a state where a period begins, and so do here those of sliders (`solvers.sliders`): a
period depends on the state where it begins, and on nothing else.

A slider that slips forgets its p, one that does not keeps it: multipliers of 0, and of 1 in a
family of motions that have shaken down (`stability.without_families`). An orbit is told by its
closing in (u, u') and p, relative to what drifts along directions that no spring opposes
(`Structure.without_drift`): there a motion that ratchets repeats, each time farther on.

The tangent map is a central difference of the map, which is exact to rounding: its error is some
1e-9. A slider forgets what it remembers within its elastic elongation F / k: of 1e6 times the
stiffness beside it, dry friction but for rounding, that is 3e-7 of the motion. So differences are
along u with the springs of sliders as they are, p moving with u, and along p by a part (`ELASTIC`)
of F / k; the tangent map is what both make of the unit vectors. A slider that has not slipped over
the motion has kept its p: its row is that of the identity. The map is continuous in the state but
where a slider comes to its strength and turns: slips to one side of such a motion grow in
proportion to how far it is passed, and none are on the other. Where differences to both sides
differ so, or do not add up, of the usual step and of a smaller one, there is no tangent map.
"""

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from hpcsweep.model.observed import DRIFT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import closing_arguments, motion, points_array
from hpcsweep.solvers.flow.flow_map import FlowMap
from hpcsweep.solvers.flow.orbit.chain import Images
from hpcsweep.solvers.flow.orbit.yielding import PATH
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, MAXIMA, NO_TALLY, NORMS
from hpcsweep.solvers.free_motion import FreeMotion
from hpcsweep.solvers.offers import HARMONIC
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Growth, Observation
from hpcsweep.solvers.sliders import Sliders, SliderUnits

FIRST = 4
"""Forcing periods after which a motion is looked at, then after twice as many more."""
DIFFERENCE = 1e-6
"""Step of a difference, in units of the state: errors of rounding and of curvature are about the
same where the map bends over lengths of its units."""
NARROW = 1e-7, 1e-8
"""The same beside a kink, of a slip that is about to end where a period begins, say, and within the
layer of a smooth contact."""
ELASTIC = 1e-3
"""Most by which a difference changes the elastic elongation of a slider, over F / k."""
SMOOTH = 1e-3
"""Largest difference between differences to both sides, over the size of the tangent map."""


class YieldingMap(FlowMap):
    """Advance states (u, u', p), shape (2n + L,), by the exact flow; otherwise like `FlowMap`."""

    yields = True

    def __init__(self, structure: Structure, omega: float, rtol: float = 1e-9):
        HARMONIC.demand(structure)
        super().__init__(structure, omega, rtol)
        self._sliders = Sliders(structure, self._shared.model.elements)
        self._units = SliderUnits(self._units, self._sliders, structure.length_unit)
        self._limits = np.array([slider.limit for slider in structure.sliders])
        self._slid = np.zeros((3, len(structure.sliders)))
        self._watched = structure.state_units.size

    @cached_property
    def free(self) -> FreeMotion:
        """The rule for motions in which nothing closes or slips."""
        return FreeMotion(self.structure, self.omega, 0, 1, 0.0)

    @cached_property
    def _places(self) -> np.ndarray:
        """What takes states of the kernels to those in units, relative to what drifts."""
        states = self._units.out_of(np.eye(self._units.size + self._slid.shape[1]))
        return np.ascontiguousarray(
            (self.structure.without_drift(states) / self.structure.state_units).T
        )

    def settle(
        self, state, amplitude, n_periods, max_period, settled, same, near=0.0, poll=None
    ) -> Approach:
        """Advance until the orbit has closed; as `flow.orbit.transient.watch_motion` tells it.

        With `near` above 0 a motion in which nothing closes or slips any more, which is proved
        (`solvers.free`), jumps to its steady state.
        """
        z, scaled, n_periods = self._motion(state, amplitude, n_periods)
        max_period, settled, same, near = closing_arguments(max_period, settled, same, near)
        self._watch_for(max_period).since[0] = 0
        done, look, period, still, outcome = 0, 0, 0, 1, int(Outcome.COMPLETE)
        while done < n_periods and not period and outcome == Outcome.COMPLETE:
            if done == look:
                look = 2 * look + FIRST
                free = near > 0.0 and still > 0
                jump = self.free.jump(self._units.out_of(z), amplitude) if free else None
                if jump is not None:
                    return Approach(jump[0], done, 0, 1, jump[1], Outcome.COMPLETE)
            most = min(self._polling.begin(poll), look - done, n_periods - done)
            closing = max_period, settled, same, 0.0
            more, period, still, outcome = self._advance(z, scaled, most, NO_TALLY, None, closing)
            self._polling.end(more)
            done += more
        return Approach(self._units.out_of(z), done, 0, period, math.nan, Outcome(outcome))

    def _advance(self, z, amplitude, n_periods, wanted, points=None, closing=None) -> tuple:
        """Call `flow.orbit.yielding.march_yielding`, to watch an orbit with a `Closing`."""
        nothing = np.empty((0, z.size))
        self._watch_for(closing[0] if closing else 1)
        return self._kernels.march_yielding(
            *(self._packed, self._packed_watch, z, amplitude, n_periods, wanted),
            *(nothing if points is None else points, self._slid),
            *((self._places, closing) if closing else (nothing, (1, 0.0, 0.0, 0.0))),
        )

    def observe(
        self, state, amplitude, n_periods, modal_norm=False, growth=False, poll=None, measures=0
    ) -> Observation:
        """Integrate `n_periods` and gather; without the growth of a tangent vector."""
        self._slid[:] = 0.0
        seen = super().observe(state, amplitude, n_periods, modal_norm, False, poll, measures)
        return self._told(seen, state)

    def observe_each(self, states, amplitude, measures=0, poll=None) -> Observation:
        """Integrate states over one forcing period each, and gather."""
        self._slid[:] = 0.0
        return self._told(super().observe_each(states, amplitude, measures, poll), states[0])

    def _told(self, seen: Observation, state) -> Observation:
        """Return an observation with what sliders have done, its drifts those of the structure."""
        tally, model, structure = self._shared.tally, self._shared.model, self.structure
        # drifts of the kernels are those of the structure, then elongations of sliders
        n, rows = len(structure.drift_rows), model.drift_rows.tolist()
        length = structure.length_unit
        drifts = tally.peaks[: len(rows)] * length
        slides = [rows.index(row) for row in model.elements.rows[self._sliders.own].tolist()]
        periods, (path, times, slipping) = len(seen.points), self._slid
        change = (seen.points[-1] if periods else state) - np.asarray(state, float)
        slid = {
            "ductility": drifts[slides] / self._limits,
            "slider_energy": structure.slider_losses(path * length, times) / max(periods, 1),
            "plastic": change[2 * structure.n_floors :] / max(periods, 1),
            "excursions": times.astype(int),
            "slipping": slipping.astype(int),
        }
        return replace(seen, peak_drift=float(drifts[:n].max()), slid=slid)

    def _wanted(self, modal_norm: bool, measures: int) -> int:
        return (NORMS if modal_norm else MAXIMA) + (measures & ANY_MEASURE | DRIFT)

    def grow(self, state, amplitude, n_periods, poll=None, direction=None) -> Growth:
        """Integrate with a small difference, which stands for a tangent vector.

        One across families: of the same p at first, of which sliders that stick make no other, and
        without what drifts.
        """
        z, amplitude, n_periods = motion(self, state, amplitude, n_periods)
        units, n = self.structure.state_units, self.structure.n_floors
        along = np.repeat((1.0, 0.0), (2 * n, units.size - 2 * n)) * units
        along = along if direction is None else np.array(direction)
        points, logarithms = points_array(n_periods, z.size), np.empty(n_periods)
        for k in range(n_periods):
            along = self.structure.without_drift(along)
            along = along / np.linalg.norm(along / units)
            scale = min(DIFFERENCE, self._within_elastic(along))
            step = scale * along
            ends = [self.advance(start, amplitude, 1, poll) for start in (z, z + step, z - step)]
            failed = [end.outcome for end in ends if end.outcome is not Outcome.COMPLETE]
            if failed:
                return Growth(points[:k], failed[0], np.empty(0), along)
            z, above, below = (end.state for end in ends)
            points[k] = z
            change = self.structure.without_drift(above - below) * 0.5 / scale
            size = np.linalg.norm(change / units)
            logarithms[k] = np.log(size) if size > 0.0 else -np.inf
            along = change if size > 0.0 else along
        return Growth(points, Outcome.COMPLETE, logarithms, along)

    def images(self, states, amplitude, tangents=False, poll=None) -> Images:
        """Integrate states, shape (p, 2n + L), over one forcing period each."""
        ends = [self._end(z, amplitude, 1, poll) for z in states]
        size = states.shape[-1]
        maps = [self._tangent(z, amplitude, 1, poll) for z in states if tangents]
        return Images(np.array(ends), np.reshape(maps, (-1, size, size)))

    def monodromy(self, state, amplitude, n_periods) -> tuple[np.ndarray, np.ndarray]:
        """Integrate with the tangent map, shape (2n + L, 2n + L), of differences."""
        end = self._end(state, amplitude, n_periods)
        return end, self._tangent(np.asarray(state, float), amplitude, n_periods)

    def _end(self, state: np.ndarray, amplitude: float, n_periods: int, poll=None) -> np.ndarray:
        """Return the state to which a motion comes."""
        reached = self.advance(state, amplitude, n_periods, poll)
        if reached.outcome is not Outcome.COMPLETE:
            name, period = reached.outcome.name, reached.n_periods + 1
            raise ArithmeticError(f"flow: {name} in forcing period {period}")
        return reached.state

    def _within_elastic(self, along: np.ndarray) -> float:
        """Return the factor of a vector by which no slider's elastic elongation changes by much."""
        n = self.structure.n_floors
        change = np.abs(self.structure.slider_directions @ along[:n] - along[2 * n :])
        return float((ELASTIC * self._limits / np.maximum(change, np.finfo(float).tiny)).min())

    def _steps(self) -> np.ndarray:
        """Return by what differences move a state, in columns; see the module."""
        units, n = self.structure.state_units, self.structure.n_floors
        steps = np.diag(units)
        steps[2 * n :, :n] = self.structure.slider_directions * units[:n]
        within = np.minimum(units[2 * n :], ELASTIC / DIFFERENCE * self._limits)
        steps[2 * n :, 2 * n :] = np.diag(within)
        return steps

    def _tangent(self, state: np.ndarray, amplitude: float, n_periods: int, poll=None):
        """Return d z(n_periods T) / d z(0), shape (2n + L, 2n + L)."""
        steps, n = self._steps(), 2 * self.structure.n_floors
        self._slid[:] = 0.0
        middle = self._end(state, amplitude, n_periods, poll) / self.structure.state_units
        sticks = n + np.flatnonzero(self._slid[PATH] == 0.0)
        for size in (DIFFERENCE, *NARROW):
            differences = self._differences(state, amplitude, n_periods, middle, size * steps, poll)
            if differences is not None:
                matrix = np.linalg.solve(size * steps.T, differences.T).T
                matrix[sticks] = np.eye(len(matrix))[sticks]
                return matrix
        raise ArithmeticError(
            "there is no tangent map: a slider comes to its strength, or a contact closes, and "
            "turns there"
        )

    def _differences(self, state, amplitude: float, n_periods: int, middle, steps, poll):
        """Return by how much steps, in columns, move the end; None where both sides differ."""
        units = self.structure.state_units

        def end(moved: np.ndarray) -> np.ndarray:
            return self._end(moved, amplitude, n_periods, poll) / units

        ends = []
        for step in steps.T:
            inward = -1.0 if self._is_beyond(state + step) else 1.0
            near = end(state + inward * step)
            if self._is_beyond(state - inward * step):  # a parabola through what can be
                far = 3.0 * (middle - near) + end(state + 2.0 * inward * step)
            else:
                far = end(state - inward * step)
            ends.append((near, far) if inward > 0 else (far, near))
        above, below = np.swapaxes(ends, 0, 1)
        # a direction that no structure prefers: kinks that are alike on both sides do not add up
        along = np.cos(np.arange(units.size))
        if self._is_beyond(state + steps @ along):
            along = -along
        added = middle + 0.5 * along @ (above - below)
        wrong = end(state + steps @ along) - added, above + below - 2.0 * middle
        largest = SMOOTH * (float((steps / units[:, None]).max()) + np.abs(above - below).max())
        if not max(np.abs(error).max() for error in wrong) <= largest:
            return None
        return 0.5 * (above - below).T * units[:, None]

    def _is_beyond(self, state: np.ndarray) -> bool:
        """Return whether no motion comes to a state: a slider beyond its strength, on the way back.

        Where it goes on it slips, so that p is not what the state says, but d -+ F / k.
        """
        rows, n = self.structure.slider_directions, self.structure.n_floors
        over = (rows @ state[:n] - state[2 * n :]) / self._limits
        return bool(np.any((np.abs(over) > 1.0) & (over * (rows @ state[n : 2 * n]) <= 0.0)))

    def _march(self, z, amplitude, n_periods, poll=None, points=None, wanted=NO_TALLY, *_):
        """Integrate like `FlowMap`, z the state of the kernels and p behind."""
        for first, last in self._polling.cut(n_periods, poll):
            part = None if points is None else points[first:last]
            done = self._advance(z, amplitude, last - first, wanted, part)
            if done[-1] != Outcome.COMPLETE:
                return first + done[0], Outcome(done[-1])
        return n_periods, Outcome.COMPLETE
