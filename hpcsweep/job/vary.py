"""Read the table ``vary`` of a job: keys with several values, each an axis of the study.

A part of the job is the job without the table, with one value of each of its keys. It is a job of
its own: it is validated like any other, and has a text from which it can be run alone.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hpcsweep.job.job import JobError
from hpcsweep.job.keys import UNITS, bare
from hpcsweep.job.rows import FIRST_LINE, NAME
from hpcsweep.job.table import Table, columns_of
from hpcsweep.job.tree import INDEXED, MAX_WORD, with_value, write_value
from hpcsweep.job.values import RANGE_KEYS, Values
from hpcsweep.model.structure import Structure
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.path_grid import ALONG, FORCING, Followed
from hpcsweep.studies.study import ROWS, Axis, Study
from hpcsweep.studies.variable import Variable
from hpcsweep.studies.vary import Varied, difference, shape_of

Read = Callable[[str, Mapping], Any]
"""Reads the study of a job without a table ``vary``, or else what is wanted: (source, tree)."""
VALUES = (bool, int, float, str, list)
MAX_WRONG = 10
"""Wrong lines of a file that an error tells."""
MAX_PARTS = 100_000
"""Most parts of a job: each is validated before anything is computed."""
STRUCTURAL = ("structure", "pounding")
TABLES = ("study", *STRUCTURAL, "sweep", "solver")
"""Tables whose keys may be varied: all runs must store the same variables."""
NEVER = {
    "study.kind.": "must be the same for all runs",
    "sweep.omega.": "is an axis of every study; give sweep.omega its values",
    "sweep.amplitude.": "is an axis of every study; give sweep.amplitude its values",
    "sweep.initial_state.": "must be the same for all runs",
    "structure.model.": "is not offered: a model is read and reduced once, for all runs",
}
OF_ALL = ("records.", "output.", "units.", "part")
"""Beginnings of keys whose errors are not about a row."""
TABLES_WITHIN = ("rayleigh.",)
"""Tables in these whose keys may be varied, too."""
SHAPE = ("names", "floor_names", "storey_names", "contact_names", "slider_names")
"""What all structures have in common along which one sweep leads."""
SETS_FREQUENCIES = ("mass", "storey_stiffness", "period")
"""Keys of a building, or of the structure, that change its natural frequencies."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Factory of the parts of a job; can be sent to other processes.

    Attributes
    ----------
    source : str
        Named in errors.
    tree : mapping
        The job without the table ``vary``.
    axes : tuple of Axis
    read : Read
    file : str
        Where the rows of the table are from, named in errors; '' if they are the job's.
    """

    source: str
    tree: Mapping
    axes: tuple[Axis, ...]
    read: Read
    file: str = ""

    def __call__(self, place: Place) -> Any:
        """Return what `read` does of a part.

        Raises
        ------
        JobError
            If it is not a valid job; a row is named.
        """
        try:
            return self.read(self.source, self.tree_at(place))
        except JobError as error:
            raise self.error(place, error) from None

    def visit(self, function: Callable[[Place], None], places: Sequence[Place] = ()) -> None:
        """Call a function for each part in order, or for the extreme ones (`Table`).

        Raises
        ------
        JobError
            Of the first part that is refused; other wrong lines of the file of rows are told.
        """
        wrong: dict[str, JobError] = {}
        shape = [len(axis.values) for axis in self.axes]
        each, total = places or np.ndindex(*shape), len(places) or math.prod(shape)
        for place in counted(each, total, "reading structure"):
            try:
                function(place)
            except JobError as error:
                wrong.setdefault(error.line, error)
                if places:
                    self.visit(function)
                if not error.line or len(wrong) == MAX_WRONG:
                    break
        if wrong:
            first, *more = wrong
            wrong[first].limit += f" (and {', '.join(more)})" * bool(more)
            raise wrong[first]

    def error(self, place: Place, error: JobError) -> JobError:
        """Return the error of a part, with the row that it is about if there is one."""
        if error.key.startswith(OF_ALL):
            return error
        for axis, at in zip(self.axes, place, strict=True):
            keys = [k.key for k in axis.columns if re.sub(r"\[\d+\]$", "", k.key) in error.key]
            if axis.columns:
                error.line = f"line {at + FIRST_LINE}" if self.file else ""
                row = error.line or f"vary.{ROWS}[{at}]"
                column = f", column {max(keys, key=len)}" if keys else ""
                error.place = f"{self.file or self.source}: {row}{column}"
        return error

    @property
    def table(self) -> Table:
        """Parts as columns, of which much is known without their structures."""
        return Table(self.tree_at((0,) * len(self.axes)), self.axes)

    def tree_at(self, place: Place) -> dict:
        """Return the job of a part."""
        chosen = zip(self.axes, place, strict=True)
        return self._with((column, at) for axis, at in chosen for column in axis.keys)

    def tree_as_given(self) -> dict:
        """Return the job with its own values of varied keys, or else with their first ones."""
        columns = columns_of(self.axes)
        return self._with((column, 0) for column in columns if not _is_given(self.tree, column.key))

    def _with(self, chosen: Iterable[tuple[Axis, int]]) -> dict:
        """Return the job with values of some keys."""
        tree = dict(self.tree)
        for axis, at in chosen:
            tree = _with_varied(tree, axis.key, axis.given[at], self.source)
        return tree


def parts_of(values: Values, tree: Mapping, read: Read, file: str = "") -> Parts:
    """Return the factory of the parts of a job, in which `read` reads each.

    Raises
    ------
    JobError
        If a key cannot be varied.
    """
    rest = {key: value for key, value in tree.items() if key != "vary"}
    axes: tuple[Axis, ...] = ()
    if "vary" in tree:
        varied = _flat(values, tree["vary"])
        along = values.table("sweep").get("along")
        if isinstance(along, str) and along in varied:  # the steps of a path, no axis
            rest["vary"] = {along: varied.pop(along)}
        axes = _axes(values, varied, file)
    n_parts = int(np.prod([len(axis.values) for axis in axes], dtype=object))
    if n_parts > MAX_PARTS:
        raise JobError(f"{values.source}: vary: gives {n_parts} parts, the most are {MAX_PARTS}")
    keys = [column.key for column in columns_of(axes)]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise JobError(f"{values.source}: vary.{twice[0]}: is in vary.{ROWS}, too")
    return Parts(values.source, rest, axes, read, file)


def _axes(values: Values, varied: Mapping, file: str) -> tuple[Axis, ...]:
    """Read the axes of a flat table; `file` is the origin of their rows."""
    table = Values(file, {}) if file else values
    return tuple(
        _rows(table, value) if key == ROWS else _axis(values, key, value)
        for key, value in varied.items()
    )


def varied_values(values: Values, tree: Mapping) -> dict[str, tuple[Any, ...]]:
    """Return the values of each key that a job varies, also along a path."""
    axes = _axes(values, _flat(values, tree["vary"]), "") if "vary" in tree else ()
    return {column.key: column.given for column in columns_of(axes)}


def read_varied(values: Values, tree: Mapping, read: Read, file: str, is_stored: bool) -> Study:
    """Read the study of a job at all values of its varied keys; `file` is the origin of rows.

    Parts of a stored job were validated before it was stored.

    Raises
    ------
    JobError
        If a key cannot be varied, or a part is not a valid job.
    """
    if "vary" not in tree:
        return read(values.source, tree)
    parts = parts_of(values, tree, read, file)
    if not parts.axes:
        return parts(())
    base = parts((0,) * len(parts.axes))
    if unused(parts.axes, tree):
        # what is given beside vary is not used, but has to be right
        read(values.source, parts.tree_as_given())
    for column in columns_of(parts.axes):
        owner, _, name = column.key.rpartition(".")
        sets = name.split("[")[0] in SETS_FREQUENCIES
        if sets and isinstance(_table(parts.tree, owner).get("rayleigh"), list):
            limit = (
                f"changes the damping ratios that {owner}.rayleigh gives: its alpha and beta "
                "belong to one set of frequencies; give it ratio and modes"
            )
            raise values.error(f"vary.{column.key}", [*column.given], limit)
    study = Varied(base, parts.axes, parts)
    by_part: dict[str, tuple[Variable, np.ndarray]] = {}
    shape_of_first = shape_of(base)

    def compare(place: Place) -> None:
        part = shape_of(study.part(place))
        if why := difference(shape_of_first, part):
            pairs = list(zip(study.axes, place, strict=True))
            where = ", ".join(f"vary.{axis.key} = {axis.values[at]}" for axis, at in pairs)
            limit = f": all parts must be of one shape, it {why}"
            raise parts.error(place, JobError(limit, where, values.source))
        for (variable, first), (_, other) in zip(shape_of_first[-1], part[-1], strict=True):
            if not np.array_equal(first, other):
                whole = np.broadcast_to(first, (*study.shape, *first.shape))
                along = variable.along(study.names)
                by_part.setdefault(variable.name, (along, whole.copy()))[1][place] = other

    table = parts.table
    known_by_part = table.by_part(base)
    if known_by_part is None or not is_stored:
        parts.visit(compare, () if known_by_part is None else table.telling(base))
    return replace(study, by_part=by_part if known_by_part is None else known_by_part)


def read_followed(
    values: Values, tree: Mapping, structure_of: Callable[[Mapping], Structure]
) -> Followed | None:
    """Read the key along which a path leads; None where that is the frequency or the amplitude.

    Parameters
    ----------
    values : Values
    tree : mapping
        The job, its values of the key in ``vary``.
    structure_of : callable
        Return the structure of a job.

    Raises
    ------
    JobError
        If there is no such key, or structures along it cannot share a file.
    """
    key = values.get("sweep.along", ALONG.default)
    if key in (*FORCING,):
        return None
    if not isinstance(key, str) or not key.startswith(("structure.", "pounding.", "building[")):
        limit = f"must be {', '.join(FORCING)} or a key of structure, pounding or building[0]"
        raise values.error("sweep.along", key, limit)
    if (content := values.table("vary").get(key)) is None:
        limit = f'needs its values: [vary] "{key}" = {{from = ..., to = ..., count = ...}}'
        raise values.error("sweep.along", key, limit)
    steps = values.numbers(f"vary.{key}", content, ascending=True, most=MAX_PARTS)
    axis = _axis(values, key, steps.tolist())
    structures: list[Structure] = []
    for step in steps.tolist():
        structures.append(structure_of(_with_varied(tree, key, step, values.source)))
        if any(getattr(structures[-1], name) != getattr(structures[0], name) for name in SHAPE):
            limit = "must leave the structure the floors, contacts and heights that it has before"
            raise values.error(f"vary.{key}", step, limit)
    return Followed(axis.name, key, axis.units, steps, tuple(structures))


def _with_varied(tree: Mapping, key: str, value: object, source: str) -> dict:
    """Return a job with a value of a key that it varies."""
    try:
        return with_value(tree, key, value, source)
    except JobError as error:
        error.limit += ", in vary"
        raise


def _table(tree: Mapping, owner: str) -> Mapping:
    """Return the table of a key, empty if absent, or one of several as in ``building[0]``."""
    for part in owner.split("."):
        name, _, place = part.rstrip("]").partition("[")
        tree = tree.get(name, {})
        tree = tree[int(place)] if place else tree
    return tree


def _is_given(tree: Mapping, key: str) -> bool:
    """Return whether a job gives a varied key its own value, too."""
    owner, _, name = key.rpartition(".")
    return name in _table(tree, owner)


def unused(axes: Iterable[Axis], tree: Mapping) -> tuple[str, ...]:
    """Return a message for each key that is given beside ``vary``."""
    keys = (column.key for column in columns_of(axes))
    return tuple(f"not used: {k} ([vary] gives its values)" for k in keys if _is_given(tree, k))


def _flat(values: Values, table: object) -> dict[str, object]:
    """Return the keys of the table with their values; ``structure.gap`` needs no quotes."""
    if not isinstance(table, Mapping) or not table:
        raise values.error("vary", table, 'must be a table such as "structure.gap" = [0.5, 1.0]')
    flat: dict[str, Any] = {}
    for key, value in table.items():
        below = value if isinstance(value, dict) and not set(value) & set(RANGE_KEYS) else None
        if below and ("." not in key or f"{key}.".endswith(TABLES_WITHIN)):
            flat |= _flat(values, {f"{key}.{name}": content for name, content in below.items()})
        else:
            flat[key] = value
    return flat


def _rows(values: Values, tables: Any) -> Axis:
    """Read keys that vary together, a table of their values for each row."""
    key = f"vary.{ROWS}"
    is_list = isinstance(tables, list) and all(isinstance(row, Mapping) for row in tables)
    if not is_list or not tables:
        raise values.error(key, tables, "must be the name of a CSV file, or tables of keys")
    rows = [_flat(values, row) for row in tables]
    for at, row in enumerate(rows):
        if row.keys() != rows[0].keys():
            raise values.error(f"{key}[{at}]", [*row], f"must have the keys {', '.join(rows[0])}")
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    labels: tuple = tuple(range(1, len(rows) + 1))
    if NAME in columns:
        labels = tuple(map(str, _listed(values, NAME, columns.pop(NAME), True)[0]))
    if len(set(labels)) < len(labels):
        raise values.error(f"{key}.{NAME}", [*labels], "must not hold a value twice")
    varied = tuple(_axis(values, name, column, together=True) for name, column in columns.items())
    return Axis("structure", ROWS, labels, "1", labels, varied)


def _axis(values: Values, key: str, content: object, together: bool = False) -> Axis:
    """Read a key with its values: an axis, or `together` with others a column of rows."""
    table, _, name = key.partition(".")
    if indexed := INDEXED.fullmatch(key):
        table = key.partition("[")[0].partition(".")[0]
        name = "_".join(re.findall(r"\w+", key.removeprefix(f"{table}.")))
    elif name.startswith(TABLES_WITHIN):
        name = name.replace(".", "_")
    is_building = indexed is not None and key.startswith("building[")
    for beginning, limit in NEVER.items():
        if f"{key}.".startswith(beginning):
            raise values.error(f"vary.{key}", content, limit)
    if not (table in TABLES or is_building) or not name or "." in name:
        limit = f"{key!r}: must be a key of {', '.join(TABLES)} or building[0], as structure.gap"
        raise JobError(f"{values.source}: vary: {limit}")
    listed, labels = _listed(values, key, content, together)
    if len(set(labels)) < len(labels) and not together:
        raise values.error(f"vary.{key}", content, "must not hold a value twice")
    units = UNITS.get(bare(key), "1") if table in STRUCTURAL or is_building else "1"
    return Axis(name, key, labels, units, listed)


def _listed(values: Values, key: str, content: object, together: bool) -> tuple[tuple, tuple]:
    """Return the values of a key as the parts have them, and as files do: numbers, or TOML."""
    if isinstance(content, Mapping):
        numbers = tuple(values.numbers(f"vary.{key}", content, False, MAX_PARTS).tolist())
        return numbers, numbers
    listed = content if isinstance(content, list) else [content]
    if not 1 <= len(listed) <= MAX_PARTS:
        raise values.error(f"vary.{key}", content, f"must have from 1 to {MAX_PARTS} values")
    labels: list[Any] = []
    for at, value in enumerate(listed):
        limit, text = "", value
        if not isinstance(value, VALUES) or value != value:
            limit = "must be numbers, words, true and false, or lists"
        elif isinstance(value, str) and not value.isprintable():
            limit = "must be of characters that can be printed"
        elif not isinstance(value, float):
            text = write_value(value)
            limit = f"must have {MAX_WORD} characters at most" * (len(text) > MAX_WORD)
        if limit:
            where = f"vary.{ROWS}[{at}], column {key}" if together else f"vary.{key}"
            raise values.error(where, value, limit)
        labels.append(value if isinstance(value, str) else text)
    kinds = {type(value) for value in listed}
    if kinds <= {int, float}:
        numbers = tuple(map(float, listed)) if len(kinds) > 1 else tuple(listed)
        return numbers, numbers
    return tuple(listed), tuple(x if isinstance(x, str) else write_value(x) for x in labels)
