"""The rule `linear` for the runs of a structure: its closed form, and the data of its proof.

The proof is that of `solvers.free`.
"""

import math
from functools import cached_property

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.free import DECAYS, FREE, NOT_KNOWN, Free, is_free
from hpcsweep.solvers.linear import LinearOrbit, period_map
from hpcsweep.solvers.records import Observation
from hpcsweep.solvers.skip_rule import STABLE

DECAYED = 0.1
"""Largest remaining transient after `transient_cycles`, in units of the period tolerance, for which
the closed form is used."""


class FreeMotion:
    """The rule for the runs of one structure at one frequency.

    Parameters
    ----------
    structure : Structure
    omega : float
    transient, sampling : int
        Forcing periods discarded, and of the window after them.
    same : float
        Distance (gaps, gaps omega_0) between points that count as one.
    """

    def __init__(
        self, structure: Structure, omega: float, transient: int, sampling: int, same: float
    ):
        self.orbit, self._structure = LinearOrbit(structure, omega), structure
        free = NOT_KNOWN
        if self.orbit.is_known:
            free = _tables(structure, self.orbit, omega, transient, sampling, same)
            rate = self.orbit.lyapunov_exponent * structure.forcing.period(omega)
            self._multiplier = math.exp(min(rate, 0.0))
        self._free, self.packed = FREE.place(free)

    def window(self, state: np.ndarray, amplitude: float) -> Observation | None:
        """Return the steady window of the run from `state`, or None if it is not proved linear.

        The point of the window is the state at its end. No slider may have slipped.
        """
        end, size = np.array(state, dtype=float), 2 * self._structure.n_floors
        if end[size:].any() or self._proved(end[:size].copy(), amplitude, end[:size]) != DECAYS:
            return None
        return self.orbit.observation(amplitude, end)

    def jump(self, state: np.ndarray, amplitude: float) -> tuple[np.ndarray, float] | None:
        """Return the steady state (u, u', p), p kept, and its multiplier; None if none is proved.

        With p the structure moves about where it rests on its sliders, u_0 = K^-1 B^T k p.
        """
        if not self.orbit.is_known or self._multiplier > STABLE:
            return None
        n, p = self._structure.n_floors, state[2 * self._structure.n_floors :]
        point = np.concatenate((self._rest @ p, np.zeros(n), p))
        moved = state[: 2 * n] - point[: 2 * n]
        shift = self.orbit.directions @ point[:n]
        shift[len(shift) - 2 * len(p) :] -= np.concatenate((p, -p))
        if not self._proved(moved, amplitude, np.empty(2 * n), shift):
            return None
        point[: 2 * n] += amplitude * self._free.point
        return point, self._multiplier

    @cached_property
    def _rest(self) -> np.ndarray:
        """K^-1 B^T k."""
        structure = self._structure
        springs = np.array([slider.spring for slider in structure.sliders])
        load = structure.slider_directions.T * springs
        return np.linalg.solve(structure.held_stiffness, load)

    def _proved(self, state, amplitude: float, end, shift=0.0) -> int:
        """Call `free.is_free`, of a structure that rests so far along its directions."""
        if self.orbit.is_known:
            self._free.levels[:] = self.orbit.levels - shift
        return is_free(self.packed, state, amplitude, end)


def _tables(structure, orbit, omega, transient, sampling, same) -> Free:
    n = structure.n_floors
    phi, frequencies = structure.modes, structure.frequencies
    modal = orbit.directions @ phi
    once = period_map(structure, structure.forcing.period(omega))
    left, end = (np.linalg.matrix_power(once, count) for count in (transient, transient + sampling))
    shapes = np.kron(np.eye(2), phi)
    return Free(
        known=True,
        levels=orbit.levels,
        largest=orbit.largest,
        point=orbit.state(1.0),
        transform=structure.modal_transform.copy("C"),
        frequencies=frequencies.copy(),
        reach=np.abs(modal),
        softness=np.sqrt(((modal / frequencies) ** 2).sum(axis=1)),
        coupled=not structure.is_modal,
        left=left / np.repeat(structure.state_units[[0, n]], n)[:, None],
        end=shapes @ end,
        most=DECAYED * same / float(np.abs(phi).max()),
        modal=np.empty(2 * n),
        size=np.empty(n),
    )
