"""What a motion has gathered, in the units of the structure."""

import math

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.state.shared import Shared, Tally
from hpcsweep.solvers.measures import measures_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation, window_growth


def reset(tally: Tally) -> None:
    """Reset a tally, as `hpcsweep.solvers.flow.state.shared.clear` does within kernels."""
    for array in tally:
        array.fill(0)


def gathered(
    structure: Structure,
    shared: Shared,
    points: np.ndarray,
    outcome: Outcome,
    modal_norm: bool,
    measures: int,
    logarithms: np.ndarray | None = None,
) -> Observation:
    """Return the observation of motions that have been gathered in the tally.

    Parameters
    ----------
    structure : Structure
    shared : Shared
        Of a solver of the structure.
    points : ndarray, shape (n_periods, 2n)
        Those reached.
    outcome : Outcome
    modal_norm : bool
    measures : int
        What was requested.
    logarithms : ndarray, shape (n_periods,), optional
        Growth of a tangent vector in each period.
    """
    tally = shared.tally
    if logarithms is None or outcome is not Outcome.COMPLETE:
        logarithms = np.empty(0)
    free = tally.free_time[0] if modal_norm else 0.0
    norms = tally.modal / free if free > 0.0 else np.full_like(tally.modal, math.nan)
    is_measured = measures and len(points)
    return Observation(
        points,
        structure.contact_bits(int(tally.contact[0])),
        float(tally.peak_drift[0]) * structure.length_unit,
        norms,
        outcome,
        window_growth(logarithms),
        logarithms,
        measures=measures_of(structure, shared.model, tally, len(points)) if is_measured else None,
    )
