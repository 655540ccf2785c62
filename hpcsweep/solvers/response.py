"""The response of a structure to a ground-motion record, and the scale of its first contact.

    M u'' + C u' + K u + sum_k d_k F_k = -M r s a(t),      a(t) linear between samples, s the scale

(b in the place of -M r where a structure has a forcing vector of its own). From rest, with contacts
whose force is linear where they are closed, the response over s depends on the gaps over s alone. A
contact of gap g_k > 0 stays open as long as s max_t d_k . u < g_k, u being the motion without
contacts at s = 1: up to the least of these scales the response is s times that one motion.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import choice, finite, finite_vector, instance, number
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Response

__all__ = ["Response", "first_contact_scale", "history", "linear_response", "response"]

SOLVERS = ("flow",)


def response(
    structure: Structure,
    record: Record,
    scale: float = 1.0,
    tail: float = 0.0,
    *,
    state: Any = None,
    solver: str = "flow",
    rtol: float = 1e-9,
    at_samples: bool = False,
) -> Response:
    """Return the response of a structure to a ground-motion record.

    Exact between contact changes: the record is linear between its samples, and so is the motion.

    Parameters
    ----------
    structure : Structure
        In the units of the record: length and time.
    record : Record
    scale : float
        By which its acceleration is multiplied.
    tail : float
        Time of free motion after the last sample, at least 0.
    state : array_like, shape (2n,), optional
        (u, u') at the first sample. Default: rest.
    solver : {"flow"}
    rtol : float
        Relative error asked of the motion inside contact layers, see `FlowMap`.
    at_samples : bool
        Take peaks at the samples alone, as published response spectra do.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails; the message names the outcome and the time.
    """
    structure, record, tail = _arguments(structure, record, tail)
    scale = finite("scale", scale)
    if state is not None:
        state = finite_vector("state", state, 2 * structure.n_floors)
    choice("solver", solver, SOLVERS)
    from hpcsweep.solvers.flow.record_map import RecordMap

    found = RecordMap(structure, record.dt, rtol).respond(
        record.acceleration, scale, tail, state, at_samples=at_samples
    )
    return _complete(found, solver)


def linear_response(
    structure: Structure, record: Record, tail: float = 0.0
) -> tuple[Response, np.ndarray]:
    """Return the response without contacts, and how far it reaches towards each of them.

    From rest; times s it is the response at any scale s up to that of `first_contact_scale`. What
    it reaches is the gap that a contact needs if it is not to close.

    Parameters
    ----------
    structure, record, tail
        Of `response`.

    Returns
    -------
    Response
        At scale 1; forces, impacts and impulses are 0.
    ndarray, shape (k,)
        max_t d_k . u of each contact, at least 0.
    """
    structure, record, tail = _arguments(structure, record, tail)
    from hpcsweep.solvers.flow.record_map import RecordMap

    reach = structure.directions
    n_drifts, n_contacts = len(structure.drift_rows), len(reach)
    free = Structure.from_matrices(
        structure.mass_matrix,
        structure.stiffness_matrix,
        [],
        damping=structure.damping_matrix,
        forcing=structure.forcing_vector,
        drift=np.vstack((structure.drift_rows, reach)),
    )
    found = RecordMap(free, record.dt, one_sided=n_contacts).respond(record.acceleration, 1.0, tail)
    _complete(found, "flow")
    nothing = np.zeros(n_contacts)
    linear = replace(
        found,
        drift=found.drift[:n_drifts],
        drift_time=found.drift_time[:n_drifts],
        force=nothing,
        impacts=nothing.astype(int),
        impact_velocity=nothing,
        contact_time=nothing,
        impulse=nothing,
        dissipated=nothing,
        force_time=nothing,
    )
    return linear, found.drift[n_drifts:]


def first_contact_scale(structure: Structure, record: Record, tail: float = 0.0) -> float:
    """Return the scale of a record below which no contact closes, from rest.

    min over contacts of gap / max_t(d . u), from one motion without contacts; 0 if a gap is not
    above 0, inf if nothing moves towards a contact. Stops are taken as sharp.

    Parameters
    ----------
    structure, record, tail
        Of `response`.
    """
    _, reach = linear_response(structure, record, tail)
    return scale_of_contact(structure, reach)


def scale_of_contact(structure: Structure, reach: np.ndarray) -> float:
    """Return the scale of `first_contact_scale`, from what `linear_response` reaches."""
    scales = [
        max(contact.gap, 0.0) / way if way > 0.0 else math.inf
        for contact, way in zip(structure.contacts, reach.tolist(), strict=True)
    ]
    return min(scales, default=math.inf)


def _arguments(structure, record, tail) -> tuple[Structure, Record, float]:
    instance("structure", structure, Structure)
    instance("record", record, Record)
    longest = MAX_SAMPLES * record.dt
    return structure, record, number("tail", tail, f"from 0 to {longest:g}", 0.0, longest)


def _complete(found: Response, solver: str) -> Response:
    if found.outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"{solver}: {found.outcome.name} at {found.duration:.6g}")
    return found


class History(NamedTuple):
    """The motion of a structure at the p samples of a record and its tail."""

    time: np.ndarray
    """From the first sample on, shape (p,)."""
    displacement: np.ndarray
    """Relative to the ground, shape (p, n)."""
    velocity: np.ndarray
    """Shape (p, n)."""
    force: np.ndarray
    """Largest force of each contact since the sample before, shape (p, k)."""


def history(structure: Structure, record: Record, scale: float = 1.0, tail: float = 0.0) -> History:
    """Return the motion of a structure under a record from rest, sample by sample.

    Parameters
    ----------
    structure, record, scale, tail
        Of `response`; the tail is cut to whole intervals.

    Raises
    ------
    ValueError, ArithmeticError
        As `response`.
    """
    structure, record, tail = _arguments(structure, record, tail)
    scale = finite("scale", scale)
    from hpcsweep.solvers.flow.record_map import RecordMap

    solver = RecordMap(structure, record.dt)
    samples = record.acceleration
    n, n_tail = structure.n_floors, int(tail / record.dt)
    pairs = [samples[j : j + 2] for j in range(record.n_samples - 1)] + n_tail * [np.zeros(2)]
    states = np.zeros((len(pairs) + 1, 2 * n))
    force = np.zeros((len(pairs) + 1, len(structure.contacts)))
    for j, pair in enumerate(pairs, 1):
        found = _complete(solver.respond(pair, scale, state=states[j - 1]), "flow")
        states[j], force[j] = found.final_state, found.force
    time = record.dt * np.arange(len(states))
    return History(time, states[:, :n], states[:, n:], force)
