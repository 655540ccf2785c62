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
from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.reading import read_record
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO, spectrum
from hpcsweep.earthquakes.synthetic import synthetic_records
from hpcsweep.earthquakes.units import STANDARD_GRAVITY, in_unit_of_time
from hpcsweep.model.arguments import instance, positive, wrong
from hpcsweep.model.record import Record

START, END = 0.05, 0.95
"""Parts of the Arias intensity between which the significant duration lies."""
MEASURES = ("factor", "pga", "pgv", "sa", "avgsa")
"""Intensity measures by which records are scaled."""
OWN_PERIOD, ISOLATED_PERIOD = OWN_PERIODS = "T1", "isolated"
"""In place of a period: the longest natural one of each structure."""
DIGITS = 12
"""Of measures: the last ones depend on the libraries, and a job must mean the same everywhere."""
SAME = 1e-7
"""Relative difference of a period that is known again: eigenvalues are rounded by the square of the
ratio of frequencies, which in a reduced model with more modes is 1e-9 of the lowest."""
KEPT = 16
"""Records that a process keeps, of those that are read from files."""


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


@dataclass(frozen=True)
class Measure:
    """Measure of a scale: an intensity measure of records.

    Attributes
    ----------
    by : str
        One of `MEASURES`; ``factor`` is 1 of every record as it is.
    periods : tuple of float or str
        Of ``sa`` one, or the name of that of each structure, of `OWN_PERIODS`; of ``avgsa`` one or
        more; of others none.
    damping_ratio : float
    """

    by: str = "factor"
    periods: tuple[float | str, ...] = ()
    damping_ratio: float = DAMPING_RATIO

    @property
    def own_period(self) -> str:
        """Name of the period that each structure has of its own; empty: it has numbers."""
        return next((period for period in self.periods if isinstance(period, str)), "")

    @property
    def quantity(self) -> str:
        """Dimension of the measure."""
        return {"factor": "1", "pgv": "velocity"}.get(self.by, "acceleration")

    def __str__(self) -> str:
        return self.named()

    def named(self, time: str = "") -> str:
        """Return the name with its periods, in a unit of time."""
        periods = ", ".join(
            period if isinstance(period, str) else f"{period:.6g} {time}".strip()
            for period in self.periods
        )
        names = {"factor": "scale factor", "avgsa": "AvgSA", "sa": "Sa"}
        name = names.get(self.by, self.by.upper())
        return f"{name}({periods}; {100 * self.damping_ratio:g} %)" if periods else name

    def of(self, record: Record) -> float:
        """Return the measure of a record."""
        if self.by == "factor":
            return 1.0
        if self.by == "pga":
            return record.peak
        if self.by == "pgv":
            return intensity(record).pgv
        return average_spectral_acceleration(record, self.periods, self.damping_ratio)


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


def facts_of(record: Record, measure: Measure, gravity: float) -> Facts:
    """Return what is known of a record."""
    numbers = (*intensity(record, gravity), measure.of(record))
    return Facts(record.name, record.digest, record.n_samples, record.dt, *map(rounded, numbers))


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


@dataclass(frozen=True)
class Files:
    """Records in files, read when they are needed; see `read_record`."""

    paths: tuple[str, ...]
    unit: str
    gravity: float
    dt: float | None = None
    time: str = "s"
    channel: int | None = None

    def record(self, i: int) -> Record:
        """Read record i.

        Raises
        ------
        ValueError, OSError
            If the file is no record, or cannot be read.
        """
        path = self.paths[i]
        state = Path(path).stat()
        changed = state.st_mtime_ns, state.st_size
        return _read(path, self.unit, self.gravity, self.dt, self.time, self.channel, changed)


@dataclass(frozen=True)
class Synthetic:
    """A synthetic suite, made when it is needed; see `synthetic_records`."""

    count: int
    seed: int = 0
    dt: float = 0.01
    duration: float = 30.0
    rms: float = 1.0
    soil: str = "firm"
    time: str = "s"
    """Unit of time of the structure, to which seconds are converted."""

    def record(self, i: int) -> Record:
        """Return record i.

        Raises
        ------
        ValueError
            If an attribute is outside its range.
        """
        return _made(self)[i]


def checked_record(source: Files | Synthetic, facts: Facts, i: int) -> Record:
    """Return record i of a source.

    Raises
    ------
    ValueError
        If it cannot be read, or differs from the record of the facts.
    """
    try:
        record = source.record(i)
    except OSError as error:
        said = f"records.files: {error.filename}: cannot be read: {error.strerror}"
        raise ValueError(said) from None
    if record.digest != facts.digest:
        raise ValueError(f"record {facts.name} is not the one the job was made with")
    return record


@lru_cache(maxsize=KEPT)
def _read(*given: Any) -> Record:
    return read_record(*given[:-1])  # a file that has been rewritten is read again


@lru_cache(maxsize=2)
def _made(suite: Synthetic) -> list[Record]:
    dt = in_unit_of_time(suite.dt, suite.time)
    made = synthetic_records(*astuple(suite)[:-1])
    return [Record(record.acceleration, dt, record.name) for record in made]
