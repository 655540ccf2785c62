"""A ground-motion record: the acceleration of the ground, sampled at equal steps.

The acceleration a(t) is linear between its samples, as is customary, and 0 before the first sample,
at t = 0, and after the last one. Units are those of the structure that it shakes: length per time
squared, and time.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hpcsweep.model.arguments import array, finite, positive, refused, wrong
from hpcsweep.model.system import frozen

MAX_SAMPLES = 500_000
"""Most samples of a record: 40 minutes at 200 a second; the longest published have 60,000."""


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """A ground-motion record, a(t) linear between the samples at t_j = j dt.

    Two records are equal if their samples, steps and names are equal.

    Parameters
    ----------
    acceleration : array_like, shape (m,)
        Acceleration of the ground, in the structure's units; finite, from 2 to 500,000 samples.
        Copied, and read-only afterwards.
    dt : float
        Time between two samples, finite and above 0.
    name : str
        Name that distinguishes the record from others.

    Raises
    ------
    ValueError
        If a value is of the wrong kind or outside its range; the message names it and its limit.

    Examples
    --------
    Ten periods of a sine of 1 Hz, in m/s^2 and s:

    >>> time = np.arange(1001) * 0.01
    >>> hpcsweep.Record(2.0 * np.sin(2.0 * np.pi * time), dt=0.01, name="sine")
    Record('sine', 1001 samples, dt=0.01, peak=2)
    """

    acceleration: np.ndarray
    dt: float
    name: str = ""

    def __post_init__(self):
        samples = array("acceleration", self.acceleration)
        if samples.ndim != 1:
            raise wrong("acceleration", f"must have one dimension, has shape {samples.shape}")
        if not 2 <= samples.size <= MAX_SAMPLES:
            limit = f"must have from 2 to {MAX_SAMPLES} samples"
            raise wrong("acceleration", f"{limit}, has {samples.size}")
        infinite = np.flatnonzero(~np.isfinite(samples))
        if infinite.size:
            j = int(infinite[0])
            raise wrong("acceleration", f"must be finite, is {samples[j]} at sample {j + 1}")
        if not isinstance(self.name, str):
            raise refused("name", "a text", self.name)
        # adding 0 gives -0 and 0, which are equal, the same bits
        object.__setattr__(self, "acceleration", frozen(samples + 0.0))
        object.__setattr__(self, "dt", positive("dt", self.dt))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return (self.dt, self.name) == (other.dt, other.name) and np.array_equal(
            self.acceleration, other.acceleration
        )

    def __hash__(self) -> int:
        return hash((self.dt, self.name, self.acceleration.tobytes()))

    def __repr__(self) -> str:
        named = f"{self.name!r}, " if self.name else ""
        return f"Record({named}{self.n_samples} samples, dt={self.dt!r}, peak={self.peak:.5g})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.acceleration, self.dt, self.name)

    @property
    def n_samples(self) -> int:
        """Number m of samples."""
        return self.acceleration.size

    @property
    def duration(self) -> float:
        """Time (m - 1) dt of the last sample."""
        return (self.n_samples - 1) * self.dt

    @property
    def times(self) -> np.ndarray:
        """Times j dt of the samples, shape (m,)."""
        return self.dt * np.arange(self.n_samples)

    @cached_property
    def digest(self) -> str:
        """Checksum of the samples and the time between them."""
        data = np.append(self.acceleration, self.dt).astype("<f8")
        return hashlib.sha256(data.tobytes()).hexdigest()[:16]

    @property
    def peak(self) -> float:
        """Largest |a(t)|, attained at a sample: the peak ground acceleration."""
        return float(np.abs(self.acceleration).max())

    def scaled(self, factor: float) -> "Record":
        """Return the same record with its acceleration multiplied by a finite factor."""
        return Record(self.acceleration * finite("factor", factor), self.dt, self.name)
