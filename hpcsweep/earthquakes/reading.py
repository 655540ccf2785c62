"""Read ground-motion records: AT2 files of PEER, two columns, one column.

An AT2 file has a header whose last line holds the number of samples and the time between them, in
many spellings (``NPTS=  4000, DT= .01000 SEC``, ``4096    0.0100    NPTS, DT``), and the unit in an
earlier line (``ACCELERATION TIME SERIES IN UNITS OF G``). The values follow row by row, in any
number of columns, which may touch where a value is negative. So NPTS, DT and the unit are searched
for, and numbers are parsed without fixed columns. The count must match the header.

Other formats (SAC, miniSEED, those of national networks) are read by obspy, a package of its own:
``Record(trace.data, trace.stats.delta, trace.id)``.
"""

import re
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hpcsweep.model.arguments import choice, file_name, positive, shown
from hpcsweep.model.record import MAX_SAMPLES, Record

STANDARD_GRAVITY = 9.80665
"""One g in m/s^2, by definition."""
GRAVITY_IN = {
    "g": 1.0,
    "m/s2": STANDARD_GRAVITY,
    "cm/s2": 100 * STANDARD_GRAVITY,
    "mm/s2": 1000 * STANDARD_GRAVITY,
    "in/s2": STANDARD_GRAVITY / 0.0254,
    "ft/s2": STANDARD_GRAVITY / 0.3048,
}
"""One g in each unit that files are in."""
OWN = "structure"
"""Says that values are in the structure's unit as they are."""
UNITS = (*GRAVITY_IN, OWN)
ALIASES = {"gal": "cm/s2", "gals": "cm/s2", "%g": "percent of g"}
MAX_BYTES = 64 * MAX_SAMPLES
"""Of a file: two columns of 30 characters a sample."""
MAX_HEADER = 50
"""Lines among which NPTS is searched for."""
UNEVEN = 0.02
"""Largest deviation of a time from equal steps, in steps: times are written with few digits."""
SAME_STEP = 1e-9
"""Relative difference below which a step is replaced by the nearest short number."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
NUMBERS = re.compile(NUMBER)
NOT_FINITE = re.compile(r"[-+]?(?:nan|inf(?:inity)?)\b", re.IGNORECASE)
COUNT = re.compile(r"NPTS\s*[=:]?\s*(\d+)", re.IGNORECASE)
STEP = re.compile(rf"\bDT\s*[=:]?\s*({NUMBER})", re.IGNORECASE)
HAS_STEP = re.compile(r"\bDT\b", re.IGNORECASE)
UNIT = re.compile(r"\bUNITS?\s*(?:OF|:|=)?\s*\(?\s*([^\s,;()]+)", re.IGNORECASE)
BRACKETED = re.compile(r"[(\[]\s*([^()\[\]]+?)\s*[)\]]")


class Table(NamedTuple):
    """Contents of a file: values in its unit, the step, and the unit if it names one."""

    values: np.ndarray
    dt: float
    unit: str | None


def read_record(
    path: str | PathLike[str],
    unit: str = "g",
    gravity: float = STANDARD_GRAVITY,
    dt: float | None = None,
) -> Record:
    """Read a ground-motion record from a text file.

    The format is detected from the contents: an AT2 file has a line with NPTS and DT; any other
    holds two columns, time and acceleration, at equal steps, or one column of acceleration,
    possibly after header lines. Columns are separated by blanks, tabs, commas or semicolons. The
    first sample is at t = 0 of the record, whatever its time in the file.

    Parameters
    ----------
    path : path
        Path of the file; its name without the ending becomes the record's.
    unit : str
        Unit of the values in the file: ``g``, ``m/s2``, ``cm/s2``, ``mm/s2``, ``in/s2``, ``ft/s2``,
        or ``structure``. A file that names another unit is refused; an AT2 file must name one.
    gravity : float
        One g in the structure's units. The acceleration is ``values * gravity`` in g,
        ``values * gravity / 9.80665`` in m/s^2, and so on in the other units of length;
        with the unit ``structure`` the values are used unchanged.
    dt : float, optional
        Time between two samples: required with one column, otherwise compared with the file's.

    Returns
    -------
    Record

    Raises
    ------
    ValueError
        If the file is not a record; one line states file, item, value and limit.
    OSError
        If it cannot be read.
    """
    choice("unit", unit, UNITS)
    factor = 1.0 if unit == OWN else positive("gravity", gravity) / GRAVITY_IN[unit]
    if dt is not None:
        dt = positive("dt", dt)
    file = Path(file_name("path", path))
    try:
        table = _parse(file, dt)
        if table.unit is not None and unit not in (OWN, table.unit):
            raise ValueError(f"unit must be that of the file, {table.unit}, is {unit}")
        return Record(table.values * factor, table.dt, file.stem)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _parse(file: Path, dt: float | None) -> Table:
    """Parse a file of any format; `dt` if it is known."""
    with file.open("rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise ValueError(f"must have {MAX_BYTES} bytes at most, has more")
    lines = content.decode("utf-8-sig", errors="replace").splitlines()
    if not any(line.strip() for line in lines):
        raise ValueError("must have at least 2 samples, is empty")
    for i, line in enumerate(lines[:MAX_HEADER]):
        if re.search(r"NPTS", line, re.IGNORECASE):
            return _parse_at2(lines, i, dt)
    if file.suffix.lower() == ".at2":
        raise ValueError(f"must name NPTS and DT in its first {MAX_HEADER} lines, does not")
    return _parse_columns(lines, dt)


# AT2


def _parse_at2(lines: list[str], last: int, known: float | None) -> Table:
    """Read an AT2 file whose line `last`, from 0, has NPTS."""
    said = lines[last]
    if not HAS_STEP.search(said) and HAS_STEP.search("".join(lines[last + 1 : last + 2])):
        last += 1
        said = f"{said} {lines[last]}"
    count, dt = _count_and_step(said)
    if count > MAX_SAMPLES:
        raise ValueError(f"NPTS must be from 2 to {MAX_SAMPLES}, is {count}")
    if not dt > 0:
        raise ValueError(f"DT must be above 0, is {dt!r}")
    if known is not None and abs(known - dt) > SAME_STEP * dt:
        raise ValueError(f"dt must be that of the file, {dt!r}, is {known!r}")
    units = [found.group(1) for line in lines[: last + 1] for found in UNIT.finditer(line)]
    if not units:
        raise ValueError("must name its unit before its samples (IN UNITS OF G), does not")
    values = _numbers(lines, last + 1)
    if len(values) != count:
        raise ValueError(f"must have the {count} samples that NPTS says, has {len(values)}")
    return Table(values, dt, _unit(units[-1]))


def _count_and_step(said: str) -> tuple[int, float]:
    """Find NPTS and DT in a header line: after their names, or before or after both of them."""
    count, step = COUNT.search(said), STEP.search(said)
    if count and step:
        return int(count.group(1)), _float(step.group(1))
    before, _, after = re.split(r"(NPTS)", said, maxsplit=1, flags=re.IGNORECASE)
    found = NUMBERS.findall(before)[-2:] or NUMBERS.findall(after)[:2]
    if len(found) != 2 or not found[0].isdigit():
        raise ValueError(f"NPTS and DT must be a count and a time, are {shown(said.strip())}")
    return int(found[0]), _float(found[1])


def _unit(text: str) -> str:
    """Return the name in `GRAVITY_IN` of a unit as written in headers; any other unchanged."""
    plain = text.lower().strip(". ").replace("sec", "s").replace(" ", "")
    plain = re.sub(r"/s(?:/s|\*\*2|\^2|²|\*s)$", "/s2", plain)
    return ALIASES.get(plain, plain)


def _float(text: str) -> float:
    """Read a number, with Fortran's D among the exponents."""
    return float(text.replace("D", "E").replace("d", "e"))


def _numbers(lines: list[str], first: int) -> np.ndarray:
    """Read all numbers from line `first` on, from 0, whether they touch or not."""
    found: list[float] = []
    for i, line in enumerate(lines[first:], first + 1):
        other = NUMBERS.sub("", line).replace(",", "").strip()
        if other:
            what = "finite" if NOT_FINITE.search(line) else "a number"
            raise ValueError(f"every sample must be {what}, line {i} has {shown(other)}")
        found.extend(map(_float, NUMBERS.findall(line)))
    return np.array(found)


# columns


def _parse_columns(lines: list[str], known: float | None) -> Table:
    """Read one column with known step, or two, after a header."""
    if len(lines) > MAX_SAMPLES + MAX_HEADER:
        raise ValueError(f"must have from 2 to {MAX_SAMPLES} samples, has {len(lines)} lines")
    rows = [(i, re.split(r"[\s,;]+", line.strip(" \t,;"))) for i, line in enumerate(lines, 1)]
    rows = [(i, cells) for i, cells in rows if cells != [""]]
    start = next((j for j, (_, cells) in enumerate(rows) if _is_number(cells[0])), len(rows))
    header = [lines[i - 1] for i, _ in rows[:start]]
    table = rows[start:]
    if not table:
        raise ValueError(f"must have at least 2 samples, has none in {len(lines)} lines")
    if len(table) > MAX_SAMPLES:
        raise ValueError(f"must have from 2 to {MAX_SAMPLES} samples, has {len(table)}")
    width = len(table[0][1])
    if width > 2:
        raise ValueError(f"must have one column or two, time and acceleration, has {width}")
    for i, cells in table:
        if len(cells) != width:
            raise ValueError(f"every line must have {width} columns, line {i} has {len(cells)}")
        for cell in cells:
            if not _is_number(cell):
                raise ValueError(f"every sample must be a number, line {i} has {shown(cell)}")
            if NOT_FINITE.fullmatch(cell):
                raise ValueError(f"every sample must be finite, line {i} has {cell}")
    numbers = np.array([[_float(cell) for cell in cells] for _, cells in table])
    unit = _named(header)
    if width == 2:
        return Table(numbers[:, 1], _step(numbers[:, 0], known, table[0][0]), unit)
    if known is None:
        raise ValueError("dt must be given with one column of samples, is None")
    return Table(numbers[:, 0], known, unit)


def _is_number(cell: str) -> bool:
    return bool(NUMBERS.fullmatch(cell) or NOT_FINITE.fullmatch(cell))


def _named(header: list[str]) -> str | None:
    """Return the unit of acceleration that a header names, in brackets or after UNITS OF."""
    for line in reversed(header):
        said = [*UNIT.findall(line), *BRACKETED.findall(line)]
        units = [unit for unit in map(_unit, said) if unit in GRAVITY_IN]
        if units:
            return units[-1]
    return None


def _step(times: np.ndarray, known: float | None, first: int) -> float:
    """Return the step of equidistant times, the first of which is in line `first`."""
    if len(times) < 2:
        raise ValueError(f"must have from 2 to {MAX_SAMPLES} samples, has {len(times)}")
    step = float(times[-1] - times[0]) / (len(times) - 1) if known is None else known
    if not step > 0:
        raise ValueError(f"the time between two samples must be above 0, is {step:.6g}")
    off = np.abs(times - times[0] - step * np.arange(len(times))) / step
    worst = int(off.argmax())
    if off[worst] > UNEVEN:
        raise ValueError(
            f"times must be equal steps of {step:.6g} to {UNEVEN} of a step, "
            f"time {worst + 1}, {times[worst]:.10g}, is off by {off[worst]:.3g}"
        )
    for digits in range(1, 16):
        short = float(f"{step:.{digits}g}")
        if abs(short - step) <= SAME_STEP * step:
            return short
    return step
