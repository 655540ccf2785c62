"""Suites of records as a study holds them: where samples come from, and what is known without them.

A study of many records keeps of each a name, a checksum of its samples, and its intensity measures;
the samples are read, or made, when a response is computed. So a file of results can be opened where
the records are not, and a rank's memory does not grow with their number.
"""

from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hpcsweep.earthquakes.intensity import average_spectral_acceleration, intensity
from hpcsweep.earthquakes.reading import read_record
from hpcsweep.earthquakes.spectrum import DAMPING_RATIO
from hpcsweep.earthquakes.synthetic import synthetic_records
from hpcsweep.earthquakes.units import in_unit_of_time
from hpcsweep.model.record import Record

MEASURES = ("factor", "pga", "pgv", "sa", "avgsa")
"""Intensity measures by which records are scaled."""
OWN_PERIOD = "T1"
"""In place of a period: the longest natural one of each structure."""
DIGITS = 12
"""Of measures: the last ones depend on the libraries, and a job must mean the same everywhere."""
SAME = 1e-9
"""Relative difference of a period that is known again."""
KEPT = 16
"""Records that a process keeps, of those that are read from files."""


@dataclass(frozen=True)
class Measure:
    """Measure of a scale: an intensity measure of records.

    Attributes
    ----------
    by : str
        One of `MEASURES`; ``factor`` is 1 of every record as it is.
    periods : tuple of float or str
        Of ``sa`` one, `OWN_PERIOD` for that of each structure; of ``avgsa`` one or more; of others
        none.
    damping_ratio : float
    """

    by: str = "factor"
    periods: tuple[float | str, ...] = ()
    damping_ratio: float = DAMPING_RATIO

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
