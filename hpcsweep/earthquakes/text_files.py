"""Read files that other programs wrote: regular ones of a limited size, in any encoding.

Where semicolons or tabs part the cells of a table, decimals may be commas: then points are
thousands, as in ``1.234,5``. A table in which ``200.000`` may be either is refused.
"""

import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path

COMMA = re.compile(r"[-+]?(?:\d{1,3}(?:\.\d{3})+|\d*),\d+(?:[eEdD][-+]?\d+)?")
POINT = re.compile(r"[-+]?\d*\.\d*(?:[eEdD][-+]?\d+)?")
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:\.\d{3})+")
"""Numbers with a decimal comma, with a point, and with points that may be thousands."""


def read_bytes(path: Path, most: int) -> bytes:
    """Return the content of a regular file of `most` bytes at most.

    Raises
    ------
    ValueError
        If it is a folder, pipe or device, which might never end, or larger.
    OSError
        If it cannot be read.
    """
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # which waits for nobody to write
    try:
        if not stat.S_ISREG(os.fstat(number).st_mode):
            raise ValueError("must be a regular file, is a folder, a pipe or a device")
        with os.fdopen(os.dup(number), "rb") as file:
            content = file.read(most + 1)
    finally:
        os.close(number)
    if len(content) > most:
        raise ValueError(f"must have {most} bytes at most, has more")
    return content


def decoded(content: bytes) -> str:
    """Decode a text: UTF-8, UTF-16 with its mark, or else one byte a character.

    Raises
    ------
    ValueError
        If it is no text.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
    if "\0" in text:
        raise ValueError("must be a text, has bytes of 0")
    return text


def has_commas(cells: Iterable[str]) -> bool:
    """Return whether the decimals of a table are commas; other separators part its cells.

    Raises
    ------
    ValueError
        If some are commas and others points, or numbers may be either.
    """
    commas = points = either = ""
    for cell in cells:
        if "," in cell:
            commas = commas or cell * bool(COMMA.fullmatch(cell))
        elif "." in cell and not points:
            if THOUSANDS.fullmatch(cell):
                either = either or cell
            elif POINT.fullmatch(cell):
                points = cell
    if commas and points:
        raise ValueError(f"must have decimal points or decimal commas, has {points} and {commas}")
    if either and not commas and not points:
        whole, plain = either.replace(".", ""), float(either) if either.count(".") == 1 else 0
        remedy = f"write {whole}" + f", or {plain}" * bool(plain)
        raise ValueError(f"{either} may be {whole} or a decimal: {remedy}")
    return bool(commas)


def with_point(cell: str) -> str:
    """Return a number of a table with decimal commas with a decimal point; others unchanged."""
    if COMMA.fullmatch(cell) or THOUSANDS.fullmatch(cell):
        return cell.replace(".", "").replace(",", ".")
    return cell
