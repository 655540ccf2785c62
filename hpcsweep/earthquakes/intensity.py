r"""Intensity measures of a ground-motion record: its strength as one number.

The acceleration is linear between samples, so that the ground's velocity and displacement, from
rest at t = 0, are polynomials there, and all measures are exact, extrema between samples included:

    v(t) = v_j + a_j t + b_j t^2 / 2,        d(t) = d_j + v_j t + a_j t^2 / 2 + b_j t^3 / 6,
    Arias intensity   I = pi / (2 g) int a^2 dt,    int a^2 dt = dt (a_j^2 + a_j a_(j+1)
                                                                  + a_(j+1)^2) / 3 a step.

The significant duration is the time in which I grows from 5 to 95 % of its last value. Spectral
accelerations are pseudo-accelerations over continuous time (`spectrum`); AvgSA is the geometric
mean of several. They are in the record's units: Sa in g is Sa over gravity.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, spectrum
from hpcsweep.earthquakes.units import STANDARD_GRAVITY
from hpcsweep.model.arguments import instance, positive, wrong
from hpcsweep.model.record import Record

START, END = 0.05, 0.95
"""Parts of the Arias intensity between which the significant duration lies."""


class Intensity(NamedTuple):
    """Intensity measures of one record, in the structure's units."""

    pga: float
    """Peak ground acceleration."""
    pgv: float
    """Peak ground velocity, from rest."""
    pgd: float
    """Peak ground displacement, from rest; large where the baseline of a record drifts."""
    arias: float
    """Arias intensity, a velocity."""
    duration: float
    """Significant duration, from 5 to 95 % of the Arias intensity."""


def intensity(record: Record, gravity: float = STANDARD_GRAVITY) -> Intensity:
    """Compute the intensity measures of a record that need no oscillator.

    Parameters
    ----------
    record : Record
    gravity : float
        One g in the record's units, for the Arias intensity.

    Returns
    -------
    Intensity
        In the units of the record, numbers each.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Arias, in: Seismic Design for Nuclear Power Plants (1970) 438; Trifunac and Brady, Bulletin of
    the Seismological Society of America 65 (1975) 581.

    Examples
    --------
    Ten seconds of a sine of 1 m/s^2 and 1 Hz: Arias intensity pi / (2 g) times 10 / 2.

    >>> sine = hpcsweep.Record(np.sin(2.0 * np.pi * np.arange(1001) * 0.01), dt=0.01)
    >>> measures = hpcsweep.intensity(sine)
    >>> round(measures.pga, 12), round(measures.arias / (math.pi / (2.0 * 9.80665) * 5.0), 2)
    (1.0, 1.0)
    """
    instance("record", record, Record)
    velocity, displacement = ground_motion(record)
    a, b, dt = record.acceleration[:-1], np.diff(record.acceleration) / record.dt, record.dt
    v, d = velocity[:-1], displacement[:-1]
    turns = _roots(np.zeros_like(b), b, a, dt)
    pgv = np.abs(v[:, None] + a[:, None] * turns + b[:, None] * turns**2 / 2.0)
    rests = _roots(b / 2.0, a, v, dt)
    pgd = np.abs(d[:, None] + _moved(rests, v[:, None], a[:, None], b[:, None]))
    return Intensity(
        pga=record.peak,
        pgv=max(float(pgv.max()), float(np.abs(velocity).max())),
        pgd=max(float(pgd.max()), float(np.abs(displacement).max())),
        arias=math.pi / (2.0 * positive("gravity", gravity)) * float(_energy(record)[-1]),
        duration=significant_duration(record),
    )


def ground_motion(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity and displacement of the ground at the samples, from rest, each (m,)."""
    a, dt = record.acceleration, record.dt
    velocity = np.append(0.0, np.cumsum(dt * (a[:-1] + a[1:]) / 2.0))
    steps = _moved(dt, velocity[:-1], a[:-1], np.diff(a) / dt)
    return velocity, np.append(0.0, np.cumsum(steps))


def significant_duration(record: Record) -> float:
    """Return the time in which the Arias intensity grows from `START` to `END` of its final value.

    Returns
    -------
    float
        In the record's unit of time; 0 if the ground does not move.
    """
    grown = _energy(record)
    return _reached(record, grown, END * grown[-1]) - _reached(record, grown, START * grown[-1])


def average_spectral_acceleration(
    record: Record, periods: Any, damping_ratio: float = DAMPING_RATIO
) -> float:
    """Return AvgSA, the geometric mean of Sa at one or several periods.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.
    """
    values = spectrum(record, periods, damping_ratio).acceleration
    if values.size == 0:
        raise wrong("periods", "must have at least 1 entry, has 0")
    if not values.all():
        return 0.0
    return float(np.exp(np.log(values).mean()))


def _moved(t: Any, v: Any, a: Any, b: Any) -> Any:
    """Return the displacement of the ground in a time t after samples."""
    return t * (v + t * (a / 2.0 + t * b / 6.0))


def _energy(record: Record) -> np.ndarray:
    """Return int a^2 dt up to each sample, shape (m,)."""
    a = record.acceleration
    steps = record.dt / 3.0 * (a[:-1] ** 2 + a[:-1] * a[1:] + a[1:] ** 2)
    return np.append(0.0, np.cumsum(steps))


def _reached(record: Record, grown: np.ndarray, level: float) -> float:
    """Return the first time at which int a^2 dt reaches a level."""
    after = int(np.searchsorted(grown, level))
    if after == 0:
        return 0.0
    a, dt = record.acceleration[after - 1], record.dt
    b = (record.acceleration[after] - a) / dt
    left = level - grown[after - 1]
    low, high = 0.0, dt
    while high - low > 4.0 * math.ulp(dt):
        t = 0.5 * (low + high)
        low, high = (t, high) if t * (a * a + t * (a * b + t * b * b / 3.0)) < left else (low, t)
    return (after - 1) * dt + high


def _roots(c2: np.ndarray, c1: np.ndarray, c0: np.ndarray, dt: float) -> np.ndarray:
    """Return the roots t of c2 t^2 + c1 t + c0 in (0, dt), shape (steps, 2); 0 for missing ones."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        half = -0.5 * (c1 + np.copysign(np.sqrt(c1 * c1 - 4.0 * c2 * c0), c1))
        roots = np.stack([half / c2, c0 / half], axis=-1)
    return np.where((roots > 0.0) & (roots < dt), roots, 0.0)
