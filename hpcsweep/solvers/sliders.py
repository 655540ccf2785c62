"""The sliders of a structure between the kernels' modes and their lasting elongations p.

At a moment the state (u, u', p) tells the mode of each: a slider slips where its force is at its
strength, to rounding, and its elongation goes on; p then follows it, y -+ delta.
"""

import numpy as np

from hpcsweep.model.elements import LEVEL, SHARE, SIGN, SPRING, TAKES, Elements
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.measures import ROUNDING


class Sliders:
    """Sliders of a structure, the last L elements of a model.

    Parameters
    ----------
    structure : Structure
    elements : Elements
    """

    def __init__(self, structure: Structure, elements: Elements):
        self._elements, count = elements, len(structure.sliders)
        self.own = slice(len(elements.rows) - count, None)
        self._above, below = elements.rows[self.own].T
        self._below, self._lower = np.maximum(below, 0), np.where(below >= 0, 1.0, 0.0)
        # the kernels' rows are directions of sliders, or against them
        self.sign = np.array(
            [
                1.0 if np.array_equal(reach, slider.direction) else -1.0
                for reach, slider in zip(elements.reach, structure.sliders, strict=True)
            ]
        )
        self._takes = np.array(
            [elements.guard[first:last, TAKES].any() for first, last in _pairs(elements.guards)],
            bool,
        )
        first = elements.first[self.own]
        spans = [range(*elements.guards[mode : mode + 2]) for mode in first]
        self._first, self._guards = first, np.concatenate([np.array(one, int) for one in spans])
        self._of = np.repeat(np.arange(count), [len(one) for one in spans])

    def elongation(self, half: np.ndarray) -> np.ndarray:
        """Return y of each, or y' where `half` are the velocities of a state of the kernels."""
        return half[self._above] - self._lower * half[self._below]

    def load(self, modes) -> np.ndarray:
        """Return the load q of each."""
        load, share = self._elements.load[modes.mode[self.own]].T
        return load + share * modes.state[self.own]

    def plastic(self, z: np.ndarray, modes) -> tuple[np.ndarray, np.ndarray]:
        """Return p of each in a state, and by how much it has changed since it last stuck."""
        state, y = modes.state[self.own], self.elongation(z[: z.size // 2])
        found = np.where(self._takes[modes.mode[self.own]], self.load(modes) + y, state)
        return found, np.abs(found - state)

    def place(self, z: np.ndarray, plastic: np.ndarray, modes) -> None:
        """Write p and the modes of a state; paths begin anew."""
        modes.mode[:], modes.path[:], modes.taken[:] = self._elements.first, 0.0, 0
        modes.state[self.own] = plastic
        y, speed = (self.elongation(half)[self._of] for half in np.split(z, 2))
        sign, spring, level, share = self._elements.guard[self._guards][
            :, [SIGN, SPRING, LEVEL, SHARE]
        ].T
        value = sign * (spring * y - level - share * plastic[self._of])
        near = ROUNDING * np.maximum(np.abs(level), np.abs(y))
        passed = (value > near) | ((value > -near) & (sign * spring * speed > 0.0))
        mode = self._first.copy()
        mode[self._of[passed]] = self._elements.after[self._guards[passed]]
        modes.mode[self.own] = mode


def _pairs(ends: np.ndarray):
    return zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)
