"""The operations of `vectors` and of arenas in numpy, for uncompiled kernels.

With NUMBA_DISABLE_JIT=1 a kernel is a plain Python function: a debugger steps through it, coverage
counts its lines, and an index out of bounds is an error. `Lanes` are then arrays of `LANES`
numbers. Results equal those of `instructions` to rounding: a product is rounded before it is added,
sums are in another order, and the exponential is numpy's.
"""

import functools

import numpy as np
from numba import config

from hpcsweep.kernels.simd import LANES

PLAIN: bool = config.DISABLE_JIT  # type: ignore[attr-defined]
"""Whether kernels stay Python."""


def plain(function):
    """Run a kernel as Python with the arithmetic of the compiled one.

    Its arguments, and those of kernels that it calls, become numpy numbers, whose quotients are
    IEEE: 1 / 0 is infinite.
    """

    @functools.wraps(function)
    def called(*arguments, **named):
        with np.errstate(all="ignore"):
            return _ieee(function(*map(_ieee, arguments), **named))

    called.py_func = function  # type: ignore[attr-defined]
    return called


def _ieee(value):
    """Convert Python numbers to numpy numbers, also within a tuple."""
    if isinstance(value, float):
        return np.float64(value)
    if type(value) is tuple:
        return tuple(map(_ieee, value))
    return value


def _flat(array: np.ndarray, index: int, count: int = LANES) -> np.ndarray:
    """Return a view of array[index], array[index + 1], ... of a contiguous array."""
    if not array.flags.c_contiguous:
        raise IndexError("the array is not contiguous: the compiled kernel would misread it")
    last = index + count - 1
    if count and not 0 <= index <= last < array.size:
        raise IndexError(f"{index} to {last} lie beyond an array of {array.size}")
    return array.reshape(-1)[index : last + 1]


def fma(a, b, c):
    """Evaluate a b + c, numbers or `Lanes`; the product is rounded."""
    return a * b + c


def load(array, index):
    """Read array[index:index + LANES] of a contiguous array, flat."""
    return _flat(array, index).copy()


def store(array, index, value):
    """Write array[index:index + LANES] where `load` reads it."""
    _flat(array, index)[:] = value


def local_vector(size):
    """Return an array of what no kernel may read before it has written it."""
    return np.full(size, np.nan)


def local_matrix(rows, columns):
    """Return a matrix of the same."""
    return np.full((rows, columns), np.nan)


def root(value):
    """Return the square roots."""
    return _lanes(np.sqrt(value))


def modulus(value):
    """Return the moduli."""
    return _lanes(np.abs(value))


def greatest(a, b):
    """Return the greater of each two, NaN if one is."""
    return _lanes(np.maximum(a, b))


def _lanes(value):
    return np.broadcast_to(value, LANES).copy()


def total(value):
    """Return the sum."""
    return value.sum()


def maximum(value):
    """Return the greatest, NaN if one is."""
    return value.max()


def negative(value):
    """Return which are negative: the sum of 2^k of those lanes k."""
    return np.int64(np.sum((value < 0.0) * 2 ** np.arange(LANES)))


def first_not_negative(value):
    """Return the first lane that is not negative, `LANES` if all are."""
    return next((k for k, number in enumerate(value) if not number < 0.0), LANES)


def lane(value, index):
    """Return one lane."""
    return value[index]


def shifted(first, value):
    """Prepend a number to the lanes; the last one is dropped."""
    return np.concatenate(([first], value[:-1]))


def combine(out, o, init, i, scale, table, t, stride, x, s, n):
    """Write out[o:] = init[i:] + sum_k table[t + k stride:] (scale x[s + k]), k < n, all flat."""
    value = load(init, i)
    for k, factor in enumerate(_flat(x, s, n)):
        value += load(table, t + k * stride) * (scale * factor)
    store(out, o, value)


def combine_moduli(out, o, init, i, scale, table, t, stride, x, s, n):
    """Write like `combine`, with |x[s + k]|."""
    combine(out, o, init, i, scale, table, t, stride, np.abs(x), s, n)


def switches(y):
    """Evaluate S(y) = 1 / (1 + exp(-y)) without overflow and cancellation."""
    t = np.exp(-np.abs(y))
    return np.where(y >= 0.0, 1.0, t) / (1.0 + t)


def read(packed):
    """Return an unpacked tuple unchanged, with numpy numbers."""
    if isinstance(packed, tuple):
        return type(packed)(*map(read, packed))
    return _ieee(packed)


def as_long_as(array, other):
    """Return an array that is as long as another unchanged."""
    if len(array) != len(other):
        raise IndexError(f"an array of {len(array)} is taken for one of {len(other)}")
    return array
