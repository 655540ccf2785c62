"""The motion of a structure under a ground-motion record, at instants a step apart."""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.model.arguments import callback, finite, number, positive
from hpcsweep.model.record import MAX_SAMPLES, Record
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.polling import Poll
from hpcsweep.solvers.response import arguments

WHOLE = "must be a whole multiple or a whole part of {:g}, the time between samples"
"""What a step between the instants of a history must be."""
SAME_STEP = 1e-9
"""Part of a step by which times may differ that are the same."""


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
    approach: np.ndarray
    """By how much each contact has closed, d . u, which is past its gap where it pushes, (p, k)."""


def history(
    structure: Structure,
    record: Record,
    scale: float = 1.0,
    tail: float = 0.0,
    step: float | None = None,
    *,
    start: float = 0.0,
    end: float | None = None,
    rtol: float = 1e-9,
    poll: Poll = None,
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
    start, end : float, optional
        Return the instants from `start` to `end`, of those whole steps after the first sample.
        Default: all.
    rtol
        Of `response`.
    poll : callable, optional
        Called every now and then; may raise to leave.

    Returns
    -------
    History
        Times, shape (p,); displacements, velocities and accelerations, each of shape (p, n); forces
        of contacts and of sliders, a column each; in the units of structure and record.

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
    structure, record, tail = arguments(structure, record, tail)
    scale = finite("scale", scale)
    step = record.dt if step is None else positive("step", step)
    if not (fits := steps_in(record.dt, step)):
        raise ValueError(f"step {WHOLE.format(record.dt)}, is {step:g}")
    parts, samples = fits
    dt, longest = record.dt / parts, record.dt * (record.n_samples - 1) + tail
    start = number("start", start, f"from 0 to {longest:g}", 0.0, longest)
    if end is not None:
        longest = number("end", end, f"from start to {longest:g}", start, longest)
    ground = refined(record, parts)
    from hpcsweep.solvers.instants import InstantMap, accelerations

    interval, poll = dt * samples, callback("poll", poll)
    first, last = math.ceil(start / interval - SAME_STEP), int(longest / interval + SAME_STEP)
    seen = InstantMap(structure, dt, rtol).follow(ground, scale, last * samples, poll)
    n, count = structure.n_floors, (len(seen.states) - 1) // samples + 1
    peaks = seen.peak_force[1 : (count - 1) * samples + 1]
    peaks = peaks.reshape(count - 1, samples, peaks.shape[1]).max(axis=1)
    kept = slice(first, count)
    states = seen.states[::samples][kept]
    slider_force, force = seen.slider_force[::samples][kept], structure.contact_forces(states)
    scaled = None
    if not structure.shakes:
        scaled = np.zeros(max(count, first))
        pushed = scale * ground[::samples][:count]
        scaled[: pushed.size] = pushed
        scaled = scaled[kept]
    return History(
        interval * np.arange(first, count),
        states[:, :n],
        states[:, n:],
        force,
        accelerations(structure, states, (force, slider_force), scaled),
        np.vstack((np.maximum(structure.contact_forces(seen.states[:1]), 0.0), peaks))[kept],
        slider_force,
        states[:, :n] @ structure.directions.T,
    )


def refined(record: Record, parts: int) -> np.ndarray:
    """Return the acceleration of a record with so many parts of each interval."""
    fine = np.arange(parts * (record.n_samples - 1) + 1) / parts
    return np.interp(fine, np.arange(record.n_samples), record.acceleration)


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
