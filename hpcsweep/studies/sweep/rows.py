"""Allocate and fill rows of the results of runs."""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.sweep.measures import store_measures
from hpcsweep.studies.variables import empty_results, run_variables

NOT_TESTED = -1
"""Window period of a run without a window of its own."""


class Result(NamedTuple):
    """Results of a run, or of k runs: then every array has an additional first axis.

    Attributes
    ----------
    period : int
        Orbit period, 0 if there is none, or it is longer than the job looks for.
    cycles : int
        Forcing periods integrated on the path.
    end : ndarray, shape (2n,)
        Last point of the run.
    points : ndarray, shape (m, 2n)
        Stroboscopic points to store: the first `n_points`, the others NaN.
    n_points, contact, peak_drift, modal_norm, measures
        As in an `Observation`.
    lyapunov, lyapunov_low, lyapunov_high : float
        Largest Lyapunov exponent per unit of time, and its confidence interval.
    motion : MotionClass
    window_period : int
        Period that the window test finds; `NOT_TESTED` if there is no window.
    window_class : MotionClass
        What the window shows by itself; NOT_COMPUTED if there is no window.
    classification_cycles : int
        Forcing periods integrated to classify.
    """

    period: Any
    cycles: Any
    end: np.ndarray
    points: np.ndarray
    n_points: Any
    contact: Any
    peak_drift: Any
    modal_norm: np.ndarray
    measures: np.ndarray
    lyapunov: Any
    lyapunov_low: Any
    lyapunov_high: Any
    motion: Any
    window_period: Any = NOT_TESTED
    window_class: Any = MotionClass.NOT_COMPUTED
    classification_cycles: Any = 0


def empty_rows(structure: Structure, n_runs: int, settings: SweepSettings) -> Rows:
    """Allocate the results of `n_runs` runs, as for failed runs.

    Returns
    -------
    dict of str to ndarray
        The variables requested by `settings.metrics`, first axis the run.
    """
    variables = run_variables(settings)
    return empty_results(variables, structure, n_runs, point=settings.stored_points)


def store(
    rows: Rows, structure: Structure, omega: float, amplitudes: np.ndarray | float, result: Result
) -> None:
    """Write results of k complete runs into `rows`, k rows as allocated by `empty_rows`."""
    values = {
        "orbit_period": result.period,
        "final_state": result.end,
        "cycles": result.cycles,
        "outcome": Outcome.COMPLETE,
        "n_points": result.n_points,
        "contact": result.contact,
        "modal_norm": result.modal_norm,
        "lyapunov": result.lyapunov,
        "lyapunov_low": result.lyapunov_low,
        "lyapunov_high": result.lyapunov_high,
        "window_period": result.window_period,
        "motion": result.motion,
        "window_class": result.window_class,
        "classification_cycles": result.classification_cycles,
    }
    for name, value in values.items():
        if name in rows:
            rows[name][:] = value
    if "poincare" in rows:
        most = min(result.points.shape[-2], rows["poincare"].shape[1])
        rows["poincare"][:, :most] = result.points[..., :most, :]
    if "drift" in rows:
        rows["drift"][:] = normalised_drift(result.peak_drift, amplitudes, omega)
    if result.measures.size:
        store_measures(rows, structure, np.atleast_2d(result.measures))


def store_failure(rows: Rows, end: np.ndarray, cycles: int, outcome: Outcome) -> None:
    """Write the outcome of a failed run and its last state into its row."""
    rows["cycles"][:] = cycles
    rows["outcome"][:] = outcome
    rows["final_state"][:] = end
    if "motion" in rows:
        rows["motion"][:] = MotionClass.FAILED
