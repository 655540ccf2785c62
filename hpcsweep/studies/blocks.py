"""Blocks: stretches of runs that are computed and committed together, and paths of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hpcsweep.solvers.polling import Poll as Poll

Place = tuple[int, ...]
"""An index, an entry for each axis."""
Amplitudes = Sequence[float] | np.ndarray
"""In the order in which they are computed, shape (k,)."""
Rows = dict[str, np.ndarray]
"""Results of runs by variable, first axis the runs in the order of the file."""
Timed = tuple[tuple[int, float], int, float]
"""Frame and position along the last axis of the runs, from 0 to 1; runs; seconds."""
Say = Callable[[str], None] | None
"""Shows a line to the user."""


def joined(parts: list[Rows]) -> Rows:
    """Return the rows of parts, one after the other."""
    if len(parts) == 1:
        return parts[0]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@dataclass(frozen=True)
class Block:
    """A stretch of runs that are computed and committed together.

    Attributes
    ----------
    task : int
        Task to which the block belongs.
    place : tuple of int
        Its index in ``commit``.
    first : tuple of int
        Index of its lowest run in the variables of the runs.
    n_runs : int
        Number of consecutive runs along the last axis.
    descending : bool
        Whether runs are computed from the highest to the lowest.
    """

    task: int
    place: Place
    first: Place
    n_runs: int
    descending: bool = False

    @property
    def order(self) -> slice:
        """Permutation between rows of the file and the order of computation, either way."""
        return slice(None, None, -1) if self.descending else slice(None)

    @property
    def begin(self) -> int:
        """Row of the file that is computed first."""
        return self.n_runs - 1 if self.descending else 0

    @property
    def end(self) -> int:
        """Row of the file that is computed last."""
        return 0 if self.descending else self.n_runs - 1

    @property
    def runs(self) -> tuple:
        """Index of all its runs in the variables of the runs."""
        return (*self.first[:-1], slice(self.first[-1], self.first[-1] + self.n_runs))

    def run(self, row: int) -> Place:
        """Return the index of one of its runs."""
        return (*self.first[:-1], self.first[-1] + row)


class Path(Sequence[Block]):
    """Blocks of a task in the order of computation, made lazily.

    Parameters
    ----------
    length : int
    block : callable
        Return the block at a position.
    """

    def __init__(self, length: int, block: Callable[[int], Block]):
        self._positions = range(length)
        self._block = block

    def __len__(self) -> int:
        return len(self._positions)

    def __getitem__(self, position: int) -> Block:  # type: ignore[override]
        return self._block(self._positions[position])
