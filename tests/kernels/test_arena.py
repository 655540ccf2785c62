"""Where the arrays of a packing lie."""

import mmap
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.places import (
    LINE,
    Pattern,
    next_place,
    zeros,
)

STATM = Path("/proc/self/statm")


class Inner(NamedTuple):
    flags: np.ndarray
    nothing: np.ndarray


class Value(NamedTuple):
    matrix: np.ndarray
    inner: Inner
    number: float
    last: np.ndarray


def value_of(rows: int, columns: int) -> Value:
    matrix = np.arange(float(rows * columns)).reshape(rows, columns)
    return Value(matrix, Inner(zeros(rows, dtype=bool), zeros(0, columns)), 0.25, zeros(rows))


PACKING = Arena(value_of(1, 1))
read = PACKING.read


@kernel
def filled(packed):
    """Write into the arrays, and read a number."""
    value = read(packed)
    for i in range(value.last.shape[0]):
        value.last[i] = value.matrix[i, 0]
        value.inner.flags[i] = True
    return value.number


@kernel
def last_added_up(packed):
    """Read what `filled` has written."""
    value = read(packed)
    found = 0.0
    for i in range(value.last.shape[0]):
        found += value.last[i]
    return found


@pytest.mark.parametrize("sizes", [(1, 1), (3, 5), (64, 8)])
def test_arrays_lie_behind_each_other_and_begin_with_a_line(sizes):
    given = value_of(*sizes)
    value, memory = Pattern(given).copy()
    # a number is one word, an array its place and its lengths
    head = 8 * (3 + 2 + 3 + 1 + 2)
    assert type(value) is Value
    assert type(value.inner) is Inner
    assert Pattern(value).words == Pattern(given).words
    assert memory.ctypes.data % LINE == 0
    place = next_place(0, head)
    words = memory[:head].view(np.int64)
    for array in (value.matrix, *value.inner, value.last):
        if array.size:
            assert array.ctypes.data - memory.ctypes.data == place
            assert place >= head
            assert place % LINE == 0
        assert array.flags.c_contiguous
        place = next_place(place, array.nbytes)
    assert memory.size == place
    lengths = [words[1:3], words[4:5], words[6:8], words[10:11]]
    arrays = value.matrix, *value.inner, value.last
    assert [tuple(each) for each in lengths] == [array.shape for array in arrays]
    assert np.array_equal(value.matrix, given.matrix)
    assert not np.shares_memory(value.matrix, given.matrix)
    assert not value.last.any()
    assert value.inner.flags.dtype == bool


def test_kernels_work_on_the_arrays_of_the_copy():
    given = value_of(3, 2)
    value, packed = PACKING.place(given)
    value.matrix[2, 0] = 7.0
    assert filled(packed) == 0.25
    assert np.array_equal(value.last, [0.0, 2.0, 7.0])
    assert value.inner.flags.all()
    assert given.matrix[2, 0] == 4.0


def test_what_is_packed_needs_nothing_else_to_be_kept():
    packed = PACKING.pack(value_of(50, 50))
    others = [np.full((50, 50), 9.0) for _ in range(20)]
    assert filled(packed) == 0.25
    assert last_added_up(packed) == sum(range(0, 2500, 50))
    assert len(others) == 20


@pytest.mark.skipif(not STATM.exists(), reason="the system does not tell what is resident")
def test_pages_of_zeros_are_not_touched():
    resident = resident_bytes()
    value, _ = Pattern((zeros(50_000_000),)).copy()
    assert resident_bytes() - resident < 50e6
    assert value[0].nbytes == 400e6


def resident_bytes() -> int:
    return int(STATM.read_text().split()[1]) * mmap.PAGESIZE
