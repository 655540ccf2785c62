"""Places of the arrays of an arena: in one piece of memory, behind its words.

The words come first, one for each number and, for each array, its place and its lengths. Each place
follows from the sizes of the arrays before it. So a kernel specialised to the sizes (`specialise`)
knows all places from one address: none has to be read, and arrays are known not to overlap.
"""

import math
from collections.abc import Callable, Iterator
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


def allocate(kind: Any, sizes: dict[str, int], **fields) -> Any:
    """Return a named tuple of a kind with the arrays that its defaults declare.

    Parameters
    ----------
    kind : type
    sizes : dict
        Lengths by the names that declared shapes have for them.
    **fields
        Fields that are not as declared.
    """
    for name, declared in kind._field_defaults.items():
        if name in fields:
            continue
        if isinstance(declared, Zeros):
            shape = (sizes[size] if isinstance(size, str) else size for size in declared.shape)
            fields[name] = Zeros(tuple(shape), declared.dtype)
        elif isinstance(declared, type):
            fields[name] = allocate(declared, sizes)
    return kind(**fields)


def next_place(place: int, n_bytes: int) -> int:
    """Return the place behind `n_bytes` of an array, or of the words at place 0."""
    return place + -(-n_bytes // LINE) * LINE + LINE


def _leaves(value) -> Iterator[Any]:
    """Yield the arrays and the numbers of a tuple of such, in order."""
    if isinstance(value, tuple):
        for field in value:
            yield from _leaves(field)
    else:
        yield value


def _maker(value) -> Callable[[Iterator], Any]:
    """Return what makes such a value from other arrays, in order."""
    if isinstance(value, np.ndarray | Zeros):
        return next
    if not isinstance(value, tuple):
        return lambda _: value
    parts = [_maker(field) for field in value]
    make: Any = getattr(type(value), "_make", tuple)
    return lambda others: make([part(others) for part in parts])


Words = tuple[int, ...]
"""Of each array its place and its lengths, of each number 0."""


class Pattern:
    """A tuple of which copies are made whose arrays lie in one piece of memory.

    Parameters
    ----------
    value : tuple
        `zeros` may stand for an array.

    Attributes
    ----------
    words : Words
    """

    def __init__(self, value: tuple):
        self._make = _maker(value)
        leaves = list(_leaves(value))
        sizes = [1 + len(leaf.shape) if hasattr(leaf, "shape") else 1 for leaf in leaves]
        words: list[int] = []
        self._arrays: list[tuple] = []
        self._given: list[tuple] = []
        self._numbers: list[tuple] = []
        place = next_place(0, 8 * sum(sizes))
        for index, leaf in enumerate(leaves):
            if not isinstance(leaf, np.ndarray | Zeros):
                self._numbers.append((index, len(words)))
                words.append(0)
                continue
            if isinstance(leaf, np.ndarray):
                self._given.append((len(self._arrays), leaf.copy()))
            self._arrays.append((leaf.shape, leaf.dtype, place))
            words += [place, *leaf.shape]
            place = next_place(place, leaf.nbytes)
        self.words, self._size = tuple(words), place

    def copy(self) -> tuple[Any, np.ndarray]:
        """Return a copy.

        Returns
        -------
        value : tuple
            Its arrays are views.
        memory : ndarray of bytes
            Aligned to a cache line; numbers are not written.
        """
        raw = np.zeros(self._size + LINE, np.uint8)
        first = -raw.ctypes.data % LINE
        memory = raw[first : first + self._size]
        self._integers(memory)[:] = self.words
        views = [np.ndarray(shape, kind, memory, place) for shape, kind, place in self._arrays]
        for index, array in self._given:
            views[index][...] = array
        return self._make(iter(views)), memory

    def _integers(self, memory: np.ndarray) -> np.ndarray:
        return memory[: 8 * len(self.words)].view(np.int64)

    def write_numbers(self, value: tuple, memory: np.ndarray) -> None:
        """Write the numbers of a copy into its memory."""
        leaves, integers = list(_leaves(value)), self._integers(memory)
        reals = integers.view(np.float64)
        for index, at in self._numbers:
            number = leaves[index]
            (reals if isinstance(number, float) else integers)[at] = number
