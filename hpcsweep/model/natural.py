"""Natural modes of a structure: frequencies, 0 of motions that no spring opposes, and shapes."""

import math
from functools import cached_property

import numpy as np

from hpcsweep.model.modes import natural_modes
from hpcsweep.model.system import System, frozen


class NaturalModes(System):
    """Modes of the free structure, whose sliders stick."""

    @cached_property
    def _modes(self) -> tuple[np.ndarray, np.ndarray]:
        if self.is_uniform:
            n = self.n_floors
            i = np.arange(1, n + 1)
            frequencies = 2 * np.sin((2 * i - 1) * math.pi / (4 * n + 2))
            floors, numbers = np.ogrid[1 : n + 1, 1 : n + 1]
            shapes = np.sin(floors * (2 * numbers - 1) * math.pi / (2 * n + 1))
            shapes = shapes / np.linalg.norm(shapes, axis=0)
        else:
            frequencies, shapes = natural_modes(
                self.mass_matrix, self.stiffness_matrix, self.n_rigid
            )
        return frozen(frequencies), frozen(shapes)

    @property
    def frequencies(self) -> np.ndarray:
        """Undamped natural frequencies of the free structure, ascending, 0 of rigid modes, (n,).

        Closed form of the fixed-free uniform chain: omega_i = 2 sin((2i - 1) pi / (4n + 2)).
        """
        return self._modes[0]

    @property
    def lowest(self) -> float:
        """Lowest frequency of the modes that vibrate; 0 where none does."""
        return float(self.frequencies[min(self.n_rigid, self.n_floors - 1)])

    @property
    def modes(self) -> np.ndarray:
        """Mode shapes Phi of (11), one a column, shape (n, n), with Phi^T M Phi = 1.

        Closed form of the uniform chain phi_ij ~ sin(i (2j - 1) pi / (2n + 1)); the sign makes the
        first entry that is not 0 positive.
        """
        return self._modes[1]

    @cached_property
    def modal_transform(self) -> np.ndarray:
        """Phi^-1 = Phi^T M, shape (n, n): takes displacements to modal coordinates."""
        if self.is_uniform:
            return self.modes.T
        return frozen(self.modes.T @ self.mass_matrix)

    @property
    def longest_period(self) -> float:
        """Longest natural period, of a structure that has not yielded; inf where none vibrates."""
        return 2.0 * math.pi / self.lowest if self.lowest > 0.0 else math.inf
