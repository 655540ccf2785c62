"""Kernels that are parts of others: which of them are linked, and in which order."""

import pytest
from numba import config

from hpcsweep.kernels.compile import kernel

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


@kernel
def last(x):
    return 3.0 * x


@kernel
def never_calls_it(x):
    if len((x, x)) > 2:
        # a call for numba, none for LLVM, which knows the length
        return last(x)
    return x


@kernel
def calls_it(x):
    return last(x) + 1.0


@kernel
def first(x):
    return 2.0 * calls_it(x)


@kernel
def whole(x):
    return first(x) + never_calls_it(x)


def test_a_part_is_linked_after_all_that_call_it():
    # where a part came before its callers it was left out, as nothing asked for it yet
    assert whole(1.0) == 9.0
