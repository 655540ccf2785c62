"""One variable of the results, and the values of one dimension."""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

CONTACT_SET = "contact set"


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
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    flags: "type[IntEnum] | str | None" = None

    @property
    def missing(self) -> float:
        """Value where nothing is committed: 0 for integers, NaN for others."""
        return np.nan if np.dtype(self.dtype).kind == "f" else 0

    def along(self, names: tuple[str, ...]) -> "Variable":
        """Return the same variable with further leading dimensions."""
        return replace(self, dims=(*names, *self.dims))


class Coordinate(NamedTuple):
    """Values of a dimension of the results, numbers or (as objects) strings."""

    values: np.ndarray
    units: str
    long_name: str
