"""Compile the numerical kernels with numba, cached on disk.

A kernel calls another one inlined (`inline`), or through its address (`entry_points`). Both are
compiled as ``numba.njit`` does, with a cache of their own (`cache`).
"""

import functools
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.extending import typeof_impl

from hpcsweep.kernels.compile.cache import PACKAGE, KernelCache
from hpcsweep.kernels.compile.inline import KernelDispatcher
from hpcsweep.kernels.simd.fallback import PLAIN, plain


class Kernel:
    """A function that is compiled when it is first called, by Python or by another kernel.

    numba takes 65 us to declare a function, and most of a start's 300 are neither called nor
    compiled, as their callers are loaded from the cache: it is declared only when it is needed.

    Parameters
    ----------
    function : callable
    options : dict
        Of `inline.KernelDispatcher`.
    """

    def __init__(self, function: Callable, options: dict):
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options

    @functools.cached_property
    def cache(self) -> KernelCache | None:
        """Cache of the kernel, if it is one of this package."""
        is_ours = self.py_func.__module__.partition(".")[0] == PACKAGE.name
        return KernelCache(self.py_func) if is_ours else None

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Compiler of the kernel."""
        return KernelDispatcher(self.py_func, self._options, self.cache)

    def __call__(self, *arguments):
        """Call the kernel from Python."""
        return self.dispatcher(*arguments)


@typeof_impl.register(Kernel)
def _type_of(called: Kernel, _context) -> types.Dispatcher:
    return types.Dispatcher(called.dispatcher)


def _compile(function=None, **options):
    """Compile like ``numba.njit``, and keep the result in the cache of this package.

    With NUMBA_DISABLE_JIT=1 the kernel stays Python: `fallback.plain`.
    """
    if function is None:
        return functools.partial(_compile, **options)
    if PLAIN:
        return plain(function)
    # numba would hand `forceinline` down to all that an `inlined` kernel calls
    return Kernel(function, {"error_model": "numpy", "forceinline": False, **options})


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

A plain kernel may be called instead, if it or its caller is long.
"""
