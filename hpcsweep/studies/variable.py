"""One variable of the results, and the values of one dimension."""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

CONTACT_SET = "contact set"
Limits = tuple[float, float]
LARGEST = float(np.finfo(float).max)
FINITE, SIZE = (-LARGEST, LARGEST), (0.0, LARGEST)
COUNT, POSITIVE = (0, np.inf), (1, np.inf)
SHARE = (0.0, 1.0 + 1e-9)
"""A mean of shares exceeds 1 by rounding."""
BELOW_INFINITY = (-np.inf, LARGEST)
EITHER = (0, 1)
RULES = {
    FINITE: "is finite",
    SIZE: "is finite and not negative",
    COUNT: "is at least 0",
    POSITIVE: "is at least 1",
    SHARE: "lies between 0 and 1",
    BELOW_INFINITY: "is not +inf",
    EITHER: "is 0 or 1",
}
"""Limits in words."""
MISSING, VALID, ANY = "missing", "valid", "any"


@dataclass(frozen=True)
class Variable:
    """One variable of the results.

    Attributes
    ----------
    name : str
    dims : tuple of str
    dtype : str
    units, long_name : str
    flags : type[IntEnum] or str, optional
        What its numbers mean: an enumeration, or `CONTACT_SET`, a bit for each contact.
    limits : (float, float), optional
        Least and largest valid value, of `RULES`; None: what is valid depends on other variables.
        Codes are those of `flags` but 0, which is valid where there are limits.
    optional : bool
        Whether it may be missing in a complete run.
    failed : str
        What a failed run has: the `MISSING` value, a `VALID` one, or `ANY`.
    by_part : bool
        Whether it is known beforehand, and parts of a job may differ in it.
    label : str
        What figures call it, without its unit.
    tallied : bool
        Whether summaries tell the largest value.
    source : str
        Name of the values in what solvers return, if another.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    flags: "type[IntEnum] | str | None" = None
    limits: Limits | None = None
    optional: bool = False
    failed: str = MISSING
    by_part: bool = False
    label: str = ""
    tallied: bool = False
    source: str = ""

    @property
    def missing(self) -> float:
        """Value where nothing is committed: 0 for integers, NaN for others."""
        return np.nan if np.dtype(self.dtype).kind == "f" else 0

    def of(self, solved: Any) -> Any:
        """Return its values of what a solver has returned."""
        return getattr(solved, self.source or self.name)

    def along(self, names: tuple[str, ...]) -> "Variable":
        """Return the same variable with further leading dimensions."""
        return replace(self, dims=(*names, *self.dims))


def real(
    name: str, dims: tuple[str, ...], units: str, long_name: str, limits=SIZE, **rules: Any
) -> Variable:
    """Return a variable of real numbers, by default sizes."""
    return Variable(name, dims, "<f8", units, long_name, limits=limits, **rules)


def count(
    name: str, dims: tuple[str, ...], long_name: str, units: str = "1", limits=COUNT, **rules: Any
) -> Variable:
    """Return a variable of whole numbers, by default counts."""
    return Variable(name, dims, "<i4", units, long_name, limits=limits, **rules)


def code(
    name: str, dims: tuple[str, ...], flags: type[IntEnum], long_name: str, **rules: Any
) -> Variable:
    """Return a variable of the numbers of an enumeration."""
    return Variable(name, dims, "<i1", "1", long_name, flags, **rules)


def contacts(
    name: str, dims: tuple[str, ...], long_name: str = "contact set, bit k - 1 for contact k"
) -> Variable:
    """Return a variable of sets of contacts."""
    return Variable(name, dims, "<u8", "1", long_name, CONTACT_SET)


class Coordinate(NamedTuple):
    """Values of a dimension of the results, numbers or (as objects) strings."""

    values: np.ndarray
    units: str
    long_name: str
