"""Read the rows of ``[vary]``: structures of a portfolio, each with values of several keys.

A job gives them as tables, or names a CSV file, as a spreadsheet saves it: keys in its first line,
as ``[vary]`` has them, values below as TOML has them, a word without quotes. A loaded job holds the
rows themselves, so that its meaning follows what the file held, and the file is not needed again.
"""

import contextlib
import csv
import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from hpcsweep.earthquakes.text_files import decoded, has_commas, read_bytes, with_point
from hpcsweep.job.job import JobError
from hpcsweep.job.values import Values
from hpcsweep.studies.study import ROWS

MAX_BYTES = 2**24
SEPARATORS = ",;\t"
NAME = "name"
"""Column of words that names the rows; without it they are numbered from 1."""
FIRST_LINE = 2
"""Line of the first row."""


def with_rows(values: Values, tree: dict, folder: Path | None) -> tuple[dict, str]:
    """Return a job that holds its rows, and the file they are from, '' without one.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
    folder : Path, optional
        To which the file's path is relative.

    Raises
    ------
    JobError
        If the file cannot be read, or is no table of one value a column and row.
    """
    vary = tree.get("vary")
    if not isinstance(vary, Mapping) or not isinstance(file := vary.get(ROWS), str):
        return tree, ""
    rows, place = read_rows(values, f"vary.{ROWS}", file, folder)
    return {**tree, "vary": {**vary, ROWS: rows}}, place


def read_rows(values: Values, key: str, file: str, folder: Path | None) -> tuple[list[dict], str]:
    """Read the CSV file of a key; return its rows, each by its columns, and where they are from.

    Raises
    ------
    JobError
    """
    path = (folder or Path()) / file
    try:
        text = decoded(read_bytes(path, MAX_BYTES))
    except OSError as error:
        raise values.error(key, file, f"cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise values.error(key, file, str(error)) from None
    head, _, below = text.partition("\n")
    said, place = re.fullmatch(r'"?sep=([,;\t])"?[,;\s]*', head), f"{path}"
    if said:  # as spreadsheets are told it
        text, place = below, f"{path}, below its line sep={said[1]}"
    return _table(text, said[1] if said else max(SEPARATORS, key=head.count), place), place


def _table(text: str, separator: str, path: str) -> list[dict]:
    """Return the rows of a CSV file, each by its keys."""
    lines = text.rstrip(f"\r\n {SEPARATORS}").splitlines()
    try:
        cells = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
    except csv.Error:
        limit = f"every cell must have {csv.field_size_limit()} characters at most"
        raise JobError(f"{path}: {limit}, one has more") from None
    if len(cells) < FIRST_LINE or len(cells) != len(lines) or not cells[0]:
        raise JobError(f"{path}: must have a line of keys and a line for each row below it")
    cells = [[cell.strip() for cell in row] for row in cells]
    if not cells[0][-1] and not any(row[-1] for row in cells if len(row) == len(cells[0])):
        cells = [row[:-1] if len(row) == len(cells[0]) else row for row in cells]
    keys = cells[0]
    for key in keys:
        if not key or keys.count(key) > 1:
            raise JobError(f"{path}: line 1: {key!r} must be the key of one column")
    if keys == [NAME]:
        raise JobError(f"{path}: must have a column of a key beside {NAME}, has none")
    for line, row in enumerate(cells[1:], FIRST_LINE):
        if len(row) != len(keys):
            limit = f"must have {len(keys)} cells as line 1"
            raise JobError(f"{path}: line {line}: {limit}, has {len(row)}")
    rows = [dict(zip(keys, row, strict=True)) for row in cells[1:]]
    if separator != ",":
        rows = _with_points(rows, path)
    return [_values(row, f"{path}: line {k}") for k, row in enumerate(rows, FIRST_LINE)]


def _with_points(rows: list[dict], path: str) -> list[dict]:
    """Return the rows of a table, decimal commas replaced by points."""
    try:
        if not has_commas(cell for row in rows for key, cell in row.items() if key != NAME):
            return rows
    except ValueError as error:
        raise JobError(f"{path}: {error}") from None
    return [{k: cell if k == NAME else with_point(cell) for k, cell in row.items()} for row in rows]


def _values(cells: Mapping[str, str], place: str) -> dict:
    """Return the values of a row."""
    row = {key: _value(key, cell) for key, cell in cells.items()}
    for key, value in row.items():
        if value == "" or value != value:
            fault = "nan" if value else "empty"
            raise JobError(f"{place}, column {key}: must have a value, is {fault}")
    return row


def _value(key: str, cell: str) -> object:
    """Return the value of a cell: as in TOML (most are in JSON, which is faster), or a word."""
    if key == NAME:
        return cell
    word = cell.lower() if cell.lower() in ("true", "false") else cell
    for read in (json.loads, lambda text: tomllib.loads(f"x = {text}")["x"], float):
        with contextlib.suppress(ValueError, RecursionError):
            value = read(word)
            if isinstance(value, bool | int | float | str | list):
                return value
    return cell
