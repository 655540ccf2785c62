"""Compile the numerical kernels with numba, cached on disk.

A kernel calls another one inlined (`inline`), or through its address (`entry_points`). Both are
compiled as `numba.njit` does, with a cache of their own (`cache`).
"""

import functools

import numba

from hpcsweep.kernels.compile.cache import PACKAGE, KernelCache
from hpcsweep.kernels.compile.inline import KeptDispatcher, KernelDispatcher
from hpcsweep.kernels.simd.fallback import plain


def _compile(function=None, **options):
    """Compile like `numba.njit`, and keep the result in the cache of this package.

    With NUMBA_DISABLE_JIT=1 the kernel stays Python: `fallback.plain`.
    """
    if function is None:
        return functools.partial(_compile, **options)
    if numba.config.DISABLE_JIT:
        return plain(function)
    options = {"error_model": "numpy", **options}
    if function.__module__.partition(".")[0] == PACKAGE.name:
        return KeptDispatcher(function, options, KernelCache)
    return KernelDispatcher(function, options)


jit = functools.partial(_compile, _nrt=True)
"""Compile a kernel: cached, IEEE arithmetic.

No fast-math flag is set. With ``contract`` LLVM fuses products and sums where it happens to inline
them, and a newly compiled kernel then differs in the last bit from the same kernel loaded from the
cache. Where a fused operation pays, kernels use `fma`.
"""

kernel = functools.partial(_compile, _nrt=False)
"""Compile a kernel that allocates no array and returns none: arrays are not counted.

numba counts the references to each array by atomic operations, which were half of the time of a
forcing period. Functions that allocate are compiled by `jit`, and may be called from a kernel.
"""
inlined = functools.partial(kernel, forceinline=True)
"""Compile a kernel that becomes part of its callers, with their arguments as constants.

A plain kernel may be called instead, if it or its caller is long. A `Model` is then passed as 250
words on the stack, which takes 0.1 us: functions of a `Model` called once an event are inlined.
"""
