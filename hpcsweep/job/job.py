"""A validated job, and its fingerprint: a hash of what it means.

The fingerprint distinguishes the files of different jobs, and is the seed of all checksums in them.
Every field of the study, its structure and its settings counts where it differs from its default,
so that a new field changes only the jobs that use it.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cached_property

import numpy as np

from hpcsweep.model.arguments import InputError
from hpcsweep.model.structure import Structure
from hpcsweep.studies.refine.growth import MapGrowth
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.study import Study
from hpcsweep.studies.vary import Varied

MEANING_VERSION = 4
"""Part of the fingerprint; raised when the same job text comes to mean other results."""


EXCLUDED_FIELDS = ("structure", "settings", "source", "gravity")
"""Fields of the parts, and where the samples of records come from, which their checksums
identify."""


def fingerprint(study: Study) -> str:
    """Hash the meaning of a study."""
    meaning: list[object] = [MEANING_VERSION, study.kind]
    if isinstance(study, Varied):
        axes = [
            (column.key, _canonical(column.values))
            for axis in study.axes
            for column in (axis, *axis.columns)
        ]
        meaning += ["vary", fingerprint(study.base), axes]
    else:
        meaning += [(name, value) for _, name, value in _entries(study)]
    return hashlib.sha256(repr(meaning).encode()).hexdigest()


def meaning_but_grid(study: Study) -> dict[tuple[str, str], object]:
    """Return the meaning of a study without axes, apart from its grid, by part and field.

    The fields `grid_fields` define the grid: which runs there are, not what a run computes. Two
    studies whose other fields are equal compute the same run at the same place of their grids, from
    the same state.
    """
    meaning: dict[tuple[str, str], object] = {("study", "kind"): study.kind}
    meaning |= {(part, name): value for part, name, value in _entries(study, study.grid_fields)}
    return meaning


def _entries(study: Study, without: tuple[str, ...] = ()) -> Iterator[tuple[str, str, object]]:
    """Iterate over the fields that differ from their defaults: part, name, value."""
    for kind, part in (("structure", study.structure), ("settings", study.settings)):
        yield from _fields_of(kind, part, EXCLUDED_FIELDS)
    yield from _fields_of("study", study, (*EXCLUDED_FIELDS, *without))


def _fields_of(kind: str, part, without: tuple[str, ...]) -> Iterator[tuple[str, str, object]]:
    for entry in fields(part):
        value = getattr(part, entry.name)
        if entry.name == "damping_ratio" and isinstance(part, Structure):
            # one for each mode, under the name that files have it by
            yield kind, "_ratios", _canonical(part.given_ratios.tolist())
        elif entry.compare and entry.name not in without and not _is_default(entry, value):
            yield kind, entry.name, _canonical(value)


def _is_default(entry: Field, value: object) -> bool:
    """Return whether a field has its default; one without a default never has."""
    if entry.default_factory is not MISSING:
        return bool(value == entry.default_factory())
    return entry.default is not MISSING and bool(value == entry.default)


def _canonical(value: object) -> object:
    """Return a canonical form of a value: equal to the last bit for equal values.

    Raises
    ------
    TypeError
        If its type has no such form: a field must not be left out silently.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        data = hashlib.sha256(value.astype(value.dtype.newbyteorder("<")).tobytes())
        return [value.dtype.name, value.shape, data.hexdigest()]
    if isinstance(value, frozenset | set):
        return sorted(value)
    if isinstance(value, tuple | list):
        return [_canonical(item) for item in value]
    if isinstance(value, Mapping):
        return sorted((key, _canonical(item)) for key, item in value.items())
    if isinstance(value, Structure):
        return [[name, content] for _, name, content in _fields_of("", value, EXCLUDED_FIELDS)]
    if (meaning := getattr(value, "meaning", None)) is not None:
        return _canonical(meaning)
    if is_dataclass(value):
        pairs = [(f, getattr(value, f.name)) for f in fields(value)]
        # a field that was added later counts where it differs from its default, a label never
        kept = [(f, v) for f, v in pairs if f.compare]
        kept = [(f, v) for f, v in kept if not (f.metadata.get("later") and _is_default(f, v))]
        return [(f.name, _canonical(v)) for f, v in kept]
    raise TypeError(f"a {type(value).__name__} has no place in a job's fingerprint")


ABOUT = ("title", "institution", "license")
"""Keys of a job that only tell about its results, and attributes of the file."""


class JobError(InputError):
    """Raised for a job that cannot be run; the message is one line for the user.

    Attributes
    ----------
    line : str
        Of a file of rows, where it is about one: "line 2".
    """

    line = ""


@dataclass(frozen=True, eq=False)
class Job:
    """A validated job.

    Attributes
    ----------
    name : str
        Default name of the results.
    text : str
        The TOML text.
    study : Study
        Study that the job computes.
    notes : tuple of str
        Messages for the user about changes made to the text, a line each.
    about : mapping of str to str
        Attributes of the file that the job gives, of `ABOUT`.
    """

    name: str
    text: str
    study: Study
    notes: tuple[str, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """Structure of the study."""
        return self.study.structure

    @property
    def settings(self) -> SweepSettings:
        """Settings of the study's runs."""
        return self.study.settings

    @cached_property
    def growth(self) -> MapGrowth | None:
        """How results refine the study; None if all its runs are computed."""
        refine = self.study.refine
        return None if refine is None else MapGrowth(self.study, refine)

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the meaning of the job, independent of its name and the form of its text."""
        return fingerprint(self.study)
