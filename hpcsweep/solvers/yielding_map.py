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

from dataclasses import replace

import numpy as np

from hpcsweep.model.observed import DRIFT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import closing_arguments, motion, points_array
from hpcsweep.solvers.flow.flow_map import FlowMap
from hpcsweep.solvers.flow.orbit.chain import Images
from hpcsweep.solvers.flow.orbit.transient import ROUNDING
from hpcsweep.solvers.flow.state.shared import ANY_MEASURE, MAXIMA, NO_TALLY, NORMS
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Approach, Growth, Observation
from hpcsweep.solvers.sliders import Sliders, SliderUnits

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
        super().__init__(structure, omega, rtol)
        self._sliders = Sliders(structure, self._shared.model.elements)
        self._units = SliderUnits(self._units, self._sliders, structure.length_unit)
        self._strength = np.array([slider.strength for slider in structure.sliders])
        self._limits = np.array([slider.limit for slider in structure.sliders])
        self._path = np.zeros(len(structure.sliders))
        self._excursions, self._slipping = np.zeros((2, len(structure.sliders)), int)

    def settle(
        self, state, amplitude, n_periods, max_period, settled, same, near=0.0, poll=None
    ) -> Approach:
        """Advance until the orbit has closed; as `flow.orbit.transient.watch_motion` tells it."""
        z, amplitude, n_periods = self._motion(state, amplitude, n_periods)
        max_period, settled, same, _ = closing_arguments(max_period, settled, same, near)
        ring, size, close = max_period + 1, 2 * max_period + 1, np.zeros(max_period + 1, int)
        history, distance = np.tile(self._place(z), (size, 1)), np.full((ring, ring), np.inf)
        for k in range(1, n_periods + 1):
            done, outcome = self._march(z, amplitude, 1, poll)
            if not done:
                return Approach(self._units.out_of(z), k - 1, 0, 0, np.nan, outcome)
            p = np.arange(1, min(max_period, k) + 1)
            point = history[k % size] = self._place(z)
            e = np.abs(point - history[(k - p) % size]).max(axis=1)
            before = np.where(k >= 2 * p, distance[(k - p) % ring, p], -np.inf)
            to_go = np.full(p.size, np.inf)
            falls = e < before
            to_go[falls] = e[falls] ** 2 / (before - e)[falls]
            rounded = ROUNDING * (1.0 + np.abs(point).max())
            to_go[(e <= rounded) & (k >= 2 * p)] = 0.0
            distance[k % ring, p] = e
            close[p] = np.where(to_go <= settled, close[p] + 1, 0)
            closed = np.flatnonzero(close[1:] >= 2 * np.arange(1, ring) + 1)
            if closed.size:
                last = int(closed[0]) + 1
                shorter = (q for q in range(1, last) if last % q == 0 and e[q - 1] <= same)
                period = next(shorter, last)
                return Approach(self._units.out_of(z), k, 0, period, np.nan, Outcome.COMPLETE)
        return Approach(self._units.out_of(z), n_periods, 0, 0, np.nan, Outcome.COMPLETE)

    def _place(self, z: np.ndarray) -> np.ndarray:
        """Return a state relative to what drifts, in its units."""
        structure = self.structure
        return structure.without_drift(self._units.out_of(z)) / structure.state_units

    def observe(
        self, state, amplitude, n_periods, modal_norm=False, growth=False, poll=None, measures=0
    ) -> Observation:
        """Integrate `n_periods` and gather; without the growth of a tangent vector."""
        self._path[:], self._excursions[:], self._slipping[:] = 0.0, 0, 0
        seen = super().observe(state, amplitude, n_periods, modal_norm, False, poll, measures)
        return self._told(seen, state)

    def observe_each(self, states, amplitude, measures=0, poll=None) -> Observation:
        """Integrate states over one forcing period each, and gather."""
        self._path[:], self._excursions[:], self._slipping[:] = 0.0, 0, 0
        seen = super().observe_each(states, amplitude, measures, poll)
        return self._told(seen, states[0])

    def _told(self, seen: Observation, state) -> Observation:
        """Return an observation with what sliders have done, its drifts those of the structure."""
        tally, model, structure = self._shared.tally, self._shared.model, self.structure
        # drifts of the kernels are those of the structure, then elongations of sliders
        n, rows = len(structure.drift_rows), model.drift_rows.tolist()
        drifts = tally.peaks[: len(rows)] * structure.length_unit
        slides = [rows.index(row) for row in model.elements.rows[self._sliders.own].tolist()]
        periods = len(seen.points)
        change = (seen.points[-1] if periods else state) - np.asarray(state, float)
        slid = {
            "ductility": drifts[slides] / self._limits,
            "slider_energy": self._strength * self._path * structure.length_unit / max(periods, 1),
            "plastic": change[2 * structure.n_floors :] / max(periods, 1),
            "excursions": self._excursions.copy(),
            "slipping": self._slipping.copy(),
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
        self._path[:] = 0.0
        middle = self._end(state, amplitude, n_periods, poll) / self.structure.state_units
        sticks = n + np.flatnonzero(self._path == 0.0)
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
        """Integrate like `FlowMap`, z the state of the kernels and p behind; add to the paths."""
        shared, sliders, size = self._shared, self._sliders, self._units.size
        nothing = np.empty((0, size)), wanted, np.empty((size, 0)), np.empty(0)
        for first, last in self._polling.cut(n_periods, poll):
            for number in range(first, last):
                sliders.place(z[:size], z[size:], shared.modes)
                _, outcome = self._kernels.march(self._packed, z[:size], amplitude, 1, *nothing)
                if outcome != Outcome.COMPLETE:
                    return number, Outcome(outcome)
                z[size:], change = sliders.plastic(z[:size], shared.modes)
                self._path += shared.modes.path[sliders.own] + change
                self._excursions += shared.modes.taken[sliders.own]
                self._slipping += change > 0.0
                if points is not None:
                    points[number] = z
        return n_periods, Outcome.COMPLETE
