"""Kernels called through their address: compiled once for all callers.

Called kernels are usually inlined (`inline`) and optimised and compiled again in each caller, which
pays where the call would cost more than the work. A kernel that works for long in a call is an
entry point: its types are declared, it has one address, and callers read that from a cell that they
know by name. So a caller can be compiled, and cached, before its callees. Where a cold compile took
82 s of processor time, it took 267 s with these inlined as well.

`EntryPoint.load` fills a cell: it compiles the entry point or loads it from the cache. The first
call from Python loads all that the entry point calls (`with_called`), and nothing else. Only one
thread of a process loads at a time (`LOADING`), and others wait until it is done.

Kernels that read an arena may be specialised to its sizes (`specialise`). All that are specialised
alike form a `SpecialisedKernels`: the same entry points, with addresses of their own.
"""

import contextlib
import threading
import types as python_types
from collections.abc import Callable

import numba
import numpy as np
from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.core.typing import signature
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import lower_builtin

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.specialise import Specialisation, compiling, specialised_name
from hpcsweep.kernels.simd.fallback import PLAIN, plain

BYTES = types.uint8[::1]
FLOAT = types.float64
INT = types.int64
BOOL = types.boolean
KEY = types.uint64
VECTOR = types.float64[::1]
MATRIX = types.float64[:, ::1]


LOADING = threading.RLock()
"""Held while kernels are compiled or loaded, so that none is compiled twice."""


def type_of(example):
    """Return the type of a value, for the declaration of an entry point."""
    return numba.typeof(example)


class EntryPoint:
    """A kernel with one address, called by Python and by other kernels.

    Parameters
    ----------
    function : callable
    result
        Type of its result; a tuple of types for a tuple.
    arguments
        Types of its arguments.
    inner : bool
        Whether only kernels call it: the wrapper for calls from Python takes up to a second to
        compile.
    specialises : bool
        Whether it can be specialised to the sizes in an arena.
    on_demand : bool
        Whether it is loaded by whoever needs it, not with its callers: only some structures do.
    """

    def __init__(
        self,
        function: Callable,
        result,
        arguments,
        inner: bool = False,
        specialises: bool = False,
        on_demand: bool = False,
    ):
        self.name = f"{function.__module__}.{function.__qualname__}"
        self.specialises, self.on_demand = specialises, on_demand
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.__module__ = function.__module__
        self.result, self.arguments, self.inner = result, arguments, inner
        result = types.Tuple(result) if isinstance(result, tuple) else result
        self._signature = signature(result, *arguments)
        self._kernel = kernel(function, no_cpython_wrapper=inner)
        self.py_func = function
        self._all_loaded = False
        self._cell = np.zeros(1, np.int64)
        self.symbol = f"address of {self.name}"
        binding.add_symbol(self.symbol, self._cell.ctypes.data)
        self._declare(arguments)

    @property
    def dispatcher(self):
        """Compiler of the kernel."""
        return self._kernel.dispatcher

    def _declare(self, arguments) -> None:
        """Declare the entry point to kernels."""

        class Template(ConcreteTemplate):
            key = self
            cases = [self._signature]  # noqa: RUF012 (so numba wants it)

        infer_global(self, types.Function(Template))
        lower_builtin(self, *arguments)(self._call)
        ALL.append(self)

    specialisation: Specialisation | None = None
    """Specialisation of the entry point."""

    def __call__(self, *arguments):
        """Call the kernel from Python.

        Raises
        ------
        TypeError
            If only kernels can call it.
        """
        if self.inner:
            raise TypeError(f"{self.name} can be called by kernels alone")
        if not self._all_loaded:
            for entry in self._what_is_called():
                entry.load()
            self._all_loaded = True
        return self.dispatcher(*arguments)

    def _what_is_called(self) -> "list[EntryPoint]":
        return with_called(self)

    @property
    def is_loaded(self) -> bool:
        """Whether the kernel has its address."""
        return bool(self._cell[0])

    @property
    def is_kept(self) -> bool:
        """Whether the cache has the kernel."""
        return self._kernel.cache.holds(self._signature, self.dispatcher.targetctx)

    def kept_specialisations(self) -> frozenset[str]:
        """Return the keys of the specialisations that the cache has, for any processor."""
        return self._kernel.cache.specialisations()

    def load(self) -> None:
        """Compile the kernel, or load it from the cache, and publish its address."""
        with LOADING:
            if self.is_loaded:
                return
            with self._compiling():
                self.dispatcher.compile(self._signature)
            compiled = self.dispatcher.overloads[self._signature.args]
            self.dispatcher.disable_compile()
            name = compiled.fndesc.llvm_func_name
            self._cell[0] = compiled.library.get_pointer_to_function(name)

    def _compiling(self) -> contextlib.AbstractContextManager:
        return contextlib.nullcontext()

    def _call(self, context, builder, sig, arguments):
        """Generate a call of the function to which the cell points."""
        convention = context.call_conv
        kind = convention.get_function_type(sig.return_type, sig.args)
        address = ir.IntType(64)
        cell = builder.module.globals.get(self.symbol)
        if cell is None:
            cell = ir.GlobalVariable(builder.module, address, self.symbol)
        function = builder.inttoptr(builder.load(cell), kind.as_pointer())
        status, result = convention.call_function(
            builder, function, sig.return_type, sig.args, arguments
        )
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return result


ALL: list[EntryPoint] = []
"""All entry points of the modules that are imported."""


def with_called(*roots: Callable) -> list[EntryPoint]:
    """Return entry points and all that they call, also through inlined kernels, callees first.

    Those `on_demand` are returned only if they are among the roots. Kernels that stay Python
    (NUMBA_DISABLE_JIT) call none.
    """
    reached = {entry for entry in roots if isinstance(entry, EntryPoint)}
    left = [entry.py_func for entry in reached]
    seen = set(left)
    while left:
        function = left.pop()
        for name in function.__code__.co_names:
            called = function.__globals__.get(name)
            if isinstance(called, EntryPoint):
                if called.on_demand:
                    continue
                reached.add(called)
            inner = getattr(called, "py_func", None)
            if inner is not None and inner not in seen:
                seen.add(inner)
                left.append(inner)
    return [entry for entry in ALL if entry in reached]


class _Specialised(EntryPoint):
    """Entry point specialised to sizes, called by Python and by others of these sizes."""

    def __init__(self, entry: EntryPoint, kernels: "SpecialisedKernels"):
        function, key = entry.py_func, kernels.specialisation.key
        again = python_types.FunctionType(function.__code__, function.__globals__)
        again.__module__, again.__doc__ = function.__module__, function.__doc__
        # names the file of the kernel, and its LLVM function
        again.__qualname__ = specialised_name(function, key)
        self.origin, self.specialisation, self._kernels = entry, kernels.specialisation, kernels
        super().__init__(again, entry.result, entry.arguments, entry.inner, True, entry.on_demand)
        self.__name__ = entry.__name__

    def _declare(self, arguments) -> None:
        """Do nothing: kernels refer to the unspecialised one, see `specialise.rename_addresses`."""

    def _what_is_called(self) -> list[EntryPoint]:
        return self._kernels.of(with_called(self.origin))

    def _compiling(self) -> contextlib.AbstractContextManager:
        return compiling((self._kernels.specialisation, self._kernels.renamed))


class SpecialisedKernels:
    """Entry points specialised to the sizes of one arena.

    Parameters
    ----------
    specialisation : specialise.Specialisation

    Attributes
    ----------
    renamed : dict of str to str
        Symbols of the addresses of specialised ones, by the symbols that they replace.
    """

    def __init__(self, specialisation: Specialisation):
        self.specialisation = specialisation
        self._by_origin = {entry: _Specialised(entry, self) for entry in ALL if entry.specialises}
        self.renamed = {
            entry.symbol: specialised.symbol for entry, specialised in self._by_origin.items()
        }

    def __getitem__(self, entry: EntryPoint) -> EntryPoint:
        """Return a specialised kernel."""
        return self._by_origin[entry]

    def of(self, kernels: list[EntryPoint]) -> list[EntryPoint]:
        """Return the specialised ones of kernels, and those that cannot be specialised."""
        return [self._by_origin.get(entry, entry) for entry in kernels]


def entry_point(result, *arguments, **options: bool):
    """Compile a kernel on its own: ``@entry_point(result, type, ...)``; see `EntryPoint`.

    With NUMBA_DISABLE_JIT=1 the kernel stays Python.
    """

    def decorate(function):
        if PLAIN:
            return plain(function)
        return EntryPoint(function, result, arguments, **options)

    return decorate
