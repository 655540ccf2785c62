r"""The motion within forcing periods, from one march.

A part of a forcing period is to the kernels what a sample interval of a record is
(`flow.march.record`): it begins at its own phases of the harmonics, in place of its own sample. So
the states at all instants are those of the exact flow, of a period that begins at its stroboscopic
point.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from hpcsweep.kernels.compile.warm import load_all
from hpcsweep.model.arguments import count, finite, finite_vector, forcing_frequency, instance
from hpcsweep.model.observed import CLOSINGS
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import solver_arguments
from hpcsweep.solvers.flow.flow_map import LAYER_TOLERANCE, MAX_STEPS
from hpcsweep.solvers.flow.march.record import ALL_PEAKS, march_record
from hpcsweep.solvers.flow.observe.gathered import reset
from hpcsweep.solvers.flow.orbit.yielding import begin_period
from hpcsweep.solvers.flow.record_map import kernels_of
from hpcsweep.solvers.flow.state.shared import shared_at
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.polling import Polling
from hpcsweep.solvers.sliders import Sliders, SliderUnits

MAX_SAMPLES = 10**7
SHORTEST = 1e-4
"""In forcing periods: interval at which distances from contacts are tested."""
AT_CROSSING = 1e-10
"""Part of that interval to which a crossing is found."""


class Course(NamedTuple):
    """A motion at p instants of forcing periods."""

    states: np.ndarray
    """Shape (p, 2n + L)."""
    slider_force: np.ndarray
    """Shape (p, L)."""


class PeriodMap:
    """Follow a motion through the parts of forcing periods.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
    state : array_like, shape (2n + L,)
        At tau = 0.
    parts : int
        Of each forcing period.
    rtol : float
        As of `FlowMap`.
    """

    def __init__(self, structure, amplitude, omega, state, parts: int, rtol: float = 1e-9):
        instance("structure", structure, Structure)
        amplitude = finite("amplitude", amplitude)
        self.state = finite_vector("state", state, structure.state_units.size)
        structure = structure.within_reach(amplitude, self.state)
        structure = structure.measured_at(forcing_frequency("omega", omega), amplitude)
        self.structure, omega, rtol = solver_arguments(structure, omega, rtol, yields=True)
        tolerance = min(LAYER_TOLERANCE * rtol, 1e-9)
        made = shared_at(self.structure, omega, tolerance, MAX_STEPS, parts)
        self._shared, self._packed, _ = made
        units = Units(self.structure, self._shared.model)
        self._sliders = Sliders(self.structure, self._shared.model.elements)
        self._units = SliderUnits(units, self._sliders, self.structure.length_unit)
        self._amplitude, self._parts = amplitude / units.amplitude_unit, parts
        order, _, phase = np.array(self.structure.forcing.terms).T
        turn = 2.0 * math.pi * np.outer(np.arange(parts) / parts, order)
        self._phases, self._polling, self._wanted = (turn + phase).ravel(), Polling(), 0
        load_all(kernels_of(self.structure))

    def follow(self, n_periods: int = 1) -> Course:
        """Return the motion at the ends of all parts, the first and the last included.

        Raises
        ------
        ArithmeticError
            If the solver fails.
        """
        held = self._through(n_periods)
        modes = self._shared.modes._replace(mode=held[1], state=held[2])
        plastic = self._sliders.plastic(held[0], modes)[0]
        states = self._units.out_of(np.concatenate((held[0], plastic), -1))
        states[0] = self.state
        return Course(states, self._sliders.force(*held[:3]))

    def _through(self, n_periods: int) -> list[np.ndarray]:
        """Return the states of the kernels at all ends, with modes and p of elements, closings."""
        modes, size = self._shared.modes, n_periods * self._parts + 1
        z, plastic = np.split(self._units.into(self.state), [self._units.size])
        closings = self._shared.tally.impacts[CLOSINGS]
        carried = z, *modes[:2], closings
        held = [np.zeros((size, row.size), row.dtype) for row in carried]
        for begin in range(0, size - 1, self._parts):
            if plastic.size:
                plastic = plastic if not begin else self._sliders.plastic(z, modes)[0]
                elements = self._shared.model.elements
                begin_period(np.append(z, plastic), z.size, modes, elements)
            for rows, start in zip(held, carried, strict=True):
                rows[begin] = start
            for first, last in self._polling.cut(self._parts):
                step = 1 if modes.mode.size else last - first
                for j in range(first, last, step):
                    ends = slice(begin + j + 1, begin + j + step + 1)
                    outcome = self._over(z, j, j + step, 1.0, held[0][ends])
                    if outcome != Outcome.COMPLETE:
                        where = f"in forcing period {begin // self._parts + 1}"
                        raise ArithmeticError(f"flow: {Outcome(outcome).name} {where}")
                    held[1][ends], held[2][ends], held[3][ends] = *modes[:2], closings
        return held

    def _over(self, z, first: int, last: int, share: float, points=None) -> int:
        """Advance z over parts of a period, or a share of one; return the outcome."""
        points = np.empty((0, z.size)) if points is None else points
        parts = first, last, share * self._shared.model.period
        march = self._packed, z, self._phases, self._amplitude, parts, self._wanted, points
        return march_record(*march)[1]

    def crossings(self) -> "list[Crossing]":
        """Return the contacts that close and open in one forcing period, in order of time."""
        rigid, tally, changes = self.structure.is_rigid, self._shared.tally, list[Crossing]()
        contacts, modes, model = self._shared.model.contacts, self._shared.modes, self._shared.model
        reset(tally)
        self._wanted = ALL_PEAKS if rigid.any() else 0
        held = self._through(1)

        def distances(z: np.ndarray) -> np.ndarray:
            return contacts.sign * z[..., contacts.row] - contacts.gap

        def at(share: float, j: int) -> np.ndarray:
            z, modes.mode[:], modes.state[:] = (rows[j].copy() for rows in held[:3])
            reset(tally)
            self._over(z, j, j + 1, share)
            return z

        def told(j: int, k: int, closes: bool, of) -> None:
            share = brentq(lambda share: of(at(share, j)), 0.0, 1.0, xtol=AT_CROSSING)
            number = self.structure.contact_numbers[k]
            changes.append(Crossing(number, closes, (j + share) / self._parts))

        beyond = (distances(held[0]) >= 0.0) & ~rigid
        for j, k in np.argwhere(beyond[1:] != beyond[:-1]).tolist():
            told(j, k, bool(beyond[j + 1, k]), lambda z, k=k: float(distances(z)[k]))
        struck = np.diff(held[3], axis=0).astype(int) * rigid
        for j, k in np.argwhere(struck).tolist():
            for i in range(struck[j, k]):
                told(j, k, True, lambda _, k=k, i=i: tally.impacts[CLOSINGS, k] - i - 0.5)
        size = rigid.size * bool(rigid.any())
        first = model.elements.first[:size]
        rests = (held[1][:, :size] != first) & rigid[:size]
        for j, k in np.argwhere(rests[:-1] & ~rests[1:]).tolist():
            told(j, k, False, lambda _, k=k: 0.5 - (modes.mode[k] != first[k]))
        return sorted(changes, key=lambda change: change.phase)


def trajectory(
    structure: Structure, amplitude: float, omega: float, state: Any, n_samples: int = 800
) -> np.ndarray:
    """Follow one forcing period and sample it evenly in time.

    Parameters
    ----------
    structure : Structure
    amplitude, omega : float
    state : ndarray, shape (2n + L,)
        At tau = 0.
    n_samples : int
        At least 2; the first is at tau = 0, the last at tau = T.

    Returns
    -------
    ndarray, shape (n_samples, 2n + L)

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails.
    """
    n_samples = count("n_samples", n_samples, 2, MAX_SAMPLES)
    return PeriodMap(structure, amplitude, omega, state, n_samples - 1).follow().states


class Crossing(NamedTuple):
    """A contact that closes or opens: a rigid one at impacts, and where it rests no more."""

    contact: int
    """Number of the contact, from 1."""
    closes: bool
    phase: float
    """Share of the forcing period."""


def crossings(structure: Structure, amplitude: float, omega: float, state: Any) -> list[Crossing]:
    """Return the contacts that close and open in one forcing period, in order of time.

    Parameters and errors as of `trajectory`. A contact shorter than `SHORTEST` forcing periods may
    be missed.
    """
    return PeriodMap(structure, amplitude, omega, state, round(1 / SHORTEST)).crossings()
