"""Layout of the campaign file: dimensions, variables, attributes.

HDF5, readable as netCDF-4: named dimension scales, ``units`` and ``long_name``. All datasets are
contiguous and allocated when the file is created, so that a block of consecutive runs is one range
of bytes in each variable, at a known offset.

``commit`` says which results are valid: 0, or the checksum of one block (see
`hpcsweep.store.commit`). The study (`hpcsweep.studies.study`) defines the variables, their
dimensions, and which runs belong to a block. Block b of an upward amplitude sweep holds amplitudes
b B to (b + 1) B - 1, of a downward one as many counted from the top; rows are always in ascending
amplitude.

Versions
--------
A file of the ``layout_version`` of this program must be what its job says. From `OLDEST` on, one
of an earlier version is read as it says itself (`hpcsweep.store.written`), and resumed, merged and
reused by the program that wrote it alone. A change of what is in the files of the same job gets a
new number; where the job comes to mean other results, so does `MEANING_VERSION` of
`hpcsweep.job.job`.

A file may be packed (`hpcsweep.store.copying`): the same datasets, chunked and compressed, with the
same values, attributes and checksums. It is read like any other, but no longer written.
"""

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from hpcsweep.job import Job
from hpcsweep.job.resolved import resolved
from hpcsweep.model import description
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import unit_of
from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.report import starting_range
from hpcsweep.studies.variable import CONTACT_SET, Variable

LAYOUT_VERSION = 9
OLDEST = 9
"""Least layout that is read."""
FORMAT = "hpcsweep campaign"
CONVENTIONS = "CF-1.8"
ALIKE = ("study.", "sweep.", "solver.")
"""Keys with which the structure does not vary."""


class StoreError(ValueError):
    """Raised for a file that cannot be used; the message is one line for the user."""


class DamagedError(StoreError):
    """Raised for a damaged campaign file, truncated or inconsistent, with what is wrong of it."""

    def __init__(self, path: Path, problem: str) -> None:
        super().__init__(path, problem)
        self.problem = problem

    def __str__(self) -> str:
        """Return the line for the user."""
        return "{}: {}".format(*self.args)


def reason(error: Exception) -> str:
    """Return the message of the system, or of HDF5, on one line."""
    return getattr(error, "strerror", None) or on_one_line(error)


@contextlib.contextmanager
def refusing(path: Path, what: str) -> Iterator[None]:
    """Turn what goes wrong within the ``with`` into one line: the file cannot be `what`.

    Raises
    ------
    StoreError
    """
    try:
        yield
    except StoreError:
        raise
    except (OSError, RuntimeError, ValueError) as error:
        raise StoreError(f"{path}: cannot be {what}: {reason(error)}") from None


class WriteError(RuntimeError):
    """Raised for a write that failed on one rank, e.g. on a full disk; one line for the user."""

    @classmethod
    def of(cls, path: Path, reason: str) -> "WriteError":
        """Return the error of a file that takes no more."""
        safe = "what is committed is safe: make room and run again to resume"
        return cls(f"{path}: cannot be written: {reason}; {safe}")


class Layout:
    """Layout of a job's file, made once and passed to all that read or write it.

    Parameters
    ----------
    job : Job

    Attributes
    ----------
    study : Study
    name, text, fingerprint : str
        Of the job.
    variables : list of Variable
        Of the runs, in the order of the file.
    sizes : dict of str to int
        Size of every dimension.
    coordinates : dict of str to Coordinate
    given : list of (Variable, ndarray)
        Variables that are known beforehand.
    structures : list of Variable
        The description of each part's structure, where a varied key changes it.
    derived : list of Variable
        Of a study that grows, see `hpcsweep.store.inferred`.
    commit : Variable
    growth : MapGrowth or None
        How a study grows that does not compute all of its runs.
    """

    is_own = True
    """Whether it is of this version, which then writes it, too."""

    def __init__(self, job: Job):
        self.job = job
        self.study = job.study
        self.name, self.text, self.fingerprint = job.name, job.text, job.fingerprint
        study, structure = job.study, job.study.structure
        self.growth = job.growth
        self.variables = [_named(variable, structure) for variable in study.variables]
        further = self.growth.coordinates if self.growth else {}
        coordinates = study.coordinates | further
        derived = self.growth.variables if self.growth else []
        self.derived = [_named(variable, structure) for variable in derived]
        self.sizes = {name: coordinate.values.size for name, coordinate in further.items()}
        self.sizes |= study.dimensions
        self.coordinates = {
            name: coordinate._replace(units=unit_of(structure, coordinate.units))
            for name, coordinate in coordinates.items()
        }
        self.given = [
            (_named(variable, structure), np.asarray(values, variable.dtype))
            for variable, values in study.given
        ]
        self.commit = study.commit
        changing = tuple(
            axis.name
            for axis in study.axes
            if not all(key.key.startswith(ALIKE) for key in axis.keys)
        )
        meaning = "equation of motion of the structure, JSON as the attribute structure"
        self.structures = [Variable("structures", changing, "O", "1", meaning)] if changing else []

    @property
    def datasets(self) -> list:
        """All variables but the coordinates, in the order of the file."""
        return [*self.structures, *(variable for variable, _ in self.given), *self.stored]

    @property
    def stored(self) -> list:
        """All variables that campaigns write."""
        return [*self.variables, *self.derived, self.commit]

    def notes(self, variable: Variable) -> dict[str, object]:
        """Return the attributes of a variable."""
        return attributes_of(variable, self.study.structure)

    def of(self, job: Job, _place: Place) -> "Layout":
        """Return the layout of a part of the job."""
        return Layout(job)

    def shape(self, variable) -> tuple[int, ...]:
        """Return the shape of a variable."""
        return tuple(self.sizes[dim] for dim in variable.dims)

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes that follow from the job."""
        study, settings = self.study, self.study.settings
        first = (0,) * len(study.axes)
        structure = study.part(first).structure
        forcing = description.RECORDED if study.content == "responses" else description.HARMONIC
        title = f"{self.name}: {study.kind.replace('_', ' ')}, {description.one_line(structure)}"
        starts = starting_range(study)
        # where there are several parts, they are those of the first
        part = f" ({study.describe_part(first)})" if first and study.n_parts > 1 else ""
        return {
            "Conventions": CONVENTIONS,
            "title": title,
            **self.job.about,
            "format": FORMAT,
            "layout_version": LAYOUT_VERSION,
            "fingerprint": self.fingerprint,
            "name": self.name,
            "job": self.text,
            "resolved_job": resolved(self.job),
            "variables": " ".join(variable.name for variable in self.variables),
            **({"derived": " ".join(v.name for v in self.derived)} if self.derived else {}),
            "equation": description.motion(structure, forcing),
            "signs": description.SIGNS,
            "structure": description.as_text(structure),
            "solver": settings.solver,
            "rtol": settings.rtol,
            **({"starts": "; ".join(starts) + part} if starts else {}),
        }

    @cached_property
    def described(self) -> np.ndarray:
        """Values of `structures`, over those of the varied keys that change them."""
        study, (variable,) = self.study, self.structures
        sizes = [len(axis.values) if axis.name in variable.dims else 1 for axis in study.axes]
        texts = [description.as_text(study.part(at).structure) for at in np.ndindex(*sizes)]
        return np.array(texts, object).reshape(self.shape(variable))

    def file_size(self) -> int:
        """Return the bytes of the file, without its few kilobytes of metadata."""
        return sum(math.prod(self.shape(v)) * np.dtype(v.dtype).itemsize for v in self.stored)


def _named(variable: Variable, structure: Structure) -> Variable:
    """Return a variable with the name of its unit filled in."""
    return replace(variable, units=unit_of(structure, variable.units))


def attributes_of(variable: Variable, structure: Structure) -> dict[str, object]:
    """Return the attributes of a variable: units, long_name and the meaning of its numbers."""
    named = {"units": unit_of(structure, variable.units), "long_name": variable.long_name}
    return named | flags_of(variable, structure)


def flags_of(variable: Variable, structure: Structure) -> dict[str, object]:
    """Return the CF attributes that give the meaning of a variable's numbers; often none."""
    if variable.flags == CONTACT_SET and structure.contact_names:
        masks = [1 << (number - 1) for number in structure.contact_names]
        names = [name.replace(" ", "_") for name in structure.contact_names.values()]
        return {"flag_masks": np.array(masks, variable.dtype), "flag_meanings": " ".join(names)}
    if variable.flags is None or isinstance(variable.flags, str):
        return {}
    words = {0: "none"} | {  # 0 fills what is not used
        int(flag): getattr(flag, "word", flag.name.lower()).replace(" ", "_")
        for flag in variable.flags
    }
    return {
        "flag_values": np.array([*words], variable.dtype),
        "flag_meanings": " ".join(words.values()),
    }
