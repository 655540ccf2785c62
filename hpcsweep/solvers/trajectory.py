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
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units
from hpcsweep.solvers.arguments import solver_arguments
from hpcsweep.solvers.flow.flow_map import LAYER_TOLERANCE, MAX_STEPS
from hpcsweep.solvers.flow.march.record import march_record
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
        self._phases, self._polling = (turn + phase).ravel(), Polling()
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
        return Course(states, self._sliders.force(*held))

    def _through(self, n_periods: int) -> list[np.ndarray]:
        """Return the states of the kernels at all ends, with modes and p of elements."""
        modes, size = self._shared.modes, n_periods * self._parts + 1
        z, plastic = np.split(self._units.into(self.state), [self._units.size])
        held = [np.empty((size, row.size), row.dtype) for row in (z, *modes[:2])]
        for begin in range(0, size - 1, self._parts):
            if plastic.size:
                plastic = plastic if not begin else self._sliders.plastic(z, modes)[0]
                self._sliders.place(z, plastic, modes)
            for rows, start in zip(held, (z, *modes), strict=False):
                rows[begin] = start
            for first, last in self._polling.cut(self._parts):
                step = 1 if modes.mode.size else last - first
                for j in range(first, last, step):
                    ends = slice(begin + j + 1, begin + j + step + 1)
                    outcome = self._over(z, j, j + step, 1.0, held[0][ends])
                    if outcome != Outcome.COMPLETE:
                        where = f"in forcing period {begin // self._parts + 1}"
                        raise ArithmeticError(f"flow: {Outcome(outcome).name} {where}")
                    held[1][ends], held[2][ends] = modes[:2]
        return held

    def _over(self, z, first: int, last: int, share: float, points=None) -> int:
        """Advance z over parts of a period, or a share of one; return the outcome."""
        points = np.empty((0, z.size)) if points is None else points
        parts = first, last, share * self._shared.model.period
        return march_record(self._packed, z, self._phases, self._amplitude, parts, 0, points)[1]

    def crossings(self) -> "list[Crossing]":
        """Return the contacts that close and open in one forcing period, in order of time."""
        structure, held, changes = self.structure, self._through(1), list[Crossing]()
        contacts, modes = self._shared.model.contacts, self._shared.modes

        def distances(z: np.ndarray) -> np.ndarray:
            return contacts.sign * z[..., contacts.row] - contacts.gap

        def distance(share: float, j: int, contact: int) -> float:
            z, modes.mode[:], modes.state[:] = (rows[j].copy() for rows in held)
            self._over(z, j, j + 1, share)
            return float(distances(z)[contact])

        beyond = distances(held[0]) >= 0.0
        for j, k in zip(*np.nonzero(beyond[1:] != beyond[:-1]), strict=True):
            share = brentq(distance, 0.0, 1.0, (j, k), xtol=AT_CROSSING)
            number = structure.contact_numbers[k]
            changes.append(Crossing(number, bool(beyond[j + 1, k]), (j + share) / self._parts))
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
    """A contact that closes or opens."""

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
