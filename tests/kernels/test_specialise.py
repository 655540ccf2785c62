"""Kernels specialised to the sizes of a packing: the same results, loops and calls of their own."""

from typing import NamedTuple

import numba
import numpy as np
import pytest
from tools import python

from hpcsweep.kernels.arena import Arena, as_long_as
from hpcsweep.kernels.compile import entry_points as rooms
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    VECTOR,
    SpecialisedKernels,
    entry_point,
    with_called,
)
from hpcsweep.kernels.compile.places import Pattern

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)

before = list(rooms.ALL)


class Flags(NamedTuple):
    some: np.ndarray
    none: np.ndarray


class Value(NamedTuple):
    matrix: np.ndarray
    flags: Flags
    number: float


def packed_of(rows: int, columns: int) -> Value:
    """A tuple as kernels share it: an array, a tuple with one that holds no numbers, a number."""
    matrix = 1.0 / (1.0 + np.arange(rows * columns, dtype=float).reshape(rows, columns))
    return Value(matrix, Flags(np.zeros(rows, np.bool_), np.zeros((0, columns))), 0.25)


PACKING = Arena(packed_of(1, 1))
read = PACKING.read


@kernel
def weighted(matrix, x):
    """A part: it is lowered once for all that it is linked into."""
    total = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * x[j]
    return total


@entry_point(FLOAT, BYTES, VECTOR, inner=True, specialises=True)
def leaf(packed, x):
    """Called through its address."""
    value = read(packed)
    flags = value.flags
    x = as_long_as(x, value.matrix[0])
    return weighted(value.matrix, x) * value.number + flags.some.shape[0] + flags.none.shape[0]


@kernel
def between(packed, x):
    """A part that calls an entry point, and reads."""
    return 2.0 * leaf(packed, x) + read(packed).flags.some.shape[0]


@entry_point(FLOAT, FLOAT, inner=True)
def other(x):
    """Cannot be specialised."""
    return x + 1.0


@entry_point(FLOAT, BYTES, VECTOR, specialises=True)
def root(packed, x):
    """Calls `leaf` itself and by a part."""
    return leaf(packed, x) + other(between(packed, x)) + read(packed).matrix.shape[0]


own = [one for one in rooms.ALL if one not in before]
rooms.ALL[:] = before


@pytest.fixture
def specialised(monkeypatch):
    monkeypatch.setattr(rooms, "ALL", own)
    made = {}

    def kernels(value) -> SpecialisedKernels:
        specialisation = PACKING.specialise(words_of(value))
        if specialisation.key not in made:
            made[specialisation.key] = SpecialisedKernels(specialisation)
            for one in made[specialisation.key].of(with_called(root)):
                one.load()
        return made[specialisation.key]

    return kernels


def words_of(value) -> tuple[int, ...]:
    return Pattern(value).words


def expected(value, x) -> float:
    matrix, flags, number = value
    product = sum(matrix[i, j] * x[j] for i in range(len(matrix)) for j in range(len(x)))
    one = product * number + len(flags[0])
    return one + (2.0 * one + len(flags[0]) + 1.0) + len(matrix)


@pytest.mark.parametrize("sizes", [(1, 1), (2, 3), (5, 4)])
def test_results_are_those_of_the_kernels_for_any_size_to_the_last_bit(specialised, sizes):
    for one in own:
        one.load()
    value = packed_of(*sizes)
    packed, x = PACKING.pack(value), np.linspace(0.3, 0.7, sizes[1])
    result = specialised(value)[root](packed, x)
    assert result == root(packed, x)
    assert result == pytest.approx(expected(value, x), rel=1e-13)


def test_sizes_are_constants_of_the_fitted_ones_alone(specialised):
    kernels = specialised(packed_of(2, 3))
    # what is packed is larger: nobody looks
    value = packed_of(5, 4)
    packed, x = PACKING.pack(value), np.linspace(0.3, 0.7, 4)
    assert root(packed, x) == pytest.approx(expected(value, x), rel=1e-13)
    flat = value[0].reshape(-1)[:6].reshape(2, 3)
    less = flat, (np.zeros(2), None), value[2]
    assert kernels[root](packed, x) == pytest.approx(expected(less, x[:3]), rel=1e-13)
    # and the parts that both were linked with are as they were
    assert specialised(value)[root](packed, x) == root(packed, x)


def test_what_cannot_be_fitted_is_shared(specialised):
    kernels = specialised(packed_of(2, 3))
    every = kernels.of(with_called(root))
    assert [one.name for one in every if one.specialisation is None] == [other.name]
    assert all(one.is_loaded for one in every)
    with pytest.raises(KeyError):
        kernels[other]
    with pytest.raises(TypeError, match="can be called by kernels alone"):
        kernels[leaf](np.zeros(1, np.uint8), np.zeros(1))


def test_each_fit_has_its_own_key():
    keys = {PACKING.specialise(words_of(packed_of(i, j))).key for i in (1, 2, 3) for j in (1, 2)}
    assert len(keys) == 6
    assert PACKING.specialise(words_of(packed_of(2, 2))).key in keys


FITTED = """
import sys
import numpy as np
from hpcsweep.kernels.compile import warm
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow import FlowMap
from hpcsweep.solvers.flow import specialised
from hpcsweep.solvers.flow.layer.passage.passage import pass_layer

n = int(sys.argv[1])
solver = FlowMap(Structure(n, 1000.0), 0.5)
needed = specialised.needed_kernels(solver.structure, specialised=True)
needed = [one for one in needed if one.__name__ == pass_layer.__name__]
lost = len(warm.missing(needed))
warm.load_all(needed, lambda done, total: print(done, file=sys.stderr), 2)
print(lost, len(warm.missing(needed)), solver.is_specialised)
"""


@pytest.mark.slow
def test_what_another_process_has_fitted_is_kept(tmp_path):
    def reported(n):
        done = python(FITTED, str(n), NUMBA_CACHE_DIR=str(tmp_path))
        return done.stdout.split(), done.stderr.split()

    assert reported(2) == (["1", "0", "False"], ["0", "1"])
    assert reported(2) == (["0", "0", "False"], [])
    assert reported(1) == (["1", "0", "False"], ["0", "1"])
    names = [path.name for path in tmp_path.rglob("pass_layer*.kernel")]
    assert len(names) == 2
