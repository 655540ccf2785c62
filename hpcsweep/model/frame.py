"""States of a structure as the kernels hold them."""

import numpy as np

from hpcsweep.model.kernel_model import Model
from hpcsweep.model.structure import Structure


class Frame:
    """Takes states of a structure to those of the kernels and back.

    Parameters
    ----------
    structure : Structure
    model : Model
    """

    def __init__(self, structure: Structure, model: Model):
        self._n = structure.n_floors
        self._units = structure.state_units
        self._rows = model.rows
        self.amplitude_unit = structure.length_unit * structure.frequency_unit**2
        self._is_plain = not len(self._rows) and bool(np.all(self._units == 1.0))

    @property
    def size(self) -> int:
        """Of the state of the kernels: 2 R."""
        return 2 * (self._n + len(self._rows))

    def into(self, state: np.ndarray) -> np.ndarray:
        """Give the state of the kernels, shape (2R,), a new array, from one of shape (2n,)."""
        z = np.array(state, dtype=float)
        if self._is_plain:
            return z
        z = z / self._units
        u, v = z[: self._n], z[self._n :]
        return np.concatenate((u, self._rows @ u, v, self._rows @ v))

    def out_of(self, z: np.ndarray) -> np.ndarray:
        """Give states of shape (..., 2n) from those of the kernels, (..., 2R)."""
        if self._is_plain:
            return z
        half = z.shape[-1] // 2
        return np.concatenate((z[..., : self._n], z[..., half : half + self._n]), -1) * self._units

    def tangent_into(self, columns: np.ndarray) -> np.ndarray:
        """Take tangent vectors, columns of shape (2n, m), to those of the kernels, (2R, m)."""
        if self._is_plain:
            return np.array(columns, dtype=float)
        scaled = columns / self._units[:, None]
        u, v = scaled[: self._n], scaled[self._n :]
        return np.concatenate((u, self._rows @ u, v, self._rows @ v))

    def tangent_out_of(self, columns: np.ndarray) -> np.ndarray:
        """Take tangent vectors back."""
        if self._is_plain:
            return columns
        half = len(columns) // 2
        kept = np.concatenate((columns[: self._n], columns[half : half + self._n]))
        return kept * self._units[:, None]
