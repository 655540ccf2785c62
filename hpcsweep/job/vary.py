"""Read the table ``vary`` of a job: keys with several values, each an axis of the study.

A part of the job is the job without the table, with one value of each of its keys. It is a job of
its own: it is validated like any other, and has a text from which it can be run alone.
"""

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hpcsweep.job.job import JobError
from hpcsweep.job.tree import INDEXED, MAX_WORD, TreeError, merge, with_indexed, write_value
from hpcsweep.job.values import RANGE_KEYS, Values
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.grid import RunGrid
from hpcsweep.studies.study import Axis
from hpcsweep.studies.vary import Varied

MAX_PARTS = 100_000
"""Most parts of a job: each is validated before anything is computed."""
TABLES = ("study", "structure", "pounding", "sweep", "solver")
"""Tables whose keys may be varied: all runs must store the same variables."""
NEVER = {
    "study.kind": "must be one and the same of all runs",
    "sweep.omega": "is an axis of every study; give sweep.omega its values",
    "sweep.amplitude": "is an axis of every study; give sweep.amplitude its values",
    "sweep.initial_state": "must be one and the same of all runs",
}
TABLES_WITHIN = ("rayleigh.",)
"""Tables in these whose keys may be varied, too."""
SETS_FREQUENCIES = ("mass", "storey_stiffness", "period")
"""Keys of a building, or of the structure, that change its natural frequencies."""


@dataclass(frozen=True)
class Parts:
    """Factory of the parts of a job; can be sent to other processes.

    Attributes
    ----------
    source : str
        Named in errors.
    tree : mapping
        The job without the table ``vary``.
    axes : tuple of Axis
    read : callable
        Return the study of a job without that table: (source, tree).
    """

    source: str
    tree: Mapping
    axes: tuple[Axis, ...]
    read: Callable[[str, Mapping], RunGrid]

    def __call__(self, place: Place) -> RunGrid:
        """Return the study of a part."""
        return self.read(self.source, self.tree_at(place))

    def tree_at(self, place: Place) -> dict:
        """Return the job of a part."""
        return self._with(zip(self.axes, place, strict=True))

    def tree_as_given(self) -> dict:
        """Return the job with its own values of the keys that are varied, the first of others."""
        return self._with((axis, 0) for axis in self.axes if not _is_given(self.tree, axis.key))

    def _with(self, chosen: Iterable[tuple[Axis, int]]) -> dict:
        """Return the job with values of some keys."""
        tree = dict(self.tree)
        for axis, at in chosen:
            if INDEXED.fullmatch(axis.key):
                tree = with_indexed(tree, axis.key, axis.given[at], self.source)
            else:
                table, _, key = axis.key.partition(".")
                outer, _, inner = key.rpartition(".")
                own = {inner: axis.given[at]}
                tree[table] = merge(tree.get(table, {}), {outer: own} if outer else own)
        return tree


def read_varied(
    values: Values, tree: Mapping, read: Callable[[str, Mapping], RunGrid]
) -> RunGrid | Varied:
    """Read the study of a job at all values of its varied keys.

    Raises
    ------
    JobError
        If a key cannot be varied, or a part is not a valid job.
    """
    if "vary" not in tree:
        return read(values.source, tree)
    given = _flat(values, tree["vary"])
    rest = {key: value for key, value in tree.items() if key != "vary"}
    axes = tuple(_axis(values, key, value) for key, value in given.items())
    n_parts = int(np.prod([len(axis.values) for axis in axes], dtype=object))
    if n_parts > MAX_PARTS:
        raise JobError(f"{values.source}: vary: gives {n_parts} parts, the most are {MAX_PARTS}")
    parts = Parts(values.source, rest, axes, read)
    try:
        base = parts((0,) * len(axes))
    except TreeError as error:
        raise JobError(f"{error}, in vary") from None
    if unused(values, tree):
        # what is given beside vary is not used, but has to be right
        read(values.source, parts.tree_as_given())
    for axis in axes:
        owner, _, name = axis.key.rpartition(".")
        if name in SETS_FREQUENCIES and isinstance(_table(rest, owner).get("rayleigh"), list):
            limit = (
                f"changes the damping ratios that {owner}.rayleigh gives: its alpha and beta "
                "belong to one set of frequencies; give it ratio and modes"
            )
            raise values.error(f"vary.{axis.key}", given[axis.key], limit)
    study = Varied(base, axes, parts)
    for place in itertools.islice(study.places(), 1, None):
        _check_shape(values, study, place)
    return study


def _table(tree: Mapping, owner: str) -> Mapping:
    """Return the table of a key, empty if absent, or one of several as in ``building[0]``."""
    for part in owner.split("."):
        name, _, place = part.rstrip("]").partition("[")
        tree = tree.get(name, {})
        tree = tree[int(place)] if place else tree
    return tree


def _is_given(tree: Mapping, key: str) -> bool:
    """Return whether a job has a value of its own of a varied key."""
    owner, _, name = key.rpartition(".")
    return name in _table(tree, owner)


def unused(values: Values, tree: Mapping) -> tuple[str, ...]:
    """Return a message for each key that is given beside ``vary``."""
    given = _flat(values, tree["vary"]) if "vary" in tree else ()
    used = "[vary] gives its values"
    return tuple(f"not used: {key} ({used})" for key in given if _is_given(tree, key))


def _flat(values: Values, table: object) -> dict[str, object]:
    """Return the keys of the table with their values; ``structure.gap`` needs no quotes."""
    if not isinstance(table, Mapping) or not table:
        raise values.error("vary", table, 'must be a table such as "structure.gap" = [0.5, 1.0]')
    given: dict[str, object] = {}
    for key, value in table.items():
        below = value if isinstance(value, Mapping) and not set(value) & set(RANGE_KEYS) else None
        if below and ("." not in key or f"{key}.".endswith(TABLES_WITHIN)):
            given |= _flat(values, {f"{key}.{name}": one for name, one in below.items()})
        else:
            given[key] = value
    return given


def _axis(values: Values, key: str, given: object) -> Axis:
    table, _, name = key.partition(".")
    indexed = INDEXED.fullmatch(key)
    if indexed:
        table = indexed[1] or indexed[2]
        name = f"{indexed[2]}_{indexed[3]}_{indexed[4].replace('.', '_')}"
    elif name.startswith(TABLES_WITHIN):
        name = name.replace(".", "_")
    is_building = indexed is not None and key.startswith("building[")
    if not (table in TABLES or is_building) or not name or "." in name:
        limit = f"must be a key of {', '.join(TABLES)} or building[0], such as structure.gap"
        raise JobError(f"{values.source}: vary: {key!r}: {limit}")
    if key in NEVER:
        raise values.error(f"vary.{key}", given, NEVER[key])
    listed = _listed(values, f"vary.{key}", given)
    labels = _labels(listed)
    if len(set(labels)) < len(labels):
        raise values.error(f"vary.{key}", given, "must not hold a value twice")
    units = "length" if name.endswith(("gap", "gap_left")) else "1"
    return Axis(name, key, labels, units, listed)


def _listed(values: Values, key: str, given: object) -> tuple[Any, ...]:
    """Return the values of a key as the job of each part has them; each part judges its own."""
    if isinstance(given, Mapping):
        return tuple(values.numbers(key, given, False, MAX_PARTS).tolist())
    listed = given if isinstance(given, list) else [given]
    if not 1 <= len(listed) <= MAX_PARTS:
        raise values.error(key, given, f"must have from 1 to {MAX_PARTS} values")
    for value in listed:
        if not isinstance(value, bool | int | float | str | list) or value != value:
            raise values.error(key, value, "must be numbers, words, true and false, or lists")
        if len(write_value(value)) > MAX_WORD:
            raise values.error(key, value, f"must have {MAX_WORD} characters at most")
    kinds = {type(value) for value in listed}
    return tuple(map(float, listed)) if kinds == {int, float} else tuple(listed)


def _labels(listed: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return values as the file holds them: numbers, or words as they are written in TOML."""
    if {type(value) for value in listed} <= {int, float}:
        return listed
    return tuple(value if isinstance(value, str) else write_value(value) for value in listed)


def _check_shape(values: Values, study: Varied, place: Place) -> None:
    """Refuse a part that cannot share a file with the first."""
    base, part = study.base, study.part(place)
    other = _difference(base, part)
    if other is not None:
        pairs = zip(study.axes, place, strict=True)
        where = ", ".join(f"vary.{axis.key} = {axis.values[at]}" for axis, at in pairs)
        raise JobError(f"{values.source}: {where}: all parts must be of one shape, it {other}")


def _difference(base: RunGrid, part: RunGrid) -> str | None:
    """Return why two parts cannot share a file; None where they can."""
    if part.structure.contact_labels != base.structure.contact_labels:
        return "has other contacts than the first"
    if part.variables != base.variables or part.dimensions != base.dimensions:
        return "has not the dimensions of the first"
    known, own = base.coordinates, part.coordinates
    for name, coordinate in known.items():
        if not _equal(own[name].values, coordinate.values):
            return f"has another {name} than the first"
    for (variable, first), (_, values) in zip(base.given, part.given, strict=True):
        if not _equal(first, values):
            return f"has another {variable.name} than the first"
    return None


def _equal(first: np.ndarray, second: np.ndarray) -> bool:
    """Return whether values of a dimension are the same; NaN, of none, equals NaN."""
    return np.array_equal(first, second, equal_nan=first.dtype.kind == "f")
