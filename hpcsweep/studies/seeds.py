"""Motions of results files as seeds of branches, which are read by `hpcsweep.store.inputs`."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hpcsweep.model.structure import Structure


class Where(NamedTuple):
    """Of which motions seeds are wanted.

    Attributes
    ----------
    structure : Structure
    omega, amplitude : (float, float)
        Lowest and highest, both included.
    """

    structure: Structure
    omega: tuple[float, float]
    amplitude: tuple[float, float]


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
