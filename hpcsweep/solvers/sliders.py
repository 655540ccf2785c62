"""The sliders of a structure between the kernels' modes and their lasting elongations p."""

import math

import numpy as np

from hpcsweep.model.backbone import SIZE
from hpcsweep.model.degrading import LAST, LOST, NO_FORCE, PEAK, SLIPS, SLOPE, UNLOADS, WORK, YIELD
from hpcsweep.model.elements import TAKES, Elements
from hpcsweep.model.observed import ROUNDING
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units


class Sliders:
    """Sliders of a structure, the last L elements of a model.

    Parameters
    ----------
    structure : Structure
    elements : Elements
    """

    def __init__(self, structure: Structure, elements: Elements):
        self._elements, count = elements, len(structure.sliders)
        springs = [(slider.spring, slider.taken) for slider in structure.sliders]
        self._spring, self._taken = np.array(springs).reshape(-1, 2).T
        self._unit = structure.length_unit
        memory = [slider.memory(self._unit) for slider in structure.sliders]
        self.memory = np.array([each or [0.0] * SIZE for each in memory if any(memory)])
        self.own = slice(len(elements.rows) - count, len(elements.rows))
        self._above, below = elements.rows[self.own].T
        self._below, self._lower = np.maximum(below, 0), np.where(below >= 0, 1.0, 0.0)
        # the kernels' rows are directions of sliders, or against them
        self.sign = np.where((elements.reach == structure.slider_directions).all(axis=1), 1.0, -1.0)
        takes = np.split(elements.guard[:, TAKES] > 0.0, elements.guards[1:-1])
        self._takes = np.array([some.any() for some in takes], bool)

    def elongation(self, half: np.ndarray) -> np.ndarray:
        """Return y of each, or y' where `half` are the velocities of a state of the kernels."""
        return half[..., self._above] - self._lower * half[..., self._below]

    def load(self, mode: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the load q of each, in modes and states p of all elements."""
        load, share = np.moveaxis(self._elements.load[mode[..., self.own]], -1, 0)
        return load + share * state[..., self.own]

    def force(self, z: np.ndarray, mode: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the forces of the sliders, shape (..., L), at states (..., 2R) of the kernels."""
        slips = self._elements.sets[mode[..., self.own], 1] > 0
        taken = self._taken
        if self.memory.size:
            taken = taken * (1.0 - self.memories(state)[..., SLOPE])
        spring = np.where(slips, self._spring - taken, self._spring)
        force = spring * self.elongation(z) - self._taken * self.load(mode, state)
        return force * (self.sign * self._unit)

    def plastic(self, z: np.ndarray, modes) -> tuple[np.ndarray, np.ndarray]:
        """Return p of each in a state, and by how much it has changed since it last stuck."""
        state, load = modes.state[..., self.own], self.load(modes.mode, modes.state)
        takes = self._takes[modes.mode[..., self.own]]
        plastic = np.where(takes, load + self.elongation(z), load)  # a flag at home: 0, not state
        return plastic, np.abs(plastic - state)

    def memories(self, state: np.ndarray) -> np.ndarray:
        """Return the memory of each, shape (..., L, B), in states of all elements."""
        shape = *state.shape[:-1], self._spring.size, SIZE
        return state[..., len(self._elements.rows) :].reshape(shape)

    def degraded(self, z: np.ndarray, modes, rate: float) -> tuple[np.ndarray, dict]:
        """Return which degrade, and what they have done by the names of `Slid`, times in `rate`."""
        memory = np.moveaxis(self.memories(modes.state), -1, 0)
        y, load = self.elongation(z), self.load(modes.mode, modes.state)
        force, which = memory[SLOPE] * y - load, memory[YIELD] > 0.0
        last, stiffness = memory[LAST], np.where(which, memory[UNLOADS], 1.0)
        work = memory[WORK] + (0.5 * memory[SLOPE] * (y + last) - load) * (y - last)
        lost = modes.mode[self.own] == self._elements.first[self.own] + NO_FORCE
        return which, {
            "plastic": self.sign * (y - force / stiffness),
            "path": (work - 0.5 * force**2 / stiffness) / np.where(which, memory[YIELD], 1.0),
            "excursions": memory[SLIPS].astype(int),
            "stiffness": np.where(lost, 0.0, stiffness),
            "lost": np.where(lost, memory[LOST] / rate, math.nan),
            "largest": np.maximum(memory[PEAK], np.abs(force)),
        }

    def slips(self, z: np.ndarray, modes) -> np.ndarray:
        """Return whether p of each has changed by more than rounding since it last stuck."""
        (state, change), load = self.plastic(z, modes), self.load(modes.mode, modes.state)
        size = np.abs(self._elements.reach) @ np.abs(z[: self._elements.reach.shape[1]])
        return change > ROUNDING * np.maximum(np.maximum(np.abs(state), np.abs(load)), size)


class SliderUnits(Units):
    """Conversion of states (u, u', p) to those of the kernels with p behind, and back."""

    def __init__(self, units: Units, sliders: Sliders, length: float):
        self._state, self._unit = units, sliders.sign * length
        self.amplitude_unit = units.amplitude_unit

    @property
    def size(self) -> int:
        """Size of the state of the kernels: 2 R."""
        return self._state.size

    def into(self, states: np.ndarray) -> np.ndarray:
        """Return states of the kernels, a new array (..., 2R + L)."""
        states = np.asarray(states, float)
        first, p = np.split(states, [states.shape[-1] - len(self._unit)], -1)
        return np.concatenate((self._state.into(first), p / self._unit), -1)

    def out_of(self, z: np.ndarray) -> np.ndarray:
        """Return states of shape (..., 2n + L) from those of the kernels, a new array."""
        first, p = np.split(z, [self.size], -1)
        return np.concatenate((self._state.out_of(first), p * self._unit), -1)
