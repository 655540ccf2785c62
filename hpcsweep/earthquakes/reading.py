"""Read ground-motion records: header lines, then samples in one column, two, or many.

What the header says is read by `hpcsweep.earthquakes.header`, in many words. If it tells the number
of samples and the time between them, as in AT2 files of PEER, samples follow row by row, in any
number of columns, which may touch where a value is negative. Else there is one column of samples,
or two, of times and samples. What the header says is compared with what follows.

Formats with rules of their own are those of `hpcsweep.earthquakes.formats`. Others (SAC, miniSEED,
those of national networks) are read by obspy, a package of its own:
``Record(trace.data, trace.stats.delta, trace.id)``.
"""

import math
import re
from collections.abc import Iterator
from decimal import Decimal
from os import PathLike
from pathlib import Path

import numpy as np

from hpcsweep.earthquakes import units
from hpcsweep.earthquakes.formats import format_of, read_format
from hpcsweep.earthquakes.header import NUMBERS, SECOND, Header, number, read_header, says
from hpcsweep.earthquakes.text_files import COMMA, decoded, read_bytes
from hpcsweep.model.arguments import file_name, positive, shown
from hpcsweep.model.record import MAX_SAMPLES, Record

MAX_BYTES = 64 * MAX_SAMPLES
"""Of a file: two columns of 30 characters a sample."""
MAX_HEADER = 100
"""Lines among which the number of samples and the time between them are searched for."""
UNEVEN = 0.02
"""Largest deviation of a time from equal steps, in steps: times are written with few digits."""
SAME_STEP = 1e-9
"""Relative difference of two steps that are one."""
SHORT = 3
"""Digits of steps that are tried before those that divide a second."""

NOT_FINITE = re.compile(r"[-+]?\b(?:nan|inf(?:inity)?)\b", re.IGNORECASE)
CLOSING = re.compile(r"\b(?:end|eof)\b", re.IGNORECASE)
COMMENTS = ("#", "%", "!", "//")
SEPARATORS = str.maketrans(',;"', "   ")
Row = tuple[int, list[str]]
"""Number of a line, from 1, and the numbers in it."""


Table = tuple[np.ndarray, float, Header]
"""Contents of a file: values in its unit, the step in seconds, and what the header says."""


def read_record(
    path: str | PathLike[str],
    unit: str = "g",
    gravity: float = units.STANDARD_GRAVITY,
    dt: float | None = None,
    time: str = "s",
    channel: int | None = None,
) -> Record:
    """Read a ground-motion record from a text file.

    After header lines there are two columns, time and acceleration, at equal steps, one column of
    acceleration, or as many samples as the header says, in any number of columns. Columns are
    separated by blanks, tabs, commas or semicolons. Files of K-NET, SMC, COSMOS and CSMIP are read
    by their own rules (`hpcsweep.earthquakes.formats`). The first sample is at t = 0 of the record,
    whatever its time in the file. What the header says of the unit, the number of samples and the
    time between them must agree with the arguments and the samples.

    Parameters
    ----------
    path : path
        Path of the file; its name without the ending becomes the record's.
    unit : str
        Unit of the values in the file, in any spelling: ``g``, ``%g``, ``mg``, ``m/s2``, ``cm/s2``
        or ``gal``, ``mm/s2``, ``in/s2``, ``ft/s2``; or ``structure``. A file that names another
        unit is refused; an AT2 file must name one. With ``file`` every file must.
    gravity : float
        One g in the structure's units. The acceleration is ``values * gravity`` in g. Other units
        are converted exactly, by the units of length and time in which the standard g is `gravity`
        to 2 %: m/s^2 by 1 if it is 9.81 or 9.80665, by 1000 if it is 9806.65, by 1/0.0254 if it is
        386; if it is near none, they are refused. With the unit ``structure`` the values are used
        unchanged.
    dt : float, optional
        Time in seconds between two samples: required where the file does not say it, otherwise
        compared with the file's.
    time : str
        Unit of time of the structure, to which the seconds of the file are converted.
    channel : int, optional
        Which of several channels of acceleration of a COSMOS or CSMIP file, from 1.

    Returns
    -------
    Record

    Raises
    ------
    ValueError
        If the file is not a record; one line states file, item, value and limit.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> lines = ["Somewhere, 1999, in g", "0.00 0.1", "0.01 -0.2", "0.02 0.0"]
    >>> _ = Path("somewhere.txt").write_text(chr(10).join(lines))
    >>> hpcsweep.read_record("somewhere.txt", unit="g")
    Record('somewhere', 3 samples, dt=0.01, peak=1.9613)
    """
    asked = None if unit in units.NO_UNITS else units.acceleration_unit("unit", unit)
    factor = units.factor_of(asked, unit, gravity) if asked else 1.0
    units.in_unit_of_time(1.0, time)
    if dt is not None:
        dt = positive("dt", dt)
    file = Path(file_name("path", path))
    try:
        values, step, header = _parse(file, dt, channel)
        if unit == units.NAMED:
            asked, unit = _named_unit(header)
            factor = units.factor_of(asked, unit, gravity)
        if asked:
            _compare_units(header, asked, unit)
        # of K-NET the ending is the direction
        name = file.name if "K-NET" in header.steps else file.stem
        name += "" if channel is None else f"-{channel}"
        return Record(values * factor, units.in_unit_of_time(step, time), name)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _named_unit(header: Header) -> tuple[units.Unit, str]:
    """Return the unit that a file names."""
    if not header.units and header.unknown is None:
        raise ValueError(f"must name its unit, where unit = {units.NAMED!r}, does not")
    return next(iter(header.units.items()), (units.Unit(units.STANDARD, 1, -2), units.NAMED))


def _compare_units(header: Header, asked: units.Unit, name: str) -> None:
    """Refuse a unit that is not the one that the file names."""
    if header.unknown is not None:
        limit = f"names a unit of acceleration that is not known, {shown(header.unknown)}"
        raise ValueError(f"{limit}: with unit = {units.OWN!r} values are taken as they are")
    for unit, words in header.units.items():
        if unit != asked:
            spellings = (each for each in units.UNITS if units.unit_of(each) == unit)
            said = next(spellings, units.plain(words))
            raise ValueError(f"unit must be that of the file, {said}, is {name}")


def _parse(file: Path, dt: float | None, channel: int | None) -> Table:
    """Parse a file; `dt` if it is known."""
    text = decoded(read_bytes(file, MAX_BYTES))
    if name := format_of(text):
        values, header = read_format(name, text, channel)
        _compare_steps(dt, header.steps)
        return np.array(values), header.steps[name], header
    if channel is not None:
        raise ValueError(f"channel goes with files of several channels, is {channel}")
    lines = text.splitlines()
    while lines and _is_closing(lines[-1]):
        lines.pop()
    if not lines:
        raise ValueError("must have at least 2 samples, is empty")
    if len(lines) > MAX_SAMPLES + MAX_HEADER:
        raise ValueError(f"must have from 2 to {MAX_SAMPLES} samples, has {len(lines)} lines")
    said = [i for i, line in enumerate(lines[:MAX_HEADER]) if _is_words(line) and says(line)]
    least = said[-1] + 1 if said else 0
    is_at2 = any("npts" in lines[i].lower() for i in said)
    first = next((i for i in range(least, len(lines)) if not _is_words(lines[i])), len(lines))
    header = read_header([line for line in lines[:first] if _is_words(line) and line.strip()])
    if is_at2 and not (header.steps and header.counts):
        raise ValueError(
            f"NPTS and DT must be a count and a time, are {shown(lines[said[-1]].strip())}"
        )
    if file.suffix.lower() == ".at2" and not header.counts:
        raise ValueError(f"must name NPTS and DT in its first {MAX_HEADER} lines, does not")
    if is_at2 and not header.units and header.unknown is None:
        raise ValueError("must name its unit before its samples (IN UNITS OF G), does not")
    _refuse_commas(lines[first : first + MAX_HEADER], first + 1)
    rows = _rows(lines, first)
    if not rows and not header.counts:
        raise ValueError(f"must have at least 2 samples, has none in {len(lines)} lines")
    return _table(rows, header, dt)


def _is_closing(line: str) -> bool:
    """Return whether a last line says nothing but that it is the last."""
    return not line.strip("\x1a \t\r") or bool(CLOSING.search(line) and _is_words(line))


def _is_words(line: str) -> bool:
    """Return whether a line is one of a header: words or nothing, no numbers that are damaged."""
    cells = line.translate(SEPARATORS).split()
    is_rule = not re.search(r"\d|\b(?:nan|inf)", line, re.IGNORECASE)
    if not cells or is_rule or cells[0].startswith(COMMENTS):
        return True
    is_number = [bool(NUMBERS.fullmatch(cell) or NOT_FINITE.fullmatch(cell)) for cell in cells]
    if all(is_number) or ("." in cells[0] and is_number[0] and len(cells) == 2 and not says(line)):
        return False
    if re.search(r"[^\W\d_]{2}", NOT_FINITE.sub("", NUMBERS.sub(" ", line))):
        return True
    return not (any(is_number) or cells[0][0] in "+-.0123456789")


def _rows(lines: list[str], first: int) -> list[Row]:
    """Read the numbers of each line from line `first` on, from 0, whether they touch or not."""
    rows: list[Row] = []
    for i, line in enumerate(lines[first:], first + 1):
        other = NUMBERS.sub("", line).translate(SEPARATORS).strip()
        if other:
            what = "finite" if NOT_FINITE.search(line) else "a number"
            raise ValueError(f"every sample must be {what}, line {i} has {shown(other)}")
        if cells := NUMBERS.findall(line):
            rows.append((i, cells))
    return rows


def _refuse_commas(lines: list[str], first: int) -> None:
    """Refuse samples whose decimals are commas, from line `first` on."""
    cells = [re.split(r"[;\s]+", line.strip(" \t;")) for line in lines if line.strip()]
    each = [cell for row in cells for cell in row]
    if each and all(map(COMMA.fullmatch, each)):
        several = any(len(row) > 1 for row in cells)
        if several or any(re.match(r"[-+]?\d*,0\d|[-+]0*,", cell) for cell in each):
            raise ValueError(f"decimals must be points, line {first} has {each[0]}")


def _table(rows: list[Row], header: Header, known: float | None) -> Table:
    """Take the samples from the numbers of lines, and compare them with what is said of them."""
    counts, steps = dict(header.counts), dict(header.steps)
    if not counts:
        rows = _without_count(rows, counts, steps)
    for label, count in counts.items():
        if count > MAX_SAMPLES:
            raise ValueError(f"{label} must be from 2 to {MAX_SAMPLES}, is {count}")
    said = _compare_steps(known, steps)
    total, widths = sum(len(cells) for _, cells in rows), {len(cells) for _, cells in rows}
    has_times = widths == {2} and (
        total not in counts.values() or _are_times(rows, header.time, said)
    )
    n = len(rows) if has_times else total
    for label, count in counts.items():
        if count != n:
            raise ValueError(f"must have the {count} samples that {label} says, has {n}")
    if not counts and len(widths) > 1:
        width = len(rows[0][1])
        i, cells = next(row for row in rows if len(row[1]) != width)
        raise ValueError(f"every line must have {width} columns, line {i} has {len(cells)}")
    if not counts and max(widths) > 2:
        wide = f"has {max(widths)}: each of several components is a record of its own"
        raise ValueError(f"must have one column or two, time and acceleration, {wide}")
    if has_times and header.time is None and _are_numbered(rows):
        if not said:
            first = ", ".join(cells[0] for _, cells in rows[:3])
            raise ValueError(f"dt must be given: the first column, {first}, ..., counts samples")
        rows = [(i, cells[1:]) for i, cells in rows]
    elif has_times:
        dt = _step([cells[0] for _, cells in rows], header.time or SECOND, said)
        return np.array([number(cells[1]) for _, cells in rows]), dt, header
    if not said:
        raise ValueError("dt must be given with one column of samples, is None")
    values = np.array([number(cell) for _, cells in rows for cell in cells])
    return values, next(iter(said.values())), header


def _compare_steps(dt: float | None, steps: dict[str, float]) -> dict[str, float]:
    """Return all steps that are known, which must be one."""
    said = {**({} if dt is None else {"dt": dt}), **steps}
    for label, step in steps.items():
        first, value = next(iter(said.items()))
        if abs(value - step) > SAME_STEP * step:
            raise ValueError(f"{first} must be that of the file, {step!r}, is {value!r} ({label})")
    return said


def _without_count(rows: list[Row], counts: dict, steps: dict) -> list[Row]:
    """Take the number of samples away that stands before them, alone or with their step."""
    (_, first), rest = rows[0], rows[1:]
    widths = {len(cells) for _, cells in rest}
    if not (rest and first[0].isdigit() and (len(first) == 1 or (len(first) == 2 != max(widths)))):
        return rows
    n = int(first[0])
    cells = [cell for _, cells in rest for cell in cells]
    differs = len(first) not in widths or all(re.search("[.eEdD]", cell) for cell in cells)
    if n not in (len(rest), len(cells)) and not (differs and n > 1):
        return rows
    counts["its first line"] = n
    if len(first) == 2:
        steps["its first line"] = number(first[1])
    return rest


def _are_numbered(rows: list[Row]) -> bool:
    """Return whether first numbers are 0, 1, 2, ..., or from another whole number on."""
    first = [cells[0] for _, cells in rows]
    if not all(cell.isdecimal() and len(cell) < 10 for cell in first):
        return False
    counted = [int(cell) - int(first[0]) for cell in first]
    return len(first) > 1 and counted == list(range(len(first)))


def _are_times(rows: list[Row], unit: units.Unit | None, said: dict[str, float]) -> bool:
    """Return whether first numbers rise by the step that is said, as if they were times."""
    times = np.array([number(cells[0]) for _, cells in rows]) * float((unit or SECOND).size)
    return any(np.allclose(np.diff(times), step, rtol=0, atol=0.1 * step) for step in said.values())


def _step(cells: list[str], unit: units.Unit, said: dict[str, float]) -> float:
    """Return the step in seconds of equidistant times in a unit, which must be what is said."""
    n, times = len(cells), np.array(list(map(number, cells)))
    if not 2 <= n <= MAX_SAMPLES:
        raise ValueError(f"must have from 2 to {MAX_SAMPLES} samples, has {n}")
    step = float(times[-1] - times[0]) / (n - 1)
    if not 0 < step < math.inf:
        raise ValueError(f"the time between two samples must be above 0, is {step:.6g}")
    single = np.spacing(np.abs(times).max().astype(np.float32)).astype(float)
    off = np.abs(times - times[0] - step * np.arange(n)) / step
    worst = int(off.argmax())
    if off[worst] > max(UNEVEN, min(single / step, 0.25)):
        raise ValueError(
            f"times must be equal steps of {step:.6g} to {UNEVEN} of a step, "
            f"time {worst + 1}, {times[worst]:.10g}, is off by {off[worst]:.3g}"
        )
    exponents = [Decimal(re.sub("[dD]", "E", cell)).as_tuple().exponent for cell in cells]
    written = max(10.0 ** min(map(int, exponents)), SAME_STEP * step)
    nice, apart = step, UNEVEN * step
    for candidate, within in _steps_near(step, (written, single)):
        if np.abs(times - times[0] - candidate * np.arange(n)).max() <= within:
            nice, apart = candidate, max(within, single)
            break
    nice = units.in_seconds(nice, unit)
    for label, value in said.items():
        if abs(value - nice) * (n - 1) > apart * float(unit.size):
            raise ValueError(f"{label} must be that of the times, {nice!r}, is {value!r}")
    return next(iter(said.values()), nice)


def _steps_near(step: float, within: tuple[float, ...]) -> Iterator[tuple[float, float]]:
    """Iterate over what a step may be if times are rounded: few digits, a part of a second."""
    for limit in within:
        for digits in range(1, 16):
            yield float(f"{step:.{digits}g}"), limit
            if digits == SHORT and 1.0 / step >= 1.0:
                yield 1.0 / round(1.0 / step), limit
