"""Compile what runs call before they begin, and show progress to the user.

The kernels for any structure are compiled once. Kernels specialised to the structure of a study
(`hpcsweep.solvers.flow.specialised`) are compiled where its histories will repay that, or where a
user requests them.
"""

from typing import Any

from hpcsweep.kernels.compile.warm import load_all, processors
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.compiling import announced
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies.blocks import Say
from hpcsweep.studies.quantities import METRICS
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.study import Study

SPECIALISED_FROM = 500_000
"""Least histories of a rank for which kernels are specialised to the structure. A history of the
whole study takes 0.15 ms with them and 0.2 without: so they spare 25 s, the time in which two
processes compile them."""

REFINED_SHARE = 0.1
"""Share of the histories of a refined map that are computed, about."""


def needed(
    settings: SweepSettings, structure: Structure | None = None, specialised: bool = False
) -> list[Any]:
    """Return the kernels that runs with these settings call, compiled or not.

    Parameters
    ----------
    settings : SweepSettings
    structure : Structure, optional
        Default: what those of any structure do.
    specialised : bool
        Return those specialised to the structure.
    """
    SOLVERS[settings.solver].load()
    if settings.solver != "flow":
        return []
    # imported late: the solver may be another one
    from hpcsweep.solvers.flow.specialised import needed_kernels

    return needed_kernels(structure, specialised, settings.measures != 0)


def worth_specialising(study: Study, n_ranks: float | None) -> bool:
    """Return whether the histories of a study on `n_ranks` repay kernels of their own."""
    if n_ranks is None or study.settings.solver != "flow":
        return False
    histories = float(study.n_runs * study.polls_per_run)
    if study.refine is not None:
        histories *= REFINED_SHARE
    return histories >= SPECIALISED_FROM * n_ranks


def warm_up_all(say: Say = None, jobs: int | None = None) -> None:
    """Compile, or load, what runs with any settings and responses to records call."""
    from hpcsweep.solvers.flow.record_map import kernels_of

    every = needed(SweepSettings(metrics=frozenset(METRICS)))
    load(list(dict.fromkeys([*every, *kernels_of(Structure(1), True)])), say, jobs)


def load(kernels: list[Any], say: Say = None, jobs: int | None = None) -> None:
    """Compile kernels, in one process for each available processor, or load them from the disk.

    Parameters
    ----------
    kernels : list of EntryPoint
    say : callable, optional
        Called with the progress of compilation, if there is anything to compile.
    jobs : int, optional
        Processes that compile.
    """
    special = " specialised to the structure" * any(kernel.specialisation for kernel in kernels)
    tell = None if say is None else announced(say, f"kernels{special}")
    load_all(kernels, tell, processors() if jobs is None else jobs)
