"""Compile what runs call before they begin, and show progress to the user.

The kernels for any structure are compiled once. Kernels specialised to the structure of a study
(`hpcsweep.solvers.flow.specialised`) are compiled where its histories will repay that, or where a
user requests them.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify_motion import SETTLED
from hpcsweep.kernels.compile.warm import load_all, missing, processors
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.compiling import announced
from hpcsweep.solvers.solver import SOLVERS, make_solver
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


def is_compiled(
    settings: SweepSettings, structure: Structure | None = None, specialised: bool = False
) -> bool:
    """Return whether the cache is known to hold what runs with these settings call.

    Parameters
    ----------
    settings : SweepSettings
    structure, specialised
        See `warm_up`.
    """
    SOLVERS[settings.solver].load()
    return settings.solver == "flow" and not missing(_needed(settings, structure, specialised))


def warm_up(
    settings: SweepSettings,
    say: Say = None,
    jobs: int | None = None,
    structure: Structure | None = None,
    specialised: bool = False,
) -> None:
    """Compile, or load from disk, what runs with these settings call, by running a few periods.

    Parameters
    ----------
    settings : SweepSettings
    say : callable, optional
        Called with the progress of compilation, if there is anything to compile.
    jobs : int, optional
        Processes that compile; default one for each available processor.
    structure : Structure, optional
        Compile only what its runs call; default what those of any structure do.
    specialised : bool
        Compile kernels specialised to the structure (solver `flow`).
    """
    SOLVERS[settings.solver].load()
    example = Structure(1, 10.0) if structure is None or not specialised else structure
    if settings.solver == "flow":
        kernels = "kernels specialised to the structure" if specialised else "kernels"
        load(_needed(settings, structure, specialised), say, jobs, kernels)
        if specialised:
            from hpcsweep.solvers.flow.specialised import use

            use(example)
    solver = make_solver(settings.solver, example, 1.0, settings.rtol, yields=True)
    z = np.zeros(example.state_units.size)
    amplitude = 0.0 if specialised else 1.0
    if SOLVERS[settings.solver].batches(example):
        from hpcsweep.solvers.flow import FlowMap
        from hpcsweep.solvers.flow.orbit.batch import Rules

        assert isinstance(solver, FlowMap)
        rules = Rules(settled=SETTLED, same=SETTLED, near=SETTLED)
        solver.follow_orbits(np.array([amplitude]), z, rules, None)
    if "converged" in settings.skip:
        solver.settle(z, amplitude, 1, 1, SETTLED, SETTLED)
    else:
        solver.advance(z, amplitude, 1)
    solver.observe(z, amplitude, 1)
    if "lyapunov" in settings.metrics:
        solver.observe(z, amplitude, 1, growth=True)
        solver.monodromy(z, amplitude, 1)


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

    every = SweepSettings(metrics=frozenset(METRICS))
    needed = dict.fromkeys([*_needed(every, None, False), *kernels_of(Structure(1), True)])
    load(list(needed), say, jobs)
    for name in SOLVERS:
        warm_up(replace(every, solver=name), say, jobs)


def load(needed: list[Any], say: Say, jobs: int | None = None, kernels: str = "kernels") -> None:
    """Compile kernels, or load them from the disk, and tell the progress."""
    tell = None if say is None else announced(say, kernels)
    load_all(needed, tell, processors() if jobs is None else jobs)


def kernel_set(settings: SweepSettings, structure: Structure) -> tuple:
    """Return what identifies all that runs of a structure with these settings call."""
    needed = _needed(settings, structure, False) if settings.solver == "flow" else ()
    return settings, *needed


def _needed(settings: SweepSettings, structure: Structure | None, specialised: bool) -> list[Any]:
    # imported late: the solver may be another one
    from hpcsweep.solvers.flow.specialised import needed_kernels

    return needed_kernels(structure, specialised, settings.measures != 0)
