"""The rule `linear` for the runs of a structure: its closed form, and the data of its proof.

The proof is that of `solvers.free`.
"""

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.free import FREE, NOT_KNOWN, Free, is_free
from hpcsweep.solvers.linear import LinearOrbit, period_map
from hpcsweep.solvers.records import Observation

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
        self.orbit, self._size = LinearOrbit(structure, omega), 2 * structure.n_floors
        free = NOT_KNOWN
        if self.orbit.is_known:
            free = _tables(structure, self.orbit, omega, transient, sampling, same)
        self.packed = FREE.pack(free)

    def window(self, state: np.ndarray, amplitude: float) -> Observation | None:
        """Return the steady window of the run from `state`, or None if it is not proved linear.

        The point of the window is the state at its end. No slider may have slipped.
        """
        end, size = np.array(state, dtype=float), self._size
        if end[size:].any() or not is_free(self.packed, end[:size].copy(), amplitude, end[:size]):
            return None
        return self.orbit.observation(amplitude, end)


def _tables(
    structure: Structure,
    orbit: LinearOrbit,
    omega: float,
    transient: int,
    sampling: int,
    same: float,
) -> Free:
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
