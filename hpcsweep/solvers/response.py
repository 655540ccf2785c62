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
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.model.arguments import finite, finite_vector, flag, instance, number, positive
from hpcsweep.model.modes import per_mass
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.record_response import Response

AT_STRENGTH = 1e-9
"""Part by which a slider may start beyond its strength: rounding of a state put there."""
__all__ = ["Response", "first_contact_scale", "history", "linear_response", "response"]

WHOLE = "must be a whole multiple or a whole part of {:g}, the time between samples"
"""What a step between the instants of a history must be."""
SAME_STEP = 1e-9
"""Part of a step by which times may differ that are the same."""


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
        Tell the energies at the end, `Response.energy`, of sharp contacts; not with `at_samples`.

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
    structure, record, tail = _arguments(structure, record, tail)
    scale = finite("scale", scale)
    if state is not None:
        state = finite_vector("state", state, 2 * structure.n_floors)
        elongation = structure.slider_directions @ state[: structure.n_floors]
        for one, y in zip(structure.sliders, elongation.tolist(), strict=True):
            if abs(y) > one.limit * (1.0 + AT_STRENGTH):
                raise ValueError(
                    f"state: slider {one.name or 'of the structure'} would be extended by {y:.6g}, "
                    f"slips at {one.limit:.6g}: sliders start without having slipped"
                )
    from hpcsweep.solvers.flow.record_map import RecordMap  # reading results needs no kernels

    if energy and at_samples:
        raise ValueError("energy and at_samples must not be asked for both")
    shear = bool(structure.sliders) if base_shear is None else flag("base_shear", base_shear)
    wanted = {"base_shear": shear, "energy": flag("energy", energy)}
    solver = RecordMap(structure, record.dt, rtol, **wanted)
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
    structure, record, tail = _arguments(structure, record, tail)
    from hpcsweep.solvers.flow.record_map import RecordMap

    slides = structure.slider_directions
    n_drifts, n_contacts = len(structure.drift_rows), len(structure.contacts)
    free = Structure.from_matrices(
        structure.mass_matrix,
        structure.stiffness_matrix,
        [],
        damping=structure.damping_matrix,
        **structure.load,
        drift=np.vstack((structure.drift_rows, slides, structure.directions)),
    )
    more = {"base_shear": base_shear, "energy": energy}
    solver = RecordMap(free, record.dt, one_sided=n_contacts, **more)
    found = _complete(solver.respond(record.acceleration, 1.0, tail))
    nothing, none = np.zeros(n_contacts), np.zeros(len(slides))
    drifts, slid, past = np.split(found.drift, [n_drifts, n_drifts + len(slides)])
    sliders = [(one.stiffness, one.strength) for one in structure.sliders]
    spring, strength = np.array(sliders).reshape(-1, 2).T
    force = spring * slid
    linear = replace(
        found,
        drift=drifts,
        drift_time=found.drift_time[:n_drifts],
        force=nothing,
        impacts=nothing.astype(int),
        impact_velocity=nothing,
        contact_time=nothing,
        impulse=nothing,
        dissipated=nothing,
        force_time=nothing,
        ductility=force / strength,
        slider_force=force,
        plastic=none,
        plastic_path=none,
        excursions=none.astype(int),
        final_slider_force=none,
        slider_energy=none,
        residual_drift=np.zeros(n_drifts),
    )
    return linear, np.concatenate((past, slid, drifts[structure.drift_limits < math.inf]))


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
    gaps = [contact.gap for contact in structure.contacts]
    gaps += [slider.limit for slider in structure.sliders]
    gaps += structure.drift_limits[structure.drift_limits < math.inf].tolist()
    scales = [
        max(gap, 0.0) / way if way > 0.0 else 0.0 if gap < 0.0 else math.inf
        for gap, way in zip(gaps, reach.tolist(), strict=True)
    ]
    return min(scales, default=math.inf)


def _arguments(structure, record, tail) -> tuple[Structure, Record, float]:
    instance("structure", structure, Structure)
    instance("record", record, Record)
    longest = MAX_SAMPLES * record.dt
    return structure, record, number("tail", tail, f"from 0 to {longest:g}", 0.0, longest)


def _complete(found: Response) -> Response:
    if found.outcome is not Outcome.COMPLETE:
        raise ArithmeticError(f"flow: {found.outcome.name} at {found.duration:.6g}")
    return found


class History(NamedTuple):
    """The motion of a structure at p instants of a record and its tail."""

    time: np.ndarray
    """From the first sample on, shape (p,)."""
    displacement: np.ndarray
    """Relative to the ground, shape (p, n)."""
    velocity: np.ndarray
    """Shape (p, n)."""
    force: np.ndarray
    """Of each contact, shape (p, k)."""
    acceleration: np.ndarray
    """Absolute, as in `Response`, shape (p, n)."""
    peak_force: np.ndarray
    """Largest force of each contact since the instant before, shape (p, k)."""
    slider_force: np.ndarray
    """Of each slider, shape (p, L)."""


def history(
    structure: Structure,
    record: Record,
    scale: float = 1.0,
    tail: float = 0.0,
    step: float | None = None,
    *,
    rtol: float = 1e-9,
    poll: Callable[[], None] | None = None,
) -> History:
    """Return the motion of a structure under a record from rest, at instants a step apart.

    Exact at the instants, however far apart they are, up to a collapse; contacts may push between
    them alone, which `History.peak_force` tells.

    Parameters
    ----------
    structure, record, scale, tail
        Of `response`; what is left of record and tail beyond the last instant is cut.
    step : float, optional
        A whole multiple or a whole part of the time between samples, which is the default.
    rtol
        Of `response`.
    poll : callable, optional
        Called before each instant; may raise to leave.

    Returns
    -------
    History
        Times, shape (p,); displacements and velocities, each of shape (p, n); forces of contacts
        and of sliders, a column each; in the units of structure and record.

    Raises
    ------
    ValueError, ArithmeticError
        As `response`.

    Examples
    --------
    1 - cos t, under the sudden acceleration 1:

    >>> step = hpcsweep.Record([-1.0, -1.0], dt=4.0)
    >>> free = hpcsweep.Structure(n_floors=1, stiffness_ratio=0.0, damping_ratio=0.0)
    >>> motion = hpcsweep.history(free, step, step=1.0)
    >>> bool(np.allclose(motion.displacement[:, 0], 1.0 - np.cos(motion.time), atol=1e-14))
    True
    """
    structure, record, tail = _arguments(structure, record, tail)
    scale = finite("scale", scale)
    step = record.dt if step is None else positive("step", step)
    if not (fits := steps_in(record.dt, step)):
        raise ValueError(f"step {WHOLE.format(record.dt)}, is {step:g}")
    parts, samples = fits
    dt = record.dt / parts
    fine = np.arange(parts * (record.n_samples - 1) + 1) / parts
    ground = np.interp(fine, np.arange(record.n_samples), record.acceleration)
    from hpcsweep.solvers.flow.record_map import RecordMap

    own = RecordMap(structure, dt, rtol)
    last, n_all = ground.size - 1, ground.size - 1 + int(tail / dt + SAME_STEP)
    count, n = n_all // samples + 1, structure.n_floors
    states, peaks = np.empty((count, 2 * n)), np.zeros((count, len(structure.contacts)))
    slider_force = np.zeros((count, len(structure.sliders)))
    states[0] = structure.rest
    for j in range(1, count):
        if poll is not None:
            poll()
        low, high = (j - 1) * samples, j * samples
        pushed = ground[low : high + 1] if low < last else np.zeros(samples + 1)
        free = (samples + 1 - pushed.size) * dt
        found = _complete(own.respond(pushed, scale, free, states[j - 1], resume=j > 1))
        states[j], peaks[j] = found.final_state, found.force
        slider_force[j] = found.final_slider_force
        if found.collapsed:
            states, peaks, slider_force = states[:j], peaks[:j], slider_force[:j]
            break
    u, v, force = states[:, :n], states[:, n:], structure.contact_forces(states)
    peaks[0] = np.maximum(force[0], 0.0)
    push = -u @ structure.elastic_stiffness - v @ structure.damping_matrix
    push -= force @ structure.directions
    push -= slider_force @ structure.slider_directions
    if not structure.shakes:
        given = ground[: n_all + 1 : samples][: len(push)]
        push[: given.size] += scale * np.outer(given, structure.forcing_vector)
    acceleration = per_mass(structure.mass_matrix, push.T).T
    time = dt * samples * np.arange(len(states))
    return History(time, u, v, force, acceleration, peaks, slider_force)


def steps_in(dt: float, step: float) -> tuple[int, int] | None:
    """Return parts of a sample interval, and how many of them are a step; one of the two is 1.

    None if a step is neither a whole multiple nor a whole part of an interval, or far from it.
    """
    if not dt / MAX_SAMPLES <= step <= dt * MAX_SAMPLES:
        return None
    parts, samples = max(round(dt / step), 1), max(round(step / dt), 1)
    if abs(step * parts - dt * samples) > SAME_STEP * dt * samples:
        return None
    return parts, samples
