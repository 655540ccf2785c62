"""Compiling what runs call before they begin, and what a user sees meanwhile.

The kernels for any structure are compiled once. Kernels fitted to the structure of a study
(`hpcsweep.solvers.flow.fitted`) are compiled where its histories will earn that back, or where a
user asks for them.
"""

import math
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TextIO

import numpy as np

from hpcsweep.dynamics.classify_motion import SETTLED
from hpcsweep.kernels.warm import Progress, load_all, missing, processors
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import SOLVERS, make_solver
from hpcsweep.studies.settings import METRICS, SweepSettings

if TYPE_CHECKING:
    from hpcsweep.studies.grid import RunGrid

FITTED_FROM = 500_000
"""Histories of a rank from which on kernels are fitted to the structure. A history of the whole
study takes 0.15 ms with them and 0.2 without: these spare 25 s, what two processes need to compile
them."""

BAR = 30
"""Characters."""
SILENCE = 10.0
"""Seconds between two lines where no bar can be drawn."""


def duration(seconds: float) -> str:
    """Write a time that is foretold: ``40 s``, ``3 min``."""
    if seconds < 100.0:
        return f"{max(round(seconds), 1)} s"
    return f"{round(seconds / 60.0)} min"


class Report:
    """Tells a user how far the compilation has come.

    Parameters
    ----------
    say : callable
        Says a line.
    stream : file
        Where the bar is drawn if it is a terminal.
    kernels : str
        What they are called.
    """

    def __init__(
        self,
        say: Callable[[str], None],
        stream: TextIO | None = None,
        kernels: str = "kernels",
    ):
        self._say, self._kernels = say, kernels
        self._stream = sys.stderr if stream is None else stream
        self._last = 0.0

    def __call__(self, progress: Progress) -> None:
        """Tell the progress."""
        done, total, name, left = progress
        to_go = "" if math.isnan(left) else f", {duration(left)} to go"
        if done == 0:
            about = "" if math.isnan(left) else f", about {duration(left)}"
            self._say(f"compiling {total} {self._kernels}, once for this type of processor{about}")
            self._last = time.monotonic()
        if self._stream.isatty():
            filled = BAR * done // total
            bar = "#" * filled + "." * (BAR - filled)
            last = f" {name}{to_go}" if done else ""
            line = f"[{bar}] {done}/{total}{last}"
            self._stream.write(f"\r\033[K{line}" if done < total else "\r\033[K")
            self._stream.flush()
        elif 0 < done < total and time.monotonic() - self._last >= SILENCE:
            self._say(f"compiled {done} of {total} kernels{to_go}")
            self._last = time.monotonic()


def is_compiled(settings: SweepSettings, fitted_to: Structure | None = None) -> bool:
    """Return whether the cache is known to have what runs with these settings call.

    Parameters
    ----------
    settings : SweepSettings
    fitted_to : Structure, optional
        See `warm_up`.
    """
    SOLVERS[settings.solver].load()
    return settings.solver == "flow" and not missing(_fitted(fitted_to))


def warm_up(
    settings: SweepSettings,
    say: Callable[[str], None] | None = None,
    jobs: int | None = None,
    fitted_to: Structure | None = None,
) -> None:
    """Compile what runs with these settings call, or load it from the disk, by a few periods.

    Parameters
    ----------
    settings : SweepSettings
    say : callable, optional
        Told how far the compilation has come, if there is anything to compile.
    jobs : int, optional
        Processes that compile; default one for each processor at hand.
    fitted_to : Structure, optional
        Compile the kernels fitted to it in place of those for any structure (solver `flow`).
    """
    SOLVERS[settings.solver].load()
    structure = Structure(1, 10.0)
    if settings.solver == "flow":
        kernels = "kernels" if fitted_to is None else "kernels fitted to the structure"
        tell = None if say is None else Report(say, kernels=kernels)
        fitted = _fitted(fitted_to)
        load_all(tell, processors() if jobs is None else jobs, fitted)
        if fitted_to is not None:
            from hpcsweep.solvers.flow.fitted import use

            use(fitted)
            structure = fitted_to
    solver = make_solver(settings.solver, structure, 1.0, settings.rtol)
    z = np.zeros(2 * structure.n_floors)
    amplitude = 1.0 if fitted_to is None else 0.0
    if "converged" in settings.skip:
        solver.settle(z, amplitude, 1, 1, SETTLED, SETTLED)
    else:
        solver.advance(z, amplitude, 1)
    solver.observe(z, amplitude, 1)
    if "lyapunov" in settings.metrics:
        solver.observe(z, amplitude, 1, growth=True)
        solver.monodromy(z, amplitude, 1)


def worth_fitting(study: "RunGrid", n_ranks: int | None) -> Structure | None:
    """Return the structure of a study if its histories on so many ranks pay for fitted kernels."""
    if n_ranks is None or study.settings.solver != "flow":
        return None
    histories = study.n_runs * study.polls_per_run
    return study.structure if histories >= FITTED_FROM * n_ranks else None


def warm_up_all(say: Callable[[str], None] | None = None, jobs: int | None = None) -> None:
    """Compile what runs of any settings call, or load it from the disk."""
    for name in SOLVERS:
        warm_up(SweepSettings(solver=name, metrics=frozenset(METRICS)), say, jobs)


def _fitted(structure: Structure | None):
    """Return the kernels fitted to a structure, None for those for any structure."""
    if structure is None:
        return None
    from hpcsweep.solvers.flow.fitted import fitted_kernels

    return fitted_kernels(structure)
