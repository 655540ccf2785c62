"""Allocate and fill rows of the results of runs."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variables import empty_results, run_variables, store_measures

NOT_TESTED = -1
"""Window period of a run without a window of its own."""


EXPONENTS = ("lyapunov", "lyapunov_low", "lyapunov_high")
"""Variables of the largest Lyapunov exponent per unit of time, and of its interval."""


def empty_rows(structure: Structure, n_runs: int, settings: SweepSettings) -> Rows:
    """Allocate the results of `n_runs` runs, as for failed runs.

    Returns
    -------
    dict of str to ndarray
        The variables requested by `settings.metrics`, first axis the run.
    """
    variables = run_variables(settings, structure)
    return empty_results(variables, structure, n_runs, point=settings.stored_points)


def store(
    rows: Rows,
    structure: Structure,
    omega: float,
    amplitudes: np.ndarray | float,
    result: Mapping[str, Any],
) -> None:
    """Write results of k complete runs into `rows`, k rows as allocated by `empty_rows`.

    Parameters
    ----------
    rows : dict of str to ndarray
    structure : Structure
    omega : float
    amplitudes : ndarray, shape (k,), or float
    result : mapping
        The variables by their names, as far as they are stored as they are; ``points``, the
        stroboscopic points to store: the first ``n_points``, the others NaN; ``peak_drift`` and
        ``measures`` as in an `Observation`. Of several runs each with an additional first axis.
    """
    rows["outcome"][:] = Outcome.COMPLETE
    for name in rows.keys() & result.keys():
        rows[name][:] = result[name]
    points = result["points"]
    if "poincare" in rows:
        most = min(points.shape[-2], rows["poincare"].shape[1])
        rows["poincare"][:, :most] = points[..., :most, :]
    if "drift" in rows:
        rows["drift"][:] = normalised_drift(result["peak_drift"], amplitudes, omega)
    if result["measures"].size:
        store_measures(rows, structure, result["measures"])


def store_failure(rows: Rows, end: np.ndarray, cycles: int, outcome: Outcome) -> None:
    """Write the outcome of a failed run and its last state, of a collapse rest, into its row."""
    rows["cycles"][:] = cycles
    rows["outcome"][:] = outcome
    rows["final_state"][:] = 0.0 if outcome is Outcome.COLLAPSED else end
    if "motion" in rows:
        rows["motion"][:] = MotionClass.FAILED
