"""Convert states of a structure to those of the kernels."""

import numpy as np

from hpcsweep.model.kernel_model import Model
from hpcsweep.model.structure import Structure


class Units:
    """Conversion of states of a structure to those of the kernels and back.

    Parameters
    ----------
    structure : Structure
    model : Model
    """

    def __init__(self, structure: Structure, model: Model):
        self._n = structure.n_floors
        self._units = structure.state_units[: 2 * self._n]
        self._rows = model.rows
        self.amplitude_unit = structure.length_unit * structure.frequency_unit**2
        self._is_plain = not len(self._rows) and bool(np.all(self._units == 1.0))

    @property
    def size(self) -> int:
        """Size of the state of the kernels: 2 R."""
        return 2 * (self._n + len(self._rows))

    def into(self, states: np.ndarray) -> np.ndarray:
        """Return states of the kernels, a new array (..., 2R), from states (..., 2n)."""
        z = np.array(states, dtype=float)
        if self._is_plain:
            return z
        z /= self._units
        u, v = z[..., : self._n], z[..., self._n :]
        return np.concatenate((u, u @ self._rows.T, v, v @ self._rows.T), -1)

    def out_of(self, z: np.ndarray) -> np.ndarray:
        """Return states of shape (..., 2n) from those of the kernels, (..., 2R)."""
        if self._is_plain:
            return z
        half = z.shape[-1] // 2
        states = np.concatenate((z[..., : self._n], z[..., half : half + self._n]), -1)
        states *= self._units
        return states

    def tangent_into(self, columns: np.ndarray) -> np.ndarray:
        """Return tangent vectors of the kernels, (2R, m), from columns of shape (2n, m)."""
        return np.ascontiguousarray(self.into(columns.T).T)

    def tangent_out_of(self, columns: np.ndarray) -> np.ndarray:
        """Return tangent vectors from those of the kernels."""
        return np.ascontiguousarray(self.out_of(columns.T).T)
