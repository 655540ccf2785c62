"""Compilation of the numerical kernels with numba, cached on disk.

numba's own cache looks only at the file of the function it compiled, not at the files of the
functions that were inlined into it, so an edited kernel could go on running in its old form. The
kernels have a cache of their own, which is named after all they are made of: the program text of
every file in `KERNEL_FILES` (comments, docstrings and places in the file do not count), and the
versions of numba and of numpy, which computes the constants that are frozen into them. numba adds
the signature, the processor's name and its features.

It lies under ``$NUMBA_CACHE_DIR`` where that is set, else under ``$XDG_CACHE_HOME/hpcsweep`` or
``~/.cache/hpcsweep``, whatever environment or path the package is installed in. numba's settings
for other packages are left alone. numba writes each entry to a temporary file and renames it into
place, so that many ranks may compile at once: the worst that happens is that work is done
twice. `hpcsweep.campaign.run` lets one rank of each node compile first.
"""

import ast
import functools
import hashlib
import os
from pathlib import Path

import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

from hpcsweep.kernels.twins import plain

PACKAGE = Path(__file__).resolve().parent.parent
KERNEL_FILES = (
    "kernels",
    "model/contact.py",
    "model/equations.py",
    "model/kernel_model.py",
    "solvers/flow",
    "solvers/outcome.py",
    "solvers/reference.py",
)
"""Files and folders of the package of which kernels, and the constants in them, are made."""


def kernel_files(package: Path = PACKAGE, names: tuple[str, ...] = KERNEL_FILES) -> list[Path]:
    """List the files of which kernels are made.

    Raises
    ------
    FileNotFoundError
        If one that is named is not there: a file that was moved would go on running in its old
        form.
    """
    found: list[Path] = []
    for name in names:
        path = package / name
        inside = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        if not inside or not inside[0].is_file():
            raise FileNotFoundError(f"kernels are made of {path}, which is not there")
        found += inside
    return found


def _program_text(path: Path) -> str:
    """Give what a file says to Python: without comments, docstrings and line numbers."""
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [
                line
                for line in body
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ]
    return ast.dump(tree)


@functools.cache
def source_hash() -> str:
    """Hash all that the kernels are made of."""
    digest = hashlib.sha256(f"numba {numba.__version__} numpy {np.__version__}".encode())
    for path in kernel_files():
        digest.update(f"\0{path.relative_to(PACKAGE)}\0{_program_text(path)}".encode())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Give the folder of the compiled kernels."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        root = Path(os.environ["NUMBA_CACHE_DIR"])
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hpcsweep"
    return root / source_hash()


class _Locator(_CacheLocator):
    """Tells numba where a kernel of this package is kept: by module, not by installed path."""

    def __init__(self, py_func, py_file):
        self._py_file = py_file
        module = Path(py_file).resolve()
        inside = module.is_relative_to(PACKAGE)
        self._place = module.relative_to(PACKAGE).with_suffix("") if inside else None
        self._lineno = py_func.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func, py_file):
        """Make a locator; None for functions of other packages, which are not cached here."""
        locator = cls(py_func, py_file)
        return locator if locator._place is not None else None

    def get_cache_path(self):
        """Return the kernel's folder."""
        return str(cache_folder().joinpath(*self._place.parts))

    def get_source_stamp(self):
        """Return what the cache must have been made from."""
        return source_hash()

    def get_disambiguator(self):
        """Return nothing: names are unique in a module."""
        return "kernel"


class _Implementation(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _KernelCache(FunctionCache):
    """numba's cache of one function, in the folder of this package."""

    _impl_class = _Implementation

    def save_overload(self, sig, data):
        """Keep a compiled kernel."""
        Path(self._cache_path).mkdir(parents=True, exist_ok=True)
        super().save_overload(sig, data)


def is_cold() -> bool:
    """Tell whether the kernels have not been compiled yet."""
    return not (numba.config.DISABLE_JIT or any(cache_folder().rglob("*.nbi")))


def _compile(function=None, **options):
    """Compile as `numba.njit` does, and keep the result in the cache of this package.

    With NUMBA_DISABLE_JIT=1 the kernel stays Python: `twins.plain`.
    """
    if function is None:
        return functools.partial(_compile, **options)
    if numba.config.DISABLE_JIT:
        return plain(function)
    dispatcher = numba.njit(error_model="numpy", **options)(function)
    if Path(function.__code__.co_filename).resolve().is_relative_to(PACKAGE):
        dispatcher._cache = _KernelCache(function)
    return dispatcher


jit = functools.partial(_compile, _nrt=True)
"""Compile a kernel: cached, IEEE arithmetic.

No fast-math flag is set. With ``contract`` LLVM fuses products and sums where it happens to inline
them, and a kernel that has just been compiled then differs in the last bit from the same kernel
loaded from the cache. Where a fused operation pays, the kernels ask for it: `fma`.
"""

kernel = functools.partial(_compile, _nrt=False)
"""Compile a kernel that allocates no array and returns none: arrays are not counted.

numba counts the references to each array by atomic operations, which were half of the time of a
forcing period. What allocates is compiled by `jit`, and may be called from a kernel.
"""
inlined = functools.partial(kernel, forceinline=True)
"""Compile a kernel that becomes part of its callers, with their arguments as constants."""
