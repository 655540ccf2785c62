r"""Intensity measures of ground-motion records, and suites of records that are known by them.

The acceleration is linear between samples, so that the ground's velocity and displacement, from
rest at t = 0, are polynomials there, and all measures are exact, extrema between samples included:

    v(t) = v_j + a_j t + b_j t^2 / 2,        d(t) = d_j + v_j t + a_j t^2 / 2 + b_j t^3 / 6,
    Arias intensity   I = pi / (2 g) int a^2 dt,    int a^2 dt = dt (a_j^2 + a_j a_(j+1)
                                                                  + a_(j+1)^2) / 3 a step.

The significant duration is the time in which I grows from 5 to 95 % of its last value. Spectral
accelerations are pseudo-accelerations over continuous time (`spectrum`); AvgSA is the geometric
mean of several. They are in the record's units: Sa in g is Sa over gravity.

A study of many records keeps of each a name, a checksum of its samples, and these measures; the
samples are read, or made, when a response is computed. So a file of results can be opened where the
records are not, and a rank's memory does not grow with their number.
"""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, pair_spectrum, spectrum
from hpcsweep.earthquakes.units import STANDARD_GRAVITY
from hpcsweep.model.arguments import instance, positive
from hpcsweep.model.record import Record

START, END = 0.05, 0.95
"""Parts of the Arias intensity between which the significant duration lies."""
MEASURES = ("factor", "pga", "pgv", "sa", "avgsa", "target")
"""Intensity measures by which records are scaled."""
COMPONENTS = {"geometric mean": None, "rotd50": 50.0, "rotd100": 100.0}
"""What two components are scaled by together; of rotated ones the percentile."""
MOST_PERIODS = 4
"""Of the name of a measure, unless it has the first and the last."""
OWN_PERIOD, ISOLATED_PERIOD = OWN_PERIODS = "T1", "isolated"
"""In place of a period: the longest natural one of each structure."""
DIGITS = 12
"""Of measures: the last ones depend on the libraries, and a job must mean the same everywhere."""
SAME = 1e-7
"""Relative difference of a period that is known again: eigenvalues are rounded by the square of the
ratio of frequencies, which in a reduced model with more modes is 1e-9 of the lowest."""


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


def _moved(t: Any, v: Any, a: Any, b: Any) -> Any:
    """Return the displacement of the ground in a time t after samples."""
    return t * (v + t * (a / 2.0 + t * b / 6.0))


def _energy(record: Record) -> np.ndarray:
    """Return int a^2 dt up to each sample, shape (m,)."""
    a = record.acceleration
    steps = record.dt / 3.0 * (a[:-1] ** 2 + a[:-1] * a[1:] + a[1:] ** 2)
    return np.append(0.0, np.cumsum(steps))


def arias_shares(record: Record) -> np.ndarray:
    """Return the share of the Arias intensity that has come by each sample, shape (m,)."""
    grown = _energy(record)
    return grown / (grown[-1] or 1.0)


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


@dataclass(frozen=True)
class Measure:
    """Measure of a scale: an intensity measure of records.

    Attributes
    ----------
    by : str
        One of `MEASURES`; ``factor`` is 1 of every record as it is.
    periods : tuple of float or str
        Of ``sa`` one, or the name of that of each structure, of `OWN_PERIODS`; of ``avgsa`` and
        ``target`` one or more; of others none.
    damping_ratio : float
    target : tuple of float
        Sa of the target spectrum at the periods. The factor f of least squares, over the periods,
        of ln f S - ln S_target is the geometric mean of S_target over that of S.
    least : float
        Share of the target below which the mean of the scaled suite is nowhere.
    components : str
        What pairs of records have in common, of `COMPONENTS`; empty without pairs.
    unit : str
        ``g`` of scales that are given so; a label.
    """

    by: str = "factor"
    periods: tuple[float | str, ...] = ()
    damping_ratio: float = DAMPING_RATIO
    target: tuple[float, ...] = field(default=(), metadata={"later": True})
    least: float = field(default=0.0, metadata={"later": True})
    components: str = field(default="", metadata={"later": True})
    unit: str = field(default="", compare=False)

    @property
    def own_period(self) -> str:
        """Name of the period that each structure has of its own; empty: it has numbers."""
        return next((period for period in self.periods if isinstance(period, str)), "")

    @property
    def quantity(self) -> str:
        """Dimension of the measure."""
        return {"factor": "1", "target": "1", "pgv": "velocity"}.get(self.by, "acceleration")

    def __str__(self) -> str:
        return self.named()

    def named(self, time: str = "") -> str:
        """Return the name with its periods, in a unit of time."""
        listed = [
            period if isinstance(period, str) else f"{period:.6g} {time}".strip()
            for period in self.periods
        ]
        few = len(listed) <= MOST_PERIODS
        periods = ", ".join(listed if few else (listed[0], "...", listed[-1]))
        names = {"factor": "scale factor", "avgsa": "AvgSA", "sa": "Sa", "target": "target factor"}
        name = names.get(self.by, self.by.upper())
        periods += f"; {100 * self.damping_ratio:g} %" * bool(periods)
        components = self.components.replace("rotd", "RotD")
        inside = ", ".join(filter(None, (components, periods)))
        return f"{name}({inside})" if inside else name

    def ordinates(self, record: Record, other: Record | None = None) -> np.ndarray:
        """Return the numbers of a record, or of a pair, of which the measure is the mean."""
        if self.periods:
            of = self.periods, self.damping_ratio
            if other is not None and (percentile := COMPONENTS[self.components]) is not None:
                return pair_spectrum(record, other, *of, percentile).acceleration
            numbers = spectrum(record, *of).acceleration
        elif self.by == "pgv":
            numbers = np.array([intensity(record).pgv])
        else:
            numbers = np.array([record.peak if self.by == "pga" else 1.0])
        return numbers if other is None else np.sqrt(numbers * self.ordinates(other))

    def of(self, ordinates: np.ndarray) -> np.ndarray:
        """Return the measures of records with some ordinates, (records, p): geometric means."""
        with np.errstate(divide="ignore"):
            measures = np.exp(np.log(ordinates).mean(axis=1))
        if self.target:
            measures /= np.exp(np.log(self.target).mean())
            mean = (ordinates / measures[:, None]).mean(axis=0)
            measures /= max(float((self.least * np.array(self.target) / mean).max()), 1.0)
        return measures


class Facts(NamedTuple):
    """What is known of a record without its samples, in the structure's units."""

    name: str
    digest: str
    """Of samples and step."""
    samples: int
    dt: float
    pga: float
    pgv: float
    pgd: float
    arias: float
    duration: float
    """As of `hpcsweep.earthquakes.intensity.Intensity`."""
    measure: float
    """That by which the record is scaled."""

    @property
    def is_sound(self) -> bool:
        """Whether all but the measure are of their types."""
        words, numbers = self[:2], self[3:-1]
        typed = all(isinstance(word, str) for word in words) and type(self.samples) is int
        return typed and all(isinstance(word, float) for word in numbers) and self.dt > 0


def facts_of(record: Record, gravity: float) -> Facts:
    """Return what is known of a record, but for its measure."""
    numbers = map(rounded, (*intensity(record, gravity), 1.0))
    return Facts(record.name, record.digest, record.n_samples, record.dt, *numbers)


def nearest(periods: list[float], sought: Any) -> Any:
    """Return the places of periods among known ones, which ascend.

    Raises
    ------
    ValueError
        If one is not known.
    """
    held = np.asarray(periods, float)
    after = np.minimum(np.searchsorted(held, sought), held.size - 1)
    at = np.where(abs(held[after - 1] - sought) <= abs(held[after] - sought), after - 1, after)
    if not np.all(abs(held[at] - sought) <= SAME * sought):
        raise ValueError
    return at


def rounded(number: float) -> float:
    """Return a number of `DIGITS` digits."""
    return float(f"{number:.{DIGITS - 1}e}")
