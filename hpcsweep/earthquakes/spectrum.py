"""Response spectra of ground-motion records: peaks of oscillators of many periods."""

import math
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.oscillator import Oscillator
from hpcsweep.model.arguments import array, instance, number, refused
from hpcsweep.model.record import Record

DAMPING_RATIO = 0.05
"""Of the spectra of codes and of published records."""
SHORTEST, LONGEST = 0.01, 1e6
"""Periods in steps of the record: shorter oscillators stand still, longer ones do not move."""


class Spectrum(NamedTuple):
    """A response spectrum, one number a period, in the structure's units."""

    displacement: np.ndarray
    """Largest |u| relative to the ground, shape (p,)."""
    velocity: np.ndarray
    """Pseudo-velocity w D, w = 2 pi / T, shape (p,)."""
    acceleration: np.ndarray
    """Pseudo-acceleration w^2 D, shape (p,); over 1 g it is what codes call Sa."""


def spectrum(
    record: Record, periods: Any, damping_ratio: float = DAMPING_RATIO, at_samples: bool = False
) -> Spectrum:
    """Compute the response spectrum of a record.

    Oscillators start at rest and are integrated to the last sample, exactly for an acceleration
    that is linear between samples. Later oscillations are not: records end quietly.

    Parameters
    ----------
    record : Record
    periods : array_like, shape (p,)
        Natural periods T without damping, from dt / 100 to 1e6 dt.
    damping_ratio : float
        From 0, below 1.
    at_samples : bool
        Take the largest displacement at the samples, as published spectra do, and not over
        continuous time. Of a sinusoid of period T, samples miss 1 - cos(pi dt / T) at most.

    Returns
    -------
    Spectrum
        Displacement, pseudo-velocity and pseudo-acceleration, each of shape (p,).

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or outside its range.

    References
    ----------
    Chopra, *Dynamics of Structures*, 5.2 and 6.4 to 6.6.

    Examples
    --------
    A sudden acceleration of 1 for half a period doubles the static displacement, (T / (2 pi))^2:

    >>> step = hpcsweep.Record(np.ones(301), dt=0.01)
    >>> spectrum = hpcsweep.spectrum(step, [1.0, 2.0], damping_ratio=0.0)
    >>> spectrum.acceleration.round(12)
    array([2., 2.])
    """
    instance("record", record, Record)
    wanted = _periods(periods, record.dt)
    ratio = number("damping_ratio", damping_ratio, "from 0 to below 1", 0.0, math.nextafter(1, 0))
    omegas = 2.0 * math.pi / wanted
    peaks = [
        Oscillator(record.acceleration, record.dt, omega, ratio).peak(bool(at_samples))
        for omega in omegas.tolist()
    ]
    displacement = np.array(peaks, dtype=float)
    return Spectrum(displacement, omegas * displacement, omegas**2 * displacement)


def _periods(given: Any, dt: float) -> np.ndarray:
    """Take natural periods, shape (p,)."""
    periods = array("periods", given)
    if periods.ndim != 1:
        raise ValueError(f"periods must have one dimension, has shape {periods.shape}")
    least, most = SHORTEST * dt, LONGEST * dt
    for period in periods.tolist():
        if not least <= period <= most:
            limit = f"from {least:g} to {most:g} with samples every {dt:g}"
            raise refused("periods", limit, period)
    return periods
