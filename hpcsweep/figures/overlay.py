"""Branches and curves of a study of branches, laid over the figures of another file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.continuation.cycle import continued
from hpcsweep.dynamics.continuation.forced import ForcedMap
from hpcsweep.figures.style import PlotError, stretches
from hpcsweep.studies.branches.branches import Branches
from hpcsweep.studies.study import as_kind


class Drawn(NamedTuple):
    """A branch.

    Attributes
    ----------
    number, period : int
    value : ndarray, shape (k,)
        Of the parameter.
    stable : ndarray of bool, shape (k,)
    points : ndarray, shape (k, period, 2n)
        All stroboscopic points.
    contact : ndarray of uint64, shape (k,)
    multipliers : ndarray of complex, shape (k, 2n)
    """

    number: int
    period: int
    value: np.ndarray
    stable: np.ndarray
    points: np.ndarray
    contact: np.ndarray
    multipliers: np.ndarray

    def pieces(self) -> Iterator[tuple[slice, bool]]:
        """Cut it where its stability changes; the piece between is unstable."""
        both = self.stable[:-1] & self.stable[1:]
        for first, last in stretches(both) if both.size else ():
            yield slice(first, last + 1), bool(both[first])


class Overlay:
    """Branches along the amplitude of a file, line by line.

    Parameters
    ----------
    path : Path
    structure : Structure
        Of the file under it.

    Raises
    ------
    PlotError
        If the file holds no branches of the amplitude, or those of another structure.
    """

    def __init__(self, path: Path, structure):
        from hpcsweep.store import Frames

        self.frames = Frames(path, holds="branches")
        self.study = as_kind(self.frames.study, Branches)
        if self.study.parameter != "amplitude":
            raise PlotError(f"--branches {path}: holds branches along {self.study.parameter}")
        if self.study.structure != structure:
            raise PlotError(f"--branches {path}: is of another structure")

    def at(self, omega: float) -> list[Drawn]:
        """Return the branches at a frequency, none where the file has no line."""
        lines = np.flatnonzero(np.isclose(self.study.omega, omega, rtol=1e-12, atol=0.0))
        if not lines.size:
            return []
        line = int(lines[0])
        return list(branches_of(run_of(self.frames.dataset(line)), self.study, line))

    def need(self, omega: np.ndarray) -> None:
        """Make sure that there are branches at one of the frequencies.

        Raises
        ------
        PlotError
            If there are none.
        """
        if not np.isclose(self.study.omega[:, None], omega, rtol=1e-12, atol=0.0).any():
            raise PlotError(
                f"--branches {self.frames.path}: has no line at any frequency that is drawn"
            )

    def close(self) -> None:
        """Close the file."""
        self.frames.close()


def run_of(line) -> dict[str, np.ndarray]:
    """Return the variables of a dataset of one line, with the dimensions of `hpcsweep.branch`."""
    return {name: one.values for name, one in line.isel(direction=0, line=0, amplitude=0).items()}


def branches_of(run: dict[str, Any], study: Branches, line: int) -> Iterator[Drawn]:
    """Return the branches of a line with all their stroboscopic points."""
    place = float(study.amplitude[line]), float(study.omega[line])
    forced = ForcedMap(study.structure, *place, study.parameter, study.settings.rtol)
    numbers, periods = run["branch_id"].tolist(), run["branch_period"].tolist()
    for number, period in zip(numbers, periods, strict=True):
        own = run["step_branch"] == number
        if number and own.any():
            points = np.empty((own.sum(), period, forced.size))
            for k, (x, value) in enumerate(zip(run["point"][own], run["value"][own], strict=True)):
                start = (x / forced.units)[None]
                points[k] = continued(forced, start, float(value), period) * forced.units
            yield Drawn(
                *(number, period, run["value"][own], run["stable"][own] > 0, points),
                run["contact"][own],
                run["multiplier_real"][own] + 1j * run["multiplier_imag"][own],
            )
