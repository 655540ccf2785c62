"""The response of a structure to a ground-motion record, and the scale of its first contact.

    M u'' + C u' + K u + sum_k d_k F_k = -M r s a(t),      a(t) linear between samples, s the scale

(b in the place of -M r where a structure has a forcing vector of its own). From rest, with contacts
whose force is linear where they are closed, the response over s depends on the gaps over s alone. A
contact of gap g_k > 0 stays open as long as s max_t d_k . u < g_k, u being the motion without
contacts at s = 1: up to the least of these scales the response is s times that one motion.

Rest is the static equilibrium with the contacts (`hpcsweep.model.equilibrium`). It is u = 0 unless
a contact is pressed, g_k < 0; then it is L u where the gaps are L g, so that the response depends
on ratios alone as before, but it is linear at no scale: the contact is closed from the start.
"""

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hpcsweep.model.arguments import finite, finite_vector, flag, instance, number
from hpcsweep.model.observed import TABLE
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.arguments import AT_STRENGTH
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Response

if TYPE_CHECKING:
    from hpcsweep.solvers.flow.record_map import RecordMap

__all__ = ["Response", "first_contact_scale", "linear_response", "response"]


def response(
    structure: Structure,
    record: Record,
    scale: float = 1.0,
    tail: float = 0.0,
    *,
    state: Any = None,
    rtol: float = 1e-9,
    at_samples: bool = False,
    base_shear: bool | None = None,
    energy: bool = False,
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
        (u, u') at the first sample. Default: rest, in static equilibrium with the contacts. Sliders
        have not slipped there: a `final_state` does not continue a motion that has yielded.
    rtol : float
        Relative error asked of the motion inside contact layers, see `FlowMap`.
    at_samples : bool
        Take peaks at the samples alone, as published response spectra do.
    base_shear : bool, optional
        Tell the base shear of each building, `Response.base_shear`. Default: of structures that
        yield; elastic ones take 8 to 30 % longer with it.
    energy : bool
        Tell the energies at the end, `Response.energy`; not with `at_samples`.

    Returns
    -------
    Response

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range; one line names it.
    ArithmeticError
        If the solver fails; the message names the outcome and the time.

    Examples
    --------
    A mass on a spring of 1 under the sudden acceleration 1 moves by 1 - cos t, and meets the stop
    at a gap of 1 with the velocity 1:

    >>> step = hpcsweep.Record([-1.0, -1.0], dt=2.0)
    >>> stop = hpcsweep.Structure(
    ...     n_floors=1, stiffness_ratio=1e4, damping_ratio=0.0, sharpness=math.inf
    ... )
    >>> peaks = hpcsweep.response(stop, step)
    >>> int(peaks.impacts[0]), round(float(peaks.impact_velocity[0]), 12)
    (1, 1.0)
    """
    structure, record, tail = arguments(structure, record, tail)
    scale = finite("scale", scale)
    if state is not None:
        state = finite_vector("state", state, 2 * structure.n_floors)
        elongation = structure.slider_directions @ state[: structure.n_floors]
        for slider, y in zip(structure.sliders, elongation.tolist(), strict=True):
            if abs(y) > slider.limit * (1.0 + AT_STRENGTH):
                name = slider.name or "of the structure"
                raise ValueError(
                    f"state: slider {name} would be extended by {y:.6g}, "
                    f"slips at {slider.limit:.6g}: sliders start without having slipped"
                )
    if energy and at_samples:
        raise ValueError("energy and at_samples must not be asked for both")
    shear = bool(structure.sliders) if base_shear is None else flag("base_shear", base_shear)
    solver = record_map(structure, record.dt, rtol, base_shear=shear, energy=flag("energy", energy))
    return _complete(solver.respond(record.acceleration, scale, tail, state, at_samples=at_samples))


def linear_response(
    structure: Structure,
    record: Record,
    tail: float = 0.0,
    base_shear: bool = False,
    energy: bool = False,
) -> tuple[Response, np.ndarray]:
    """Return the response without contacts, slips and collapse, and how far it reaches to each.

    From u = 0; times s it is the response at any scale s up to that of `first_contact_scale`. What
    it reaches is the gap that a contact needs if it is not to close.

    Parameters
    ----------
    structure, record, tail, base_shear, energy
        Of `response`.

    Returns
    -------
    Response
        At scale 1; forces, impacts and impulses are 0.
    ndarray, shape (k + L + D,)
        max_t d_k . u of each contact, at least 0; then max_t |b_j . u| of each slider, and each
        drift that has a limit.
    """
    structure, record, tail = arguments(structure, record, tail)
    n_drifts, n_contacts = len(structure.drift_rows), len(structure.contacts)
    slides = structure.slider_directions
    solver = linear_map(structure, record.dt, base_shear, energy)
    peaks = _complete(solver.respond(record.acceleration, 1.0, tail))
    drifts, slid, past = np.split(peaks.storey_drift, [n_drifts, n_drifts + len(slides)])
    sliders = [(slider.stiffness, slider.strength) for slider in structure.sliders]
    spring, strength = np.array(sliders).reshape(-1, 2).T
    force = spring * slid
    sizes = {"stop": n_contacts, "slider": len(slides)}
    still: dict[str, Any] = {
        quantity.name: np.zeros(sizes[quantity.dim], getattr(peaks, quantity.name).dtype)
        for quantity in TABLE
        if quantity.dim in sizes and quantity.name in vars(peaks)
    }
    still |= {"ductility": force / strength, "slider_force": force}
    linear = replace(
        peaks,
        **still | {"strength_lost": np.full(len(slides), math.nan)},
        storey_drift=drifts,
        drift_time=peaks.drift_time[:n_drifts],
        force_time=np.zeros(n_contacts),
        final_slider_force=np.zeros(len(slides)),
        residual_drift=np.zeros(n_drifts),
    )
    return linear, np.concatenate((past, slid, drifts[structure.drift_limits < math.inf]))


@lru_cache(maxsize=8)
def linear_map(structure: Structure, dt: float, base_shear: bool, energy: bool) -> "RecordMap":
    """Return what responds without contacts and slips, with what it reaches among its drifts."""
    free = Structure.from_matrices(
        structure.mass_matrix,
        structure.stiffness_matrix,
        [],
        damping=structure.damping_matrix,
        **structure.load,
        drift=np.vstack((structure.drift_rows, structure.slider_directions, structure.directions)),
    )
    n = len(structure.contacts)
    return record_map(free, dt, one_sided=n, base_shear=base_shear, energy=energy)


def first_contact_scale(structure: Structure, record: Record, tail: float = 0.0) -> float:
    """Return the scale of a record below which nothing closes, slips or collapses, from rest.

    min over contacts of gap / max_t(d . u), from one motion without contacts, and over sliders of
    F / (k max_t |b . u|), and likewise over the limits of drifts; 0 if a contact is pressed,
    gap < 0, and closed at rest; inf if nothing moves towards a contact. Stops are taken as sharp.

    Parameters
    ----------
    structure, record, tail
        Of `response`.

    Returns
    -------
    float
        Factor of the record's acceleration.

    Raises
    ------
    ValueError, ArithmeticError
        As `response`.

    Examples
    --------
    Under the sudden acceleration 1 a mass on a spring of 1 moves by 2, twice the gap:

    >>> step = hpcsweep.Record([-1.0, -1.0], dt=4.0)
    >>> stop = hpcsweep.Structure(n_floors=1, damping_ratio=0.0, sharpness=math.inf)
    >>> round(hpcsweep.first_contact_scale(stop, step), 12)
    0.5
    """
    _, reach = linear_response(structure, record, tail)
    return scale_of_contact(structure, reach)


def scale_of_contact(structure: Structure, reach: np.ndarray) -> float:
    """Return the scale of `first_contact_scale`, from what `linear_response` reaches."""
    gaps = structure.gaps.tolist()
    gaps += [slider.limit for slider in structure.sliders]
    gaps += structure.drift_limits[structure.drift_limits < math.inf].tolist()
    scales = [
        max(gap, 0.0) / way if way > 0.0 else 0.0 if gap < 0.0 else math.inf
        for gap, way in zip(gaps, reach.tolist(), strict=True)
    ]
    return min(scales, default=math.inf)


def record_map(structure: Structure, dt: float, *arguments: Any, **options: Any) -> "RecordMap":
    """Return what responds to records, and say it if its kernels have to be compiled."""
    # reading results needs no kernels
    from hpcsweep.solvers.compiling import load_aloud
    from hpcsweep.solvers.flow.record_map import RecordMap, kernels_of

    load_aloud(kernels_of(structure, options.get("energy", False)))
    return RecordMap(structure, dt, *arguments, **options)


def arguments(structure, record, tail) -> tuple[Structure, Record, float]:
    """Take the arguments that all responses have."""
    instance("structure", structure, Structure)
    instance("record", record, Record)
    longest = MAX_SAMPLES * record.dt
    return structure, record, number("tail", tail, f"from 0 to {longest:g}", 0.0, longest)


def _complete(ended: Response) -> Response:
    if ended.outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"flow: {ended.outcome.name} at {ended.duration:.6g}")
    return ended
