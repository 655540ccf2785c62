"""Where the records of a study come from: files, a synthetic suite, parts and sequences of these.

Samples are read, or made, when they are needed; so a rank's memory does not grow with their number.
"""

from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.earthquakes.intensity import SAME, Facts, arias_shares
from hpcsweep.earthquakes.reading import read_record
from hpcsweep.earthquakes.synthetic import synthetic_records
from hpcsweep.earthquakes.units import in_unit_of_time
from hpcsweep.model.arguments import refused
from hpcsweep.model.record import Record

KEPT = 16
"""Records that a process keeps, of those that are read from files."""


@dataclass(frozen=True)
class Files:
    """Records in files, read when they are needed; see `read_record`."""

    paths: tuple[str, ...]
    unit: str
    gravity: float
    dt: float | None = None
    time: str = "s"
    channel: int | None = None

    @property
    def count(self) -> int:
        """Number of records."""
        return len(self.paths)

    def names(self, i: int) -> tuple[str, ...]:
        """Return what record i may be called."""
        return Path(self.paths[i]).stem, Path(self.paths[i]).name

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

    def names(self, i: int) -> tuple[str, ...]:
        """Return what record i may be called."""
        return (f"synthetic-{self.seed}-{i + 1}",)

    def record(self, i: int) -> Record:
        """Return record i.

        Raises
        ------
        ValueError
            If an attribute is outside its range.
        """
        return _made(self)[i]


@dataclass(frozen=True)
class Chosen:
    """Records of a source, of which parts of the Arias intensity are kept, or sequences of them."""

    source: Files | Synthetic
    arias: tuple[float, ...]
    """Two shares; empty: whole."""
    sequences: tuple[tuple[Any, ...], ...]
    """Names of records, and the time of rest between two."""

    @property
    def count(self) -> int:
        """Number of records."""
        return len(self.sequences) or self.source.count

    def record(self, i: int) -> Record:
        """Return record i.

        Raises
        ------
        ValueError, OSError
            If one cannot be had, or steps are no multiples of each other.
        """
        if not self.sequences:
            return self._cut(i)
        places = {name: i for i in range(self.source.count) for name in self.source.names(i)}
        if unknown := [name for name in self.sequences[i][::2] if name not in places]:
            raise refused("sequence", "names of records", unknown[0])
        made, *others = (self._cut(places[name]) for name in self.sequences[i][::2])
        for rest, record in zip(self.sequences[i][1::2], others, strict=True):
            made = joined(made, rest, record)
        return made

    def _cut(self, i: int) -> Record:
        record = self.source.record(i)
        if not self.arias:
            return record
        low, high = np.searchsorted(arias_shares(record), self.arias)
        low = max(int(low) - 1, 0)
        return Record(
            record.acceleration[low : max(int(high), low + 1) + 1], record.dt, record.name
        )


def joined(first: Record, rest: float, second: Record) -> Record:
    """Return a record that goes on, after a time of rest between two samples, with another.

    The rest is of whole steps, the smaller ones of both, of which the larger must be a multiple.
    """
    dt = min(first.dt, second.dt)
    parts = []
    for record in (first, second):
        n = round(record.dt / dt)
        if abs(record.dt / dt - n) > SAME:
            limit = f"a multiple of {dt:g}, the step of what it is in sequence with"
            raise refused("dt", limit, record.dt)
        fine = np.arange((record.n_samples - 1) * n + 1) / n
        parts.append(np.interp(fine, np.arange(record.n_samples), record.acceleration))
    between = np.zeros(max(round(rest / dt) - 1, 0))
    return Record(np.hstack((parts[0], between, parts[1])), dt, f"{first.name}+{second.name}")


def checked_record(source: Files | Synthetic | Chosen, facts: Facts, i: int) -> Record:
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
