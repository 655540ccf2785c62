"""What a motion has gathered, in the units of the structure."""

import math
from collections.abc import Callable

import numpy as np

from hpcsweep.kernels.simd import LANES
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.state.shared import Asked, Shared, Tally
from hpcsweep.solvers.measures import measures_of
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.records import Observation, RowMotion, window_growth


def reset(tally: Tally) -> None:
    """Reset a tally, as `hpcsweep.solvers.flow.state.shared.clear` does within kernels."""
    for array in tally:
        array.fill(0)


def rows_gathered(asked: Asked, rows, n_orders: int, march: Callable, units) -> RowMotion:
    """Return what rows do along a march, which returns a state and an outcome.

    `units` are the time of it, and the length in which states are.

    Raises
    ------
    ArithmeticError
        If the solver fails.
    """
    values = []
    for first in range(0, len(rows), LANES):
        some = rows[first : first + LANES]
        asked.counts[:] = len(some), n_orders
        asked.rows[: len(some)], asked.sums[:, :2], asked.sums[:, 2:] = some, -math.inf, 0.0
        _, outcome = march()
        if outcome is not Outcome.COMPLETE:
            raise ArithmeticError(f"flow: {outcome.name}")
        values.append(asked.sums[: len(some)].copy())
    span, unit = units
    high, low, mean, square, *sums = np.vstack(values)[:, : 4 + 2 * n_orders].T
    cosine, sine = np.reshape(sums, (n_orders, 2, -1)).transpose(1, 2, 0) * (2.0 * unit / span)
    peaks, means = (-low * unit, high * unit), (mean * unit / span, np.sqrt(square / span) * unit)
    return RowMotion(*peaks, *means, np.hypot(cosine, sine), np.arctan2(cosine, sine))


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
