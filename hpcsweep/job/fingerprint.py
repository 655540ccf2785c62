"""The fingerprint of a job: a hash of what it means.

It tells the file of one job from that of another, and is the seed of all checksums in it. What the
first version of the layout knew is hashed in its order (`Study.meaning`). Every other field of the
study, its structure and its settings counts where it differs from its default, so that a new field
changes the jobs that use it and leaves the files of all others theirs.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass

import numpy as np

from hpcsweep.studies.kinds import DEFAULT_KIND

MEANING_VERSION = 1
"""Part of the fingerprint; raised when the same job text comes to mean other results."""


def fingerprint(study) -> str:
    """Hash what a study means."""
    listed, arrays, covered = study.meaning()
    meaning = [MEANING_VERSION, *listed]
    if study.kind != DEFAULT_KIND:
        meaning.append(("kind", study.kind))
    for part in (study.structure, study.settings, study):
        for field in fields(part):
            value = getattr(part, field.name)
            if field.name not in covered and not _is_default(field, value):
                meaning.append((field.name, _canonical(value)))
    digest = hashlib.sha256(repr(meaning).encode())
    for array in arrays:
        digest.update(str(array.size).encode())
        digest.update(array.astype("<f8").tobytes())
    return digest.hexdigest()


def _is_default(field: Field, value: object) -> bool:
    """Return whether a field has its default; one without a default never has."""
    if field.default_factory is not MISSING:
        return bool(value == field.default_factory())
    return field.default is not MISSING and bool(value == field.default)


def _canonical(value: object) -> object:
    """Write a value so that equal ones are written equally, to the last bit.

    Raises
    ------
    TypeError
        If it is of a kind that has no such form: a field must not be left out silently.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, [_canonical(v) for v in value.ravel().tolist()]]
    if isinstance(value, frozenset | set):
        return sorted(value)
    if isinstance(value, tuple | list):
        return [_canonical(item) for item in value]
    if isinstance(value, Mapping):
        return sorted((key, _canonical(item)) for key, item in value.items())
    if is_dataclass(value):
        return [(f.name, _canonical(getattr(value, f.name))) for f in fields(value)]
    raise TypeError(f"a {type(value).__name__} has no place in a job's fingerprint")
