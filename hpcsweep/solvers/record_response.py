"""Peaks of the response of a structure to a ground-motion record."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.model.structure import Structure
from hpcsweep.solvers.measures import CLOSINGS, DISSIPATED, FORCE, SPEED, TIME
from hpcsweep.solvers.outcome import Outcome

SAME_TIME = 1e-9
"""Part of a sample interval by which a tail may miss a whole number of them."""


@dataclass(frozen=True, eq=False)
class Response:
    """Peaks of the response to a record, from its first sample to the end of its tail.

    Peaks are over continuous time unless they are asked for at the samples, where those of contacts
    are, too. Displacements, drifts and forces include those at rest, which are 0 unless a contact
    is pressed (`hpcsweep.model.equilibrium`). Units are those of the structure.

    Attributes
    ----------
    displacement : ndarray, shape (n,)
        Largest |u_i|, relative to the ground.
    drift : ndarray, shape (rows,)
        Largest |row . u| of each row of ``structure.drift_rows``.
    floor_acceleration : ndarray, shape (n,)
        Largest absolute acceleration, |u_i'' + a| of a base that shakes.
    force : ndarray, shape (k,)
        Largest force of each contact; 0 if it has not closed.
    impacts : ndarray of int, shape (k,)
        How often each contact has closed, having been open by more than rounding (`measures`).
    impact_velocity : ndarray, shape (k,)
        Largest speed with which each contact has closed.
    contact_time : ndarray, shape (k,)
        Time in which each contact was closed.
    impulse : ndarray, shape (k,)
        Integral of the force of each contact over time.
    dissipated : ndarray, shape (k,)
        Energy that the dashpot of each contact has taken; 0 without one.
    residual : ndarray, shape (n,)
        |u_i - u_i at rest| at the end: what is left of the motion after the tail, as an elastic
        structure has no lasting displacement.
    final_state : ndarray, shape (2n,)
        (u, u') at the end.
    displacement_time, drift_time, acceleration_time, force_time : ndarray
        When these peaks are, from the first sample on.
    duration : float
        Time that was integrated; that up to the failure if one occurred.
    outcome : Outcome

    Examples
    --------
    From `hpcsweep.response`. A mass on a spring under the sudden acceleration 1 moves to twice its
    static displacement -1 / k, at half its period:

    >>> step = hpcsweep.Record([1.0, 1.0], dt=4.0)
    >>> free = hpcsweep.Structure(n_floors=1, stiffness_ratio=0.0, damping_ratio=0.0)
    >>> peaks = hpcsweep.response(free, step)
    >>> peaks.displacement.round(12), (peaks.displacement_time / math.pi).round(12)
    (array([2.]), array([1.]))
    """

    displacement: np.ndarray
    drift: np.ndarray
    floor_acceleration: np.ndarray
    force: np.ndarray
    impacts: np.ndarray
    impact_velocity: np.ndarray
    contact_time: np.ndarray
    impulse: np.ndarray
    dissipated: np.ndarray
    residual: np.ndarray
    final_state: np.ndarray
    displacement_time: np.ndarray
    drift_time: np.ndarray
    acceleration_time: np.ndarray
    force_time: np.ndarray
    duration: float
    outcome: Outcome


def response_of(
    structure: Structure,
    peaks: np.ndarray,
    times: np.ndarray,
    impacts: np.ndarray,
    state: np.ndarray,
    duration: float,
    outcome: Outcome,
) -> Response:
    """Make a response from what has been gathered in the kernels' units.

    Parameters
    ----------
    structure : Structure
    peaks, times : ndarray, shape (P,)
        Of drifts, floors, absolute accelerations, and forces of contacts over their units.
    impacts : ndarray, shape (N_IMPACTS, k)
        See `measures`.
    state : ndarray, shape (2n,)
        At the end, in units of the structure.
    duration : float
        Likewise.
    outcome : Outcome
    """
    n, n_drifts = structure.n_floors, len(structure.drift_rows)
    length, rate = structure.length_unit, structure.frequency_unit
    ends = np.cumsum([n_drifts, n, n])
    size: list[Any] = np.split(peaks * length, ends)
    when = np.split(times / rate, ends)
    unit = structure.force_per_length
    return Response(
        displacement=size[1],
        drift=size[0],
        floor_acceleration=size[2] * rate**2,
        force=size[3] * unit,
        impacts=impacts[CLOSINGS].astype(int),
        impact_velocity=impacts[SPEED] * (length * rate),
        contact_time=impacts[TIME] / rate,
        impulse=impacts[FORCE] * unit * (length / rate),
        dissipated=impacts[DISSIPATED] * unit * length**2,
        residual=np.abs(state[:n] - structure.rest[:n]),
        final_state=state,
        displacement_time=when[1],
        drift_time=when[0],
        acceleration_time=when[2],
        force_time=when[3],
        duration=duration,
        outcome=outcome,
    )


def intervals(n_samples: int, dt: float, tail: float) -> tuple[int, float]:
    """Return how many whole sample intervals a record and its tail have, and what is left."""
    n_tail = int(tail / dt + SAME_TIME)
    rest = tail - n_tail * dt
    return n_samples - 1 + n_tail, rest if rest > SAME_TIME * dt else 0.0
