"""Check arguments: return the value in the form that the callee needs, or raise one line.

An `InputError` states the argument's name, its limit and its shortened value. Numbers from files
and arrays are accepted: those of numpy, and arrays without dimensions.
"""

import math
import os
import re
import reprlib
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, Self, TypeVar

import numpy as np

Kind = TypeVar("Kind")

MAX_COUNT = 10**12
"""Forcing periods, samples: a million periods a second fill eleven days."""
LARGEST = sys.float_info.max
MIN_OMEGA, MAX_OMEGA = 1e-4, 1e6
"""Forcing frequencies."""
MAX_NAME, MAX_PATH = 255, 4095
"""Bytes of a file name, and of one with its folders."""
LONGEST = 60
"""Characters of a value in a message."""


class InputError(ValueError):
    """A value that is refused; the message is one line: ``place: key limit``.

    Parameters
    ----------
    limit : str
        What is said of the value.
    key : str
        What has the value, by its name or names; "" if nothing has.
    place : str
        Where that is, a file or a line of one; "" if it is an argument.
    value : str
        As it is shown between the key and the limit; "" if the limit says it.
    """

    def __init__(self, limit: str, key: str = "", place: str = "", value: str = ""):
        super().__init__(limit, key, place, value)
        self.limit, self.key, self.place, self.value = limit, key, place, value

    def __str__(self) -> str:
        """Return the message."""
        key = f"{self.key} = {self.value}:" if self.value else self.key
        space = " " if key and self.limit[0] not in ":;," else ""
        return f"{self.place}{': ' if self.place else ''}{key}{space}{self.limit}"

    @property
    def table(self) -> str:
        """First part of the key, without its place in a list."""
        return re.split(r"\W", self.key, maxsplit=1)[0]

    def within(self, table: str) -> Self:
        """Name the table of the key: ``gap``, or ``contact.gap``, becomes ``contact[1].gap``."""
        name = self.key.removeprefix(f"{table.partition('[')[0]}.")
        self.key = f"{table}.{name}"
        return self


def wrong(name: str, limit: str) -> InputError:
    """Return the error for an argument that breaks a limit."""
    return InputError(limit, name)


def refused(name: str, limit: str, value: object) -> InputError:
    """Return the error for an argument: what it must be, and what it is."""
    return wrong(name, f"must be {limit}, is {shown(value)}")


def shown(value: object) -> str:
    """Format a value on one line, shortened; very long numbers by their number of digits."""
    if isinstance(value, int) and value.bit_length() > 8 * LONGEST:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of {value.dtype}, shape {value.shape}"
    try:
        text = " ".join(reprlib.repr(value).split())
    except Exception:  # of a foreign class, or with more digits than Python prints
        text = f"a {type(value).__name__}"
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def real(name: str, value: object) -> float:
    """Return a real number in double precision, or NaN.

    Raises
    ------
    ValueError
        ``name must be a number, is value``.
    """
    if isinstance(value, float):
        return float(value)
    scalar = plain(value)
    if isinstance(scalar, bool | np.bool_) or not isinstance(scalar, Real):
        raise refused(name, "a number", value)
    try:
        return float(scalar)
    except OverflowError:
        raise refused(name, "a number of double precision", value) from None


def number(
    name: str,
    value: object,
    limit: str = "a number",
    least: float = -math.inf,
    most: float = math.inf,
) -> float:
    """Return a real number other than NaN, from `least` to `most`.

    Raises
    ------
    ValueError
        ``name must be limit, is value``.
    """
    result = real(name, value)
    if math.isnan(result):
        raise refused(name, "a number", value)
    if not least <= result <= most:
        raise refused(name, limit, result)
    return result


def finite(name: str, value: object) -> float:
    """Return a finite real number."""
    return number(name, value, "finite", -LARGEST, LARGEST)


def positive(name: str, value: object) -> float:
    """Return a finite real number above 0."""
    return number(name, finite(name, value), "finite and positive", math.ulp(0.0))


def forcing_frequency(name: str, value: object) -> float:
    """Return a forcing frequency."""
    return number(name, value, f"from {MIN_OMEGA:g} to {MAX_OMEGA:g}", MIN_OMEGA, MAX_OMEGA)


def not_negative(name: str, value: object) -> float:
    """Return a finite real number of at least 0."""
    return number(name, finite(name, value), "at least 0", 0.0)


def flag(name: str, value: object) -> bool:
    """Return true or false."""
    if not isinstance(value, bool | np.bool_):
        raise refused(name, "true or false", value)
    return bool(value)


def count(name: str, value: object, least: int = 0, most: int = MAX_COUNT) -> int:
    """Return an integer from `least` to `most`; floats are refused, even integral ones.

    Raises
    ------
    ValueError
    """
    if type(value) is int and least <= value <= most:
        return value
    scalar = plain(value)
    whole = isinstance(scalar, Integral) and not isinstance(scalar, bool | np.bool_)
    if not whole or not least <= scalar <= most:
        raise refused(name, f"a whole number from {least} to {most}", value)
    return int(scalar)


def vector(name: str, value: object, size: int) -> np.ndarray:
    """Return a copy of `size` real numbers, possibly NaN or inf; shape (size,).

    Raises
    ------
    ValueError
    """
    if type(value) is np.ndarray and value.shape == (size,) and value.dtype == np.float64:
        return np.array(value)
    result = array(name, value)
    if result.shape != (size,):
        shape = result.shape if result.ndim else shown(value)
        raise wrong(name, f"must have shape ({size},), has shape {shape}")
    return result


def finite_vector(name: str, value: object, size: int) -> np.ndarray:
    """Return a copy of `size` finite numbers, shape (size,).

    Raises
    ------
    ValueError
    """
    result = vector(name, value, size)
    if not np.all(np.isfinite(result)):
        raise refused(name, "finite", value)
    return result


def finite_vectors(name: str, value: Any, size: int) -> np.ndarray:
    """Return vectors of `size` finite numbers, shape (m, size)."""
    listed = items(name, value, f"an array of shape (m, {size})")
    return np.array([finite_vector(name, entries, size) for entries in listed]).reshape(-1, size)


def array(name: str, value: object) -> np.ndarray:
    """Return a copy of an array of real numbers of any shape.

    Raises
    ------
    ValueError
    """
    if np.ma.is_masked(value):
        raise refused(name, "without masked numbers", value)
    try:
        result = np.array(value)
    except Exception:  # rows of different lengths, and errors of foreign classes
        raise refused(name, "an array of numbers", value) from None
    if result.dtype.kind == "O" and result.ndim:  # fractions, integers of any size
        result = np.array([real(name, entry) for entry in result.flat]).reshape(result.shape)
    if result.dtype.kind not in "iuf":
        raise refused(name, "an array of numbers", value)
    return result.astype(float)


def rows(name: str, value: object) -> np.ndarray:
    """Return a two-dimensional array of real numbers; one in double precision is not copied.

    Raises
    ------
    ValueError
    """
    if type(value) is np.ndarray and value.ndim == 2 and value.dtype == np.float64:
        return value
    result = array(name, value)
    if result.ndim != 2:
        raise wrong(name, f"must have two dimensions, has shape {result.shape}")
    return result


def items(name: str, value: Any, limit: str) -> list:
    """Return the items of a sequence or another iterable; text is refused."""
    text = isinstance(value, str | bytes | Mapping)
    if text or not isinstance(value, Iterable) or getattr(value, "shape", None) == ():
        raise refused(name, limit, value)
    return list(value)


def callback(name: str, value: Any) -> Any:
    """Return a function without arguments, or None."""
    if value is not None and not callable(value):
        raise refused(name, "a function without arguments", value)
    return value


def words(name: str, value: object) -> tuple[str, ...]:
    """Return a sequence of strings; a single string is refused.

    Raises
    ------
    ValueError
    """
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise refused(name, "a sequence of texts", value)
    if not all(isinstance(word, str) for word in value):
        raise refused(name, "a sequence of texts", value)
    return tuple(value)


def choice(name: str, value: object, allowed: Collection[str]) -> str:
    """Return one of the known words.

    Raises
    ------
    ValueError
    """
    if not isinstance(value, str) or value not in allowed:
        raise refused(name, f"one of {', '.join(allowed)}", value)
    return value


def instance(name: str, value: object, kind: type[Kind]) -> Kind:
    """Return an instance of a class.

    Raises
    ------
    ValueError
    """
    if not isinstance(value, kind):
        raise refused(name, f"a {kind.__name__}", value)
    return value


def file_name(name: str, value: object) -> str:
    """Return the name of a file, with or without its folders.

    Raises
    ------
    ValueError
        If no file can have it, or a message could not show it on a line.
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str) or not text or any(char < " " for char in text):
        raise refused(name, "a path", value)
    try:
        parts = [len(part) for part in os.fsencode(text).split(os.fsencode(os.sep))]
    except UnicodeError:
        raise refused(name, "a path", value) from None
    if max(parts) > MAX_NAME or sum(parts) + len(parts) > MAX_PATH:
        raise refused(name, f"a path of up to {MAX_PATH} bytes, {MAX_NAME} a part", value)
    return text


def plain(value: Any) -> Any:
    """Return the value of an array without dimensions; anything else unchanged."""
    if getattr(value, "shape", None) != () or np.ma.is_masked(value):
        return value
    return value.item()
