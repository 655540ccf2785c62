"""Places of the arrays of an arena: in one piece of memory, behind its values.

Each place follows from the sizes of the arrays before it. So a kernel specialised to the sizes
(`specialise`) knows all places from one address: none has to be read or stored, and arrays are
known not to overlap.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

LINE = 64
"""Alignment of arrays, that of cache lines: a vector across two lines takes two accesses, as would
all of an unaligned array. One line is left free behind each array: with arrays at distances of
4096 bytes, as their sizes alone would give, reading one waits for writes to the other (3 to 6 % of
a forcing period, measured)."""


@dataclass(frozen=True)
class Zeros:
    """Request for an array of zeros; pages of memory are touched on first use."""

    shape: tuple[int, ...]
    dtype: np.dtype

    @property
    def nbytes(self) -> int:
        """Bytes of the array."""
        return math.prod(self.shape) * self.dtype.itemsize


def zeros(*shape: int, dtype=float) -> Any:
    """Return a request for an array of zeros in a tuple to be packed."""
    return Zeros(shape, np.dtype(dtype))


Shapes = tuple


def shapes_of(value) -> Shapes:
    """Return the shapes of the arrays in a tuple of tuples and arrays; () for a number."""
    if isinstance(value, np.ndarray | Zeros):
        return value.shape
    if isinstance(value, tuple):
        return tuple(map(shapes_of, value))
    return ()


def first_place(n_bytes: int) -> int:
    """Return the place of the first array behind `n_bytes` of values."""
    return next_place(0, n_bytes)


def next_place(place: int, n_bytes: int) -> int:
    """Return the place behind an array of `n_bytes`."""
    return place + -(-n_bytes // LINE) * LINE + LINE


def with_arrays(value, change: Callable[[np.ndarray | Zeros], np.ndarray]):
    """Return such a tuple with its arrays changed, in order."""
    if isinstance(value, np.ndarray | Zeros):
        return change(value)
    if not isinstance(value, tuple):
        return value
    changed = [with_arrays(one, change) for one in value]
    return type(value)(*changed) if hasattr(value, "_fields") else tuple(changed)


def apart(array: np.ndarray | Zeros) -> np.ndarray:
    """Copy an array into memory of its own."""
    return np.zeros(array.shape, array.dtype) if isinstance(array, Zeros) else array.copy()


def in_one_piece(value, head: int) -> tuple[Any, np.ndarray]:
    """Copy a tuple so that its arrays lie in one piece of memory, behind `head` bytes.

    Returns
    -------
    value : tuple
        Its arrays are views.
    memory : ndarray of bytes
        Aligned to a cache line.
    """
    places = [first_place(head)]

    def add(array: np.ndarray | Zeros) -> np.ndarray | Zeros:
        places.append(next_place(places[-1], array.nbytes))
        return array

    with_arrays(value, add)
    size = places[-1]
    raw = np.zeros(size + LINE, np.uint8)
    first = -raw.ctypes.data % LINE
    memory, at = raw[first : first + size], iter(places)

    def view(array: np.ndarray | Zeros) -> np.ndarray:
        made: np.ndarray = np.ndarray(array.shape, array.dtype, memory, next(at))
        if isinstance(array, np.ndarray):
            made[...] = array
        return made

    return with_arrays(value, view), memory
