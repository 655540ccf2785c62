"""Motions of results files as seeds of branches, which are read by `hpcsweep.store.inputs`."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure

SAME = 1e-12
"""Relative difference from a formula that is rounding."""


class Where(NamedTuple):
    """Of which motions seeds are wanted.

    Attributes
    ----------
    structure : Structure
    omega, amplitude : (float, float)
        Lowest and highest, both included.
    ties : mapping of str to callable
        What gives one of both, by its name: takes the other, and numbers of the structure.
    """

    structure: Structure
    omega: tuple[float, float]
    amplitude: tuple[float, float]
    ties: Mapping[str, Callable[..., float]] = MappingProxyType({})

    def holds(self, omega: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
        """Return which motions are wanted, by their frequencies and amplitudes."""
        (least, most), (low, high) = self.omega, self.amplitude
        inside = (low <= amplitude) & (amplitude <= high) & (least <= omega) & (omega <= most)
        for at in np.flatnonzero(inside).tolist() if self.ties else ():
            forcing = {"omega": float(omega[at]), "amplitude": float(amplitude[at])}
            tied = {name: of(**vars(self.structure) | forcing) for name, of in self.ties.items()}
            inside[at] = all(math.isclose(tied[k], forcing[k], rel_tol=SAME) for k in tied)
        return inside


class Seed(NamedTuple):
    """A periodic motion of a results file.

    Attributes
    ----------
    omega, amplitude : float
    period : int
    points : ndarray, shape (k, 2n)
        Stroboscopic points one after the other, all of the orbit (k = period) or its last one.
    """

    omega: float
    amplitude: float
    period: int
    points: np.ndarray


class Seeds(NamedTuple):
    """Motions of results files.

    Attributes
    ----------
    periodic : list of Seed
        In the order of the files and their runs, each once.
    n_others : int
        Motions that are no orbit of a known period.
    """

    periodic: list[Seed]
    n_others: int


Reader = Callable[[tuple[str, ...], Where], Seeds]
"""Reads the motions of results files."""
