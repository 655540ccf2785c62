r"""States of a motion under a record at many instants, from one march.

Intervals are marched in chunks (`flow.march.record`), which gives the states at their ends, and
nothing else is gathered. What changes within a chunk, a contact or a slider, the kernels' counts
tell. Such a chunk is marched again in halves, down to single intervals, of which alone the peaks of
the forces are needed: where nothing changes, and no contact is closed at the end, none pushes.

Where the motion between the instants is needed, intervals in which something changes or a contact
pushes are cut in halves, as long as the polynomial of degree five that has u, u' and u'' at both
ends of a piece, a and b, misses the acceleration in its middle m,

    |u''(m) - (3/2) (u'(b) - u'(a)) / (b - a) + (u''(a) + u''(b)) / 4| (b - a)^3 > e,

with b - a in intervals and e a part of the peak of the ground: integrals of a smooth function times
what is missed are of that order. Each state is one of the kernels, after a march from the start of
the interval. So the pieces close in on the times at which the motion has kinks.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.model.modes import per_mass
from hpcsweep.model.observed import DISSIPATED
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.march.record import ALL_PEAKS, WITH_ENERGY
from hpcsweep.solvers.flow.observe.gathered import reset
from hpcsweep.solvers.flow.record_map import RecordMap
from hpcsweep.solvers.flow.state.shared import PASSAGES, TABLES
from hpcsweep.solvers.flow.state.tables import OF_CONTACTS
from hpcsweep.solvers.outcome import COLLAPSED, COMPLETE, Outcome
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.record_response import Energy, energy_at

MOST = 64
"""Intervals of a chunk."""
HALVINGS = 16
"""Of an interval, at most."""


class Motion(NamedTuple):
    """A motion at p instants; up to a collapse."""

    place: np.ndarray
    """In intervals from the first sample on, shape (p,): whole ones, and what is between them."""
    states: np.ndarray
    """Shape (p, 2n)."""
    slider_force: np.ndarray
    """Shape (p, L)."""
    peak_force: np.ndarray
    """Largest force of each contact over each interval, the first of which ends at the first
    sample, shape (whole ones, k)."""


class InstantMap(RecordMap):
    """Follow motions from rest through all instants; see `RecordMap`."""

    def follow(
        self, samples: np.ndarray, scale: float, count: int, poll: Poll = None, missed: float = 0.0
    ) -> Motion:
        """Follow a motion over `count` intervals.

        Parameters
        ----------
        samples : ndarray, shape (m,)
            Of the ground; 0 from the last one on.
        scale, poll
            As of `hpcsweep.solvers.history.history`.
        missed : float
            e over the peak of the ground; 0: states are those at the ends of the intervals.

        Raises
        ------
        ArithmeticError
            If the solver fails.
        """
        self._samples, self._amplitude = samples, scale / self._units.amplitude_unit
        least = missed * abs(scale) * float(np.abs(samples).max())
        held, peaks, starts = self._through(count, poll, least > 0.0)
        place = np.arange(float(len(peaks)))
        if starts:
            more = self._inside(starts, held, least)
            place = np.concatenate((place, more[0]))
            order = np.argsort(place, kind="stable")
            place = place[order]
            held = [np.vstack(pair)[order] for pair in zip(held, more[1:], strict=True)]
        length = self.structure.length_unit
        force = self.structure.switched(peaks, peaks * length)
        force *= self.structure.force_per_length * length
        return Motion(place, self._units.out_of(held[0]), self._sliders.force(*held), force)

    def _through(self, count: int, poll, keeps: bool):
        """Return states of the kernels with modes, peaks, and starts of intervals with changes."""
        shared, modes, z = self._shared, self._shared.modes, self._at_rest()
        held = [np.empty((count + 1, row.size), row.dtype) for row in (z, *modes[:2])]
        points, elements = held[0], modes.mode.size > 0
        for rows, start in zip(held, (z, *modes), strict=False):
            rows[0] = start
        contacts, first_row = shared.model.contacts, int(shared.outputs.first[OF_CONTACTS])
        pushed = shared.tally.peaks[first_row : first_row + len(contacts.row)]
        peaks = np.zeros((count + 1, pushed.size))
        changes, starts = shared.counts[PASSAGES:TABLES], dict[int, list]()
        first, size, outcome = 0, 1, int(Outcome.COMPLETE)
        while first < count and outcome == COMPLETE:
            if poll is not None:
                poll()
            last, before = min(first + size, count), changes.tolist()
            is_single = last == first + 1
            kept = self._kept(z) if keeps or not is_single else []
            if is_single:
                pushed.fill(0.0)
            wanted, ends = ALL_PEAKS if is_single else 0, points[first + 1 : last + 1]
            done, outcome = self._interval(z, (first, last), 1.0, wanted, ends)
            is_quiet = changes.tolist() == before and outcome == COMPLETE
            if is_single:
                peaks[last] = pushed
                is_quiet = is_quiet and not any(pushed.tolist())
            elif not is_quiet or (contacts.sign * z[contacts.row] >= contacts.gap).any():
                past = (contacts.sign * ends[:done, contacts.row] >= contacts.gap).any(axis=1)
                self._back_to(z, kept)
                size = max(int(past.argmax()) if past.any() else (last - first) // 2, 1)
                outcome = int(Outcome.COMPLETE)
                continue
            if elements:
                held[1][first + 1 : last + 1], held[2][first + 1 : last + 1] = modes[:2]
            if is_single and not is_quiet and keeps and outcome == COMPLETE:
                starts[first] = kept
            first, size = first + done, min(2 * size, MOST) if is_quiet else 1
        if outcome not in (COMPLETE, COLLAPSED):
            raise ArithmeticError(f"flow: {Outcome(outcome).name} at {first * self.dt:.6g}")
        return [rows[: first + 1] for rows in held], peaks[: first + 1], starts

    def energies(self, samples: np.ndarray, scale: float, count: int) -> list[Energy]:
        """Return the energies at the ends of `count` intervals, and at rest, up to a collapse.

        Raises
        ------
        ArithmeticError
            If the solver fails.
        """
        self._samples, self._amplitude = samples, scale / self._units.amplitude_unit
        structure, tally, z = self.structure, self._shared.tally, self._at_rest()
        reset(tally)
        unit = structure.force_per_length * structure.length_unit**2
        ends, outcome = [Energy(*6 * [0.0])], int(Outcome.COMPLETE)
        while len(ends) <= count:
            j = len(ends) - 1
            _, outcome = self._interval(z, (j, j + 1), 1.0, WITH_ENERGY)
            if outcome == COLLAPSED:
                break
            if outcome != COMPLETE:
                raise ArithmeticError(f"flow: {Outcome(outcome).name} at {j * self.dt:.6g}")
            slid = self._slid(z)
            path = slid.path * structure.length_unit
            taken = tally.impacts[DISSIPATED] * unit, structure.slider_losses(path, slid.excursions)
            reached = self._units.out_of(z), slid
            ends.append(energy_at(structure, reached, taken, structure.rest, tally.energy))
        return ends

    def _interval(self, z, places, part, wanted=0, points=None) -> tuple[int, int]:
        """Advance z over intervals, or a part of one; return how many, and the outcome."""
        intervals = (*places, part * self._shared.model.period)
        return self._march(z, self._samples, self._amplitude, intervals, wanted, points)

    def _kept(self, z: np.ndarray) -> list[np.ndarray]:
        """Copy a state, and what the elements carry."""
        modes = self._shared.modes
        return [array.copy() for array in ((z, *modes) if modes.mode.size else (z,))]

    def _back_to(self, z: np.ndarray, kept: list[np.ndarray]) -> None:
        """Restore what `_kept` has copied."""
        for array, value in zip((z, *self._shared.modes), kept, strict=False):
            array[:] = value

    def _inside(self, starts: dict[int, list], held: list, least: float) -> list[np.ndarray]:
        """Return places, states and modes within intervals, from what is kept of their starts."""
        which, length, inside = np.array([*starts], int), 1.0, []
        begin = np.zeros(which.size)
        low = self._rates([rows[which] for rows in held], which, begin)
        high = self._rates([rows[which + 1] for rows in held], which, begin + 1.0)
        z = held[0][0].copy()
        while which.size and length > 0.5**HALVINGS:
            middle, reached = begin + 0.5 * length, []
            for j, s in zip(which.tolist(), middle.tolist(), strict=True):
                self._back_to(z, starts[j])
                self._interval(z, (j, j + 1), s)
                reached.append([array.copy() for array in (z, *self._shared.modes[:2])])
            rows = [np.array(array) for array in zip(*reached, strict=True)]
            inside.append([which + middle, *rows])
            rates = self._rates(rows, which, middle)
            mean = 1.5 * (high - low)[:, 0] / (length * self.dt) - 0.25 * (high + low)[:, 1]
            missed = np.abs(rates[:, 1] - mean).max(axis=1) * length**3
            cut = missed > least
            low = np.concatenate((low[cut], rates[cut]))
            high = np.concatenate((rates[cut], high[cut]))
            begin = np.concatenate((begin[cut], middle[cut]))
            which, length = np.tile(which[cut], 2), 0.5 * length
        return [np.concatenate(array) for array in zip(*inside, strict=True)]

    def _rates(self, held: list, which: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Return velocities and accelerations at parts of intervals, shape (p, 2, n)."""
        last = self._samples.size - 1
        ground = np.interp(which + part, np.arange(last + 1), self._samples)
        ground *= (which < last) * self._amplitude * self._units.amplitude_unit
        states = self._units.out_of(held[0])
        forces = self.structure.contact_forces(states), self._sliders.force(*held)
        bends = accelerations(self.structure, states, forces, ground)
        return np.stack((states[:, bends.shape[1] :], bends), axis=1)


def accelerations(
    structure: Structure, states: np.ndarray, forces: tuple[np.ndarray, np.ndarray], ground=None
) -> np.ndarray:
    """Return accelerations at states, shape (p, n), from the forces of contacts and sliders.

    With the scaled G at each, shape (p,), it is u''; without it that of a base that shakes is
    absolute.
    """
    u, v = np.split(states, 2, axis=-1)
    force, slider_force = forces
    push = 0.0 if ground is None else np.outer(ground, structure.forcing_vector)
    damping = np.ascontiguousarray(structure.damping_matrix.T)
    push = push - u @ structure.elastic_stiffness - v @ damping
    push -= force @ structure.directions
    push -= slider_force @ structure.slider_directions
    return per_mass(structure.mass_matrix, push.T).T
