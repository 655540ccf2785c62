"""Read the rows of ``[vary]``: structures of a portfolio, each with a value of several keys.

A job gives them as tables, or names a CSV file, as a spreadsheet saves it: keys in its first line,
as ``[vary]`` has them, values below as TOML has them, a word without quotes. A loaded job holds the
rows themselves, so that its meaning follows what the file held, and the file is not needed again.
"""

import contextlib
import csv
import tomllib
from collections.abc import Mapping
from pathlib import Path

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
    """Return a job that holds its rows, and the name of the file they are from; '' if of none.

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
    if not isinstance(vary, Mapping) or not isinstance(given := vary.get(ROWS), str):
        return tree, ""
    path = (folder or Path()) / given
    try:
        if path.stat().st_size > MAX_BYTES:
            raise values.error(f"vary.{ROWS}", given, f"must have {MAX_BYTES} bytes at most")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise values.error(f"vary.{ROWS}", given, f"cannot be read: {error.strerror}") from None
    except ValueError:
        raise values.error(f"vary.{ROWS}", given, "must be a CSV file in UTF-8") from None
    rows = _table(text, f"{path}")
    return {**tree, "vary": {**vary, ROWS: rows}}, f"{path}"


def _table(text: str, path: str) -> list[dict]:
    """Return the rows of a CSV file, each by its keys."""
    head = text.partition("\n")[0]
    separator = max(SEPARATORS, key=head.count)
    lines = text.rstrip(f"\r\n {SEPARATORS}").splitlines()
    cells = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
    if len(cells) < FIRST_LINE or len(cells) != len(lines):
        raise JobError(f"{path}: must have a line of keys and a line for each row below it")
    keys = [key.strip() for key in cells[0]]
    for key in keys:
        if not key or keys.count(key) > 1:
            raise JobError(f"{path}: line 1: {key!r} must be the key of one column")
    rows = []
    for line, own in enumerate(cells[1:], FIRST_LINE):
        if len(own) != len(keys):
            raise JobError(
                f"{path}: line {line}: must have {len(keys)} cells as line 1, has {len(own)}"
            )
        row = {key: _value(key, cell.strip()) for key, cell in zip(keys, own, strict=True)}
        for key, value in row.items():
            if value == "" or value != value:
                told = "nan" if value else "empty"
                raise JobError(f"{path}: line {line}, column {key}: must have a value, is {told}")
        rows.append(row)
    return rows


def _value(key: str, cell: str) -> object:
    """Return the value of a cell: as in TOML, or a word."""
    if key == NAME:
        return cell
    word = cell.lower() if cell.lower() in ("true", "false") else cell
    with contextlib.suppress(ValueError):
        value = tomllib.loads(f"x = {word}")["x"]
        if isinstance(value, bool | int | float | str | list):
            return value
    try:
        return float(word)  # .5
    except ValueError:
        return cell
