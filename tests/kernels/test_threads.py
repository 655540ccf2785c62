"""Threads of one process: what loads or compiles the kernels first is waited for by the others."""

import numba
import pytest
from tools import kernels_but, python

if numba.config.DISABLE_JIT:
    pytest.skip("nothing is compiled", allow_module_level=True)

FIRST_CALLS = """
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
import numpy as np
import hpcsweep

structure = hpcsweep.Structure(n_floors=2, stiffness_ratio=100.0)
begin = Barrier(4)

def one(k, wait=True):
    if wait:
        begin.wait()
    amplitude = 0.3 + 0.01 * (k // 2)
    if k % 2:
        found = hpcsweep.attractors(structure, amplitude, 0.7, starts=8)
        return [(a.orbit_period, a.hits, a.points.tobytes()) for a in found]
    return hpcsweep.stroboscopic_points(structure, amplitude, 0.7, np.zeros(4), 300).tobytes()

with ThreadPoolExecutor(4) as pool:
    together = list(pool.map(one, range(4)))
assert together == [one(k, False) for k in range(4)]
print("equal")
"""


def test_four_threads_whose_calls_are_the_first_give_what_one_gives():
    assert python(FIRST_CALLS).stdout == "equal\n"


@pytest.mark.slow
def test_four_threads_that_find_kernels_missing_compile_once_and_agree(tmp_path):
    lost = kernels_but(tmp_path, "solvers/flow/layer/passage/passage", "solvers/flow/orbit/chain")
    assert python(FIRST_CALLS, NUMBA_CACHE_DIR=str(tmp_path)).stdout == "equal\n"
    assert lost == 2
