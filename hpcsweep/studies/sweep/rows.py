"""Allocate and fill rows of the results of runs."""

from typing import Any, NamedTuple

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import normalised_drift
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import CONTACT_MEASURES, MEASURES, SweepSettings
from hpcsweep.studies.variables import empty_results, run_variables

NOT_TESTED = -1
"""Window period of a run without a window of its own."""


class Result(NamedTuple):
    """Results of a run, or of k runs: then every array has an additional first axis.

    A field is stored as the variable of its name.

    Attributes
    ----------
    orbit_period : int
        Orbit period, 0 if there is none, or it is longer than the job looks for.
    cycles : int
        Forcing periods integrated on the path.
    final_state : ndarray, shape (2n,)
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

    orbit_period: Any
    cycles: Any
    final_state: np.ndarray
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
    rows["outcome"][:] = Outcome.COMPLETE
    for name in rows.keys() & set(Result._fields):
        rows[name][:] = getattr(result, name)
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


def store_measures(rows: Rows, structure: Structure, measures: np.ndarray) -> None:
    """Store measures, shape (k, D + 2 n + 5 m) as in an `Observation`, in rows of results.

    The force of a contact is largest where its floors are farthest past it. That of a dashpot comes
    as the distance at which the spring alone exerts it. Contacts that no motion reaches exert none.
    """
    n_drifts, n, m = len(structure.drift_rows), structure.n_floors, len(structure.contacts)
    ends = np.cumsum((n_drifts, n, n, *4 * (m,)))
    parts = dict(zip(MEASURES, np.split(measures, ends, axis=1), strict=True))
    past = parts["contact_force"]
    parts["contact_force"] = structure.switched(structure.force_per_length * past, past)
    parts["impulse"] = structure.force_per_length * parts["impulse"]
    numbers = structure.all_contact_numbers
    places = [numbers.index(number) for number in structure.contact_numbers]
    for name in rows.keys() & parts.keys():
        if name not in CONTACT_MEASURES:
            rows[name][:] = parts[name]
        else:
            rows[name][:] = 0.0
            rows[name][:, places] = parts[name]
