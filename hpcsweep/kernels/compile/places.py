"""Places of the arrays of an arena: in one piece of memory, behind its values.

Each place follows from the sizes of the arrays before it. So a kernel specialised to the sizes
(`specialise`) knows all places from one address: none has to be read or stored, and arrays are
known not to overlap.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

LINE = 64
"""Alignment of arrays, that of cache lines: a vector across two lines takes two accesses, as would
all of an unaligned array. One line is left free behind each array: with arrays at distances of
4096 bytes, as their sizes alone would give, reading one waits for writes to the other (3 to 6 % of
a forcing period, measured)."""


@dataclass(frozen=True)
class Zeros:
    """Request for an array of zeros; pages of memory are touched on first use.

    The default of a field of a named tuple declares its array; names in its shape are of `sizes`.
    """

    shape: tuple[int | str, ...]
    dtype: np.dtype

    @property
    def nbytes(self) -> int:
        """Bytes of the array."""
        return math.prod(map(int, self.shape)) * self.dtype.itemsize


def zeros(*shape: int | str, dtype=float) -> Any:
    """Return a request for an array of zeros in a tuple to be packed."""
    return Zeros(shape, np.dtype(dtype))


def part(kind: type) -> Any:
    """Declare, as a default, a field that is a tuple of such declarations itself."""
    return kind


def allocate(kind: Any, sizes: dict[str, int], **given) -> Any:
    """Return a named tuple of a kind with the arrays that its defaults declare.

    Parameters
    ----------
    kind : type
    sizes : dict
        Lengths by the names that declared shapes have for them.
    **given
        Fields that are not as declared.
    """
    for name, declared in kind._field_defaults.items():
        if name in given:
            continue
        if isinstance(declared, Zeros):
            shape = (sizes[size] if isinstance(size, str) else size for size in declared.shape)
            given[name] = Zeros(tuple(shape), declared.dtype)
        elif isinstance(declared, type):
            given[name] = allocate(declared, sizes)
    return kind(**given)


Shapes = tuple


def shapes_of(value) -> Shapes:
    """Return the shapes of the arrays in a tuple of tuples and arrays; () for a number."""
    if isinstance(value, np.ndarray | Zeros):
        return value.shape
    if isinstance(value, tuple):
        return tuple(map(shapes_of, value))
    return ()


def next_place(place: int, n_bytes: int) -> int:
    """Return the place behind `n_bytes` of an array, or of the values at place 0."""
    return place + -(-n_bytes // LINE) * LINE + LINE


def _maker(value, arrays: list) -> Callable[[Iterator], Any]:
    """Append the arrays of such a value; return what makes it from others, in order."""
    if isinstance(value, np.ndarray | Zeros):
        arrays.append(value)
        return next
    if not isinstance(value, tuple):
        return lambda _: value
    parts = [_maker(one, arrays) for one in value]
    make = type(value)._make if hasattr(value, "_fields") else tuple
    return lambda others: make([part(others) for part in parts])


class Pattern:
    """A tuple of which copies are made whose arrays lie in one piece of memory.

    Parameters
    ----------
    value : tuple
        `zeros` may stand for an array.
    head : int
        Bytes before the arrays.
    """

    def __init__(self, value: tuple, head: int):
        arrays: list[np.ndarray | Zeros] = []
        self._value, self._make = value, _maker(value, arrays)
        self._given = [
            (index, array.copy())
            for index, array in enumerate(arrays)
            if isinstance(array, np.ndarray)
        ]
        self._places, self._size = [], next_place(0, head)
        for array in arrays:
            self._places.append((array.shape, array.dtype, self._size))
            self._size = next_place(self._size, array.nbytes)

    @cached_property
    def shapes(self) -> Shapes:
        """Shapes of the arrays: `shapes_of`."""
        return shapes_of(self._value)

    def copy(self) -> tuple[Any, np.ndarray]:
        """Return a copy.

        Returns
        -------
        value : tuple
            Its arrays are views.
        memory : ndarray of bytes
            Aligned to a cache line.
        """
        raw = np.zeros(self._size + LINE, np.uint8)
        first = -raw.ctypes.data % LINE
        memory = raw[first : first + self._size]
        views = [np.ndarray(shape, kind, memory, place) for shape, kind, place in self._places]
        for index, array in self._given:
            views[index][...] = array
        return self._make(iter(views)), memory
