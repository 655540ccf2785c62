"""Compile what runs call before they begin, and show progress to the user.

The kernels for any structure are compiled once. Kernels specialised to the structure of a study
(`hpcsweep.solvers.flow.specialised`) are compiled where its histories will repay that, or where a
user requests them.
"""

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify_motion import SETTLED
from hpcsweep.kernels.compile.warm import load_all, missing, processors
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.solver import SOLVERS, make_solver
from hpcsweep.studies.settings import METRICS, SweepSettings

SPECIALISED_FROM = 500_000
"""Least histories of a rank for which kernels are specialised to the structure. A history of the
whole study takes 0.15 ms with them and 0.2 without: so they spare 25 s, the time in which two
processes compile them."""

REFINED_SHARE = 0.1
"""Share of the histories of a refined map that are computed, about."""

RECORD_MAP = "hpcsweep.solvers.flow.record_map"
SILENCE = 10.0
"""Seconds between two lines."""


def announced(say: Callable[[str], None], kernels: str) -> Callable[[int, int], None]:
    """Return a callback that reports the progress of compilation, at its start and now and then."""
    last = time.monotonic()

    def tell(done: int, total: int) -> None:
        nonlocal last
        if done == 0:
            say(f"compiling {total} {kernels}, once for this type of processor: up to a minute")
        elif done < total and time.monotonic() - last >= SILENCE:
            last = time.monotonic()
            say(f"compiled {done} of {total} {kernels}")

    return tell


def is_compiled(settings: SweepSettings, specialised_to: Structure | None = None) -> bool:
    """Return whether the cache is known to hold what runs with these settings call.

    Parameters
    ----------
    settings : SweepSettings
    specialised_to : Structure, optional
        See `warm_up`.
    """
    SOLVERS[settings.solver].load()
    return settings.solver == "flow" and not missing(_specialised(specialised_to))


def warm_up(
    settings: SweepSettings,
    say: Callable[[str], None] | None = None,
    jobs: int | None = None,
    specialised_to: Structure | None = None,
) -> None:
    """Compile, or load from disk, what runs with these settings call, by running a few periods.

    Parameters
    ----------
    settings : SweepSettings
    say : callable, optional
        Called with the progress of compilation, if there is anything to compile.
    jobs : int, optional
        Processes that compile; default one for each available processor.
    specialised_to : Structure, optional
        Compile the kernels specialised to it in place of those for any structure (solver `flow`).
    """
    SOLVERS[settings.solver].load()
    structure = Structure(1, 10.0)
    if settings.solver == "flow":
        kernels = "kernels" if specialised_to is None else "kernels specialised to the structure"
        tell = None if say is None else announced(say, kernels)
        specialised = _specialised(specialised_to)
        load_all(tell, processors() if jobs is None else jobs, specialised)
        if specialised_to is not None:
            from hpcsweep.solvers.flow.specialised import use

            use(specialised)
            structure = specialised_to
    solver = make_solver(settings.solver, structure, 1.0, settings.rtol)
    z = np.zeros(2 * structure.n_floors)
    amplitude = 1.0 if specialised_to is None else 0.0
    if "converged" in settings.skip:
        solver.settle(z, amplitude, 1, 1, SETTLED, SETTLED)
    else:
        solver.advance(z, amplitude, 1)
    solver.observe(z, amplitude, 1)
    if "lyapunov" in settings.metrics:
        solver.observe(z, amplitude, 1, growth=True)
        solver.monodromy(z, amplitude, 1)


def is_compiled_for_records() -> bool:
    """Return whether the cache is known to have what responses to records call."""
    importlib.import_module(RECORD_MAP)
    return not missing(None)


def warm_up_records(say: Callable[[str], None] | None = None) -> None:
    """Compile what responses to records call, or load it from the disk."""
    importlib.import_module(RECORD_MAP)
    load_all(None if say is None else announced(say, "kernels"), processors(), None)


def worth_specialising(study: Any, n_ranks: int | None) -> Structure | None:
    """Return the structure of a study if its histories on `n_ranks` repay specialisation."""
    if n_ranks is None or study.settings.solver != "flow":
        return None
    histories = study.n_runs * study.polls_per_run
    if getattr(study, "refine", None) is not None:
        histories *= REFINED_SHARE
    return study.structure if histories >= SPECIALISED_FROM * n_ranks else None


def warm_up_all(say: Callable[[str], None] | None = None, jobs: int | None = None) -> None:
    """Compile, or load, what runs with any settings and responses to records call."""
    importlib.import_module(RECORD_MAP)
    for name in SOLVERS:
        warm_up(SweepSettings(solver=name, metrics=frozenset(METRICS)), say, jobs)


def _specialised(structure: Structure | None):
    """Return the kernels specialised to a structure, None for those for any structure."""
    if structure is None:
        return None
    from hpcsweep.solvers.flow.specialised import specialised_kernels

    return specialised_kernels(structure)
