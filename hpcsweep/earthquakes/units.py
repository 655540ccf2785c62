"""Units of acceleration, velocity, length and time, as files and people write them.

A unit is a product of named ones, each with a power: ``cm/s2``, ``cm/s^2``, ``cm/sec/sec``,
``m.s-2``, ``m s**-2``, ``m/s²``, ``in per second squared``, ``%g``, ``milli-g``, ``Gal``. All that
follows a stroke is divided by. Case does not matter. What has another name is no unit.
"""

import re
import unicodedata
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from hpcsweep.model.arguments import positive, refused

STANDARD = Fraction(980665, 100000)
"""One g in m/s^2, by definition."""
STANDARD_GRAVITY = float(STANDARD)
NEAR = 0.02
"""Relative difference between g as people round it, 9.8 or 10, and the standard one."""
OWN, NAMED = NO_UNITS = "structure", "file"
"""Say that values are in the structure's unit as they are, or in the one that each file names."""
UNITS = ("g", "m/s2", "cm/s2", "mm/s2", "in/s2", "ft/s2", *NO_UNITS)
"""Those that messages list; every other spelling is as good."""


class Unit(NamedTuple):
    """A unit: size m^length s^time g^gravity, where g is that of the structure."""

    size: Fraction
    length: int = 0
    time: int = 0
    gravity: int = 0

    @property
    def kind(self) -> str:
        """What is measured in it; empty if nothing that a record has."""
        return KINDS.get(self[1:], "")


KINDS = {
    (0, 0, 1): "acceleration",
    (1, -2, 0): "acceleration",
    (1, -1, 0): "velocity",
    (1, 0, 0): "displacement",
    (0, 1, 0): "time",
    (0, -1, 0): "frequency",
}
BASE = {
    "m metre metres meter meters mtr": Unit(Fraction(1), length=1),
    "dm decimetre decimeter": Unit(Fraction(1, 10), length=1),
    "cm cms centimetre centimetres centimeter centimeters": Unit(Fraction(1, 100), length=1),
    "mm mms millimetre millimetres millimeter millimeters": Unit(Fraction(1, 1000), length=1),
    "um μm micron microns micrometre micrometer": Unit(Fraction(1, 10**6), length=1),
    "km kilometre kilometres kilometer kilometers": Unit(Fraction(1000), length=1),
    "in inch inches": Unit(Fraction(254, 10000), length=1),
    "ft foot feet": Unit(Fraction(3048, 10000), length=1),
    "s sec secs second seconds": Unit(Fraction(1), time=1),
    "ms msec msecs millisecond milliseconds": Unit(Fraction(1, 1000), time=1),
    "us μs usec microsecond microseconds": Unit(Fraction(1, 10**6), time=1),
    "min minute minutes": Unit(Fraction(60), time=1),
    "h hr hour hours": Unit(Fraction(3600), time=1),
    "hz hertz sps": Unit(Fraction(1), time=-1),
    "g gs g's gravity": Unit(Fraction(1), gravity=1),
    "mg mgs": Unit(Fraction(1, 1000), gravity=1),
    "gal gals": Unit(Fraction(1, 100), 1, -2),
    "mgal mgals": Unit(Fraction(1, 10**5), 1, -2),
    "%": Unit(Fraction(1, 100)),
}
BY_NAME = {name: unit for names, unit in BASE.items() for name in names.split()}
WRITTEN = {
    r"[·⋅×]": "*",
    r"[−–]": "-",
    r"[’`´]": "'",
    r"\*\*": "^",
    r"\bper\b": "/",
    r"\s*\bsquared?\b": "^2",
    r"\bpercent(?:age)?\b|\bper ?cent\b": "%",
    r"%\s*of\b": "%",
    r"\b(?:fractions?|multiples|parts|units)\s+of\b": "",
    r"\bmilli[- ]?(?=g)": "m",
    r"\b([cm]?m)ps(?=\d|/)": r"\1/s",
    r"\^\s*\(\s*([-+]?\d)\s*\)": r"^\1",
}
"""Patterns in a unit as it is written, and what stands for them."""
FACTOR = re.compile(r"\s*(/|[*.-]?)\s*(%|[a-zμ]+(?:'s)?)(?:\^?\s?([-+]?\d)(?!\d)|(?!\d))\s*")
MAX_WORDS = 6


def plain(text: str) -> str:
    """Return a text in which units have few spellings."""
    text = unicodedata.normalize("NFKC", text).lower()
    for pattern, by in WRITTEN.items():
        text = re.sub(pattern, by, text)
    return text


@lru_cache(maxsize=1024)
def unit_of(text: str) -> Unit | None:
    """Return the unit that a whole text names, or None."""
    text = re.sub(r"[()\[\]{}]", " ", plain(text)).strip(' \t.,:;"')
    size, powers, sign, at = Fraction(1), [0, 0, 0], 1, 0
    while at < len(text):
        match = FACTOR.match(text, at)
        if match is None or match[2] not in BY_NAME:
            return None
        sign = -1 if match[1] == "/" else sign
        power = sign * int(match[3] or 1)
        named = BY_NAME[match[2]]
        size *= named.size**power
        powers = [old + power * new for old, new in zip(powers, named[1:], strict=True)]
        at = match.end()
    unit = Unit(size, *powers)
    return unit if unit.kind else None


def leading_unit(text: str) -> Unit | None:
    """Return the unit at the beginning of a text: that of as many words as can be."""
    words = plain(text).split()[:MAX_WORDS]
    units = (unit_of(" ".join(words[:n])) for n in range(len(words), 0, -1))
    return next((unit for unit in units if unit), None)


def in_seconds(value: float, unit: Unit) -> float:
    """Return a time in seconds, the nearest number to that written."""
    return float(Fraction(repr(value)) * unit.size)


def acceleration_unit(name: str, value: object) -> Unit:
    """Read an argument that names a unit of acceleration.

    Raises
    ------
    ValueError
    """
    unit = unit_of(value) if isinstance(value, str) else None
    if unit is None or unit.kind != "acceleration":
        raise refused(name, f"one of {', '.join(UNITS)}", value)
    return unit


def standard_gravity(length: str, time: str) -> float | None:
    """Return one g in named units of length and time; None if one is not known."""
    metre, second = _named(length, "displacement"), _named(time, "time")
    return None if metre is None or second is None else float(STANDARD * second**2 / metre)


def in_unit_of_time(seconds: float, time: str) -> float:
    """Return a time in a named unit, the nearest number to that written.

    Raises
    ------
    ValueError
        If the unit is not known.
    """
    size = seconds_in(time) if isinstance(time, str) else None
    if size is None:
        raise refused("time", "a unit of time, such as s or ms", time)
    return in_seconds(seconds, Unit(1 / size))


def seconds_in(time: str) -> Fraction | None:
    """Return the size in seconds of a named unit of time, None if it is not known."""
    return _named(time, "time")


def _named(name: str, kind: str) -> Fraction | None:
    unit = unit_of(name)
    return unit.size if unit is not None and unit.kind == kind else None


def _own_units() -> Iterator[Fraction]:
    """Iterate over units of acceleration that structures may have, in m/s^2."""
    yield STANDARD
    sizes = {kind: {u.size for u in BASE.values() if u.kind == kind} for kind in KINDS.values()}
    yield from (metre / second**2 for metre in sizes["displacement"] for second in sizes["time"])


def factor_of(unit: Unit, name: str, gravity: float) -> float:
    """Return one unit of acceleration in those of a structure in which g is `gravity`.

    A multiple of g is one of `gravity`. Any other unit is converted exactly, by the units of length
    and time in which the standard g is near `gravity`.

    Raises
    ------
    ValueError
        If there are none.
    """
    gravity = positive("gravity", gravity)
    if unit.gravity:
        return float(unit.size) * gravity
    for base in _own_units():
        if abs(gravity * float(base) / STANDARD_GRAVITY - 1.0) <= NEAR:
            return float(unit.size / base)
    limit = f"one g in known units of length and time, as 9.80665 in m and s, to convert {name}"
    raise refused("gravity", limit, gravity)
