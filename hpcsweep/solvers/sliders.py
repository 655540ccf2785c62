"""The sliders of a structure between the kernels' modes and their lasting elongations p."""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.model.backbone import SIZE
from hpcsweep.model.degrading import (
    LAST,
    LOST,
    NO_FORCE,
    PEAK,
    SLIPS,
    SLOPE,
    UNLOADS,
    WORK,
    YIELD,
)
from hpcsweep.model.elements import TAKES, Elements
from hpcsweep.model.observed import ROUNDING
from hpcsweep.model.structure import Structure
from hpcsweep.model.units import Units


class Degraded(NamedTuple):
    """How sliders that degrade have ended, shapes (L,), in the kernels' units."""

    which: np.ndarray
    stiffness: np.ndarray
    """Part of k with which each unloads, 0 without force ..."""
    plastic: np.ndarray
    """... and the elongation to which."""
    path: np.ndarray
    """Energy that it has dissipated over its strength."""
    slips: np.ndarray
    force: np.ndarray
    """Largest at events and at the end, over k."""
    lost: np.ndarray
    """Time at which its force was lost, NaN if it was not."""


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
        self._degrade = any(memory)
        self.memory = np.array([one or [0.0] * SIZE for one in memory if self._degrade])
        self.own = slice(len(elements.rows) - count, len(elements.rows))
        self._above, below = elements.rows[self.own].T
        self._below, self._lower = np.maximum(below, 0), np.where(below >= 0, 1.0, 0.0)
        # the kernels' rows are directions of sliders, or against them
        along = (elements.reach == structure.slider_directions).all(axis=1)
        self.sign = np.where(along, 1.0, -1.0)
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
        if self._degrade:
            taken = taken * (1.0 - self._memory(state)[..., SLOPE])
        spring = np.where(slips, self._spring - taken, self._spring)
        force = spring * self.elongation(z) - self._taken * self.load(mode, state)
        return force * (self.sign * self._unit)

    def plastic(self, z: np.ndarray, modes) -> tuple[np.ndarray, np.ndarray]:
        """Return p of each in a state, and by how much it has changed since it last stuck."""
        state, load = modes.state[..., self.own], self.load(modes.mode, modes.state)
        takes = self._takes[modes.mode[..., self.own]]
        plastic = np.where(takes, load + self.elongation(z), load)  # a flag at home: 0, not state
        return plastic, np.abs(plastic - state)

    def _memory(self, state: np.ndarray) -> np.ndarray:
        """Return the memory of each, shape (..., L, B), in states of all elements."""
        shape = *state.shape[:-1], self._spring.size, SIZE
        return state[..., len(self._elements.rows) :].reshape(shape)

    def degraded(self, z: np.ndarray, modes) -> Degraded:
        """Return how those that degrade have ended; of others the part 1 and no loss."""
        if not self._degrade:
            size = self._spring.size
            none = np.zeros(size)
            return Degraded(none > 0.0, none + 1.0, none, none, none, none, none + math.nan)
        memory = np.moveaxis(self._memory(modes.state), -1, 0)
        y, load = self.elongation(z), self.load(modes.mode, modes.state)
        force, degrades = memory[SLOPE] * y - load, memory[YIELD] > 0.0
        last, stiffness = memory[LAST], np.where(degrades, memory[UNLOADS], 1.0)
        work = memory[WORK] + (0.5 * memory[SLOPE] * (y + last) - load) * (y - last)
        lost = modes.mode[self.own] == self._elements.first[self.own] + NO_FORCE
        path = (work - 0.5 * force**2 / stiffness) / np.where(degrades, memory[YIELD], 1.0)
        stiffness = np.where(lost & degrades, 0.0, stiffness)
        times = np.where(stiffness > 0.0, math.nan, memory[LOST])
        peak = np.maximum(memory[PEAK], np.abs(force))
        plastic = y - force / np.where(degrades, memory[UNLOADS], 1.0)
        return Degraded(degrades, stiffness, plastic, path, memory[SLIPS], peak, times)

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
