"""Vectors of eight doubles, one register of 64 bytes, as numbers of the kernels.

Sums, products and quotients are written like those of numbers; `load` and `store` access arrays. In
compiled kernels these operations are LLVM instructions (`instructions`). With
NUMBA_DISABLE_JIT=1 they are numpy functions (`fallback`), the kernels run as plain Python, and an
index out of bounds is an error.
"""

from typing import Any

from hpcsweep.kernels.simd import LANES as LANES
from hpcsweep.kernels.simd import fallback, instructions

_operations: Any = fallback if fallback.PLAIN else instructions

combine = _operations.combine
combine_moduli = _operations.combine_moduli
first_not_negative = _operations.first_not_negative
fma = _operations.fma
greatest = _operations.greatest
lane = _operations.lane
load = _operations.load
local_matrix = _operations.local_matrix
local_vector = _operations.local_vector
maximum = _operations.maximum
modulus = _operations.modulus
negative = _operations.negative
root = _operations.root
shifted = _operations.shifted
store = _operations.store
switches = _operations.switches
total = _operations.total
