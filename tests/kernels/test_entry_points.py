"""Kernels called through their address, and kernels that are parts of others."""

import subprocess
import sys

import numba
import numpy as np
import pytest
from tools import environment

from hpcsweep.kernels.compile import entry_points as rooms
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import FLOAT, INT, VECTOR, entry_point

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)

before = list(rooms.ALL)


@kernel
def part(x):
    """A part of what calls it."""
    return 3.0 * x + 0.125


@inlined
def inlined_part(x):
    """A part of what calls it, and not a function there."""
    return part(x) - 1.0


@entry_point((FLOAT, INT), VECTOR, INT)
def work(x, k):
    """Called through its address."""
    if k < 0:
        raise ValueError("negative")
    x[k] = inlined_part(x[k])
    return x[k], k + 1


@entry_point(FLOAT, VECTOR)
def caller(x):
    """Calls `work` for each entry, the first one last."""
    last = 0.0
    k = 1
    while k < x.shape[0]:
        last, k = work(x, k)
    return last + work(x, 0)[0]


@entry_point(INT, VECTOR, INT)
def fails(x, k):
    """Raise what `work` raises."""
    return work(x, k)[1]


@entry_point(FLOAT, FLOAT, inner=True)
def inner(x):
    """Has no entry for Python."""
    return 2.0 * x


@entry_point(FLOAT, FLOAT)
def around(x):
    """Calls what only kernels call."""
    return inner(x) + 1.0


own = [one for one in rooms.ALL if one not in before]
rooms.ALL[:] = before


@pytest.fixture
def loaded():
    # the caller first: it does not need what it calls to be compiled
    for one in reversed(own):
        one.load()


def test_only_kernels_call_an_inner_kernel(loaded):
    assert around(3.0) == 7.0
    with pytest.raises(TypeError, match=r"inner can be called by kernels alone"):
        inner(3.0)


def test_a_kernel_calls_another_through_its_address(loaded):
    x = np.array([1.0, 2.0, 4.0])
    assert caller(x) == (3.0 * 4.0 - 0.875) + (3.0 * 1.0 - 0.875)
    assert x.tolist() == [2.125, 5.125, 11.125]
    assert work(x, 0) == (3.0 * 2.125 - 0.875, 1)


def functions(one) -> str:
    """Return the names of the functions in the machine code of an entry point."""
    (text,) = one.dispatcher.inspect_llvm().values()
    return " ".join(line for line in text.splitlines() if line.startswith("define"))


def test_what_is_separate_is_in_its_callers_no_second_time(loaded):
    assert "work" in functions(work)
    assert "caller" in functions(caller)
    assert "work" not in functions(caller)


def test_parts_are_not_compiled_alone(loaded):
    assert part.dispatcher.signatures == inlined_part.dispatcher.signatures == []
    assert part(1.0) == 3.125
    assert part.dispatcher.signatures == [(numba.float64,)]


def test_other_functions_of_numba_may_call_kernels(loaded):
    @numba.njit
    def outer(x):
        return inlined_part(x[0]) + caller(x)

    assert outer(np.array([1.0])) == 2.125 + 2.125


def test_errors_pass_through(loaded):
    with pytest.raises(ValueError, match="negative"):
        fails(np.zeros(1), -1)


def test_other_types_than_declared_are_refused(loaded):
    with pytest.raises(TypeError):
        caller(np.zeros((2, 2)))


def test_separate_kernels_are_python_where_nothing_is_compiled():
    code = (
        "from hpcsweep.kernels.compile.entry_points import ALL, FLOAT, entry_point\n"
        "@entry_point(FLOAT, FLOAT)\n"
        "def half(x):\n"
        "    return x / 2.0\n"
        "assert half(3.0) == 1.5\n"
        "assert half.py_func(5.0) == 2.5\n"
        "assert ALL == []\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=environment(NUMBA_DISABLE_JIT="1"))
