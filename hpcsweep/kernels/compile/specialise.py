"""Kernels specialised to the sizes of the arrays they work on, which are constants to the compiler.

A kernel works on structures of any size: the lengths of its loops are read from the arrays of a
`arena.Arena`. Where they are known when it is compiled, loops of three or six turns become straight
code, sums stay in registers, and what no structure of these sizes needs is left out; a forcing
period takes 0.55 to 0.8 of the time. No product or sum is taken in another order, so the results
are the same to the last bit, and a specialised kernel can take the place of the other anywhere.

While a kernel is specialised (`Specialisation.compiling`), what reads a packing puts the sizes of
`Specialisation.shapes` in the place of those that it reads, and with them the places of all arrays
behind the one address that it is given (`places`); calls of kernels that are specialised themselves
go to these. Both happen in the kernel at hand alone: its parts are lowered once for all (`inline`),
and know no sizes until they are linked into it.
"""

import contextlib
import hashlib
import math
from collections.abc import Iterator

from llvmlite import ir
from numba.core import types

from hpcsweep.kernels.compile.places import Shapes, first_place, next_place

KEY_LENGTH = 12


class Specialisation:
    """The sizes that kernels are specialised to.

    Parameters
    ----------
    kind : numba.types.Type
        Type of the packed tuple.
    shapes : tuple
        `shapes_of` such a tuple.

    Attributes
    ----------
    key : str
        Tells specialises apart, in the names of kernels and of their files too.
    """

    def __init__(self, kind, shapes: Shapes):
        self.kind, self.shapes = kind, shapes
        self.key = hashlib.sha256(repr(shapes).encode()).hexdigest()[:KEY_LENGTH]

    def compiling(self, renamed: dict[str, str]) -> contextlib.AbstractContextManager:
        """Specialise what is compiled meanwhile.

        Parameters
        ----------
        renamed : dict of str to str
            Symbols in the place of those that hold the addresses of kernels.
        """
        return _meanwhile((self, renamed))


def specialised_name(function, key: str) -> str:
    """Name a specialised kernel, for its file and its function of LLVM."""
    return f"{function.__qualname__}_{key}"


_current: tuple[Specialisation, dict[str, str]] | None = None


def unspecialised() -> contextlib.AbstractContextManager:
    """Compile a part of kernels that may be specialised otherwise, or not at all."""
    return _meanwhile(None)


@contextlib.contextmanager
def _meanwhile(current: tuple[Specialisation, dict[str, str]] | None) -> Iterator[None]:
    global _current  # numba compiles under one lock
    before, _current = _current, current
    try:
        yield
    finally:
        _current = before


def rename_addresses(module) -> None:
    """Let a module of LLVM call the kernels that are specialised as it is."""
    if _current is None:
        return
    _, renamed = _current
    for variable in module.global_variables:
        if variable.name in renamed:
            variable.name = renamed[variable.name]


def with_known_sizes(context, builder, kind, value, packed):
    """Put the sizes that are known in the place of those in a value of the kernels.

    The arrays are then found from the address `packed`, at which the value was read.
    """
    if _current is None or _current[0].kind != kind:
        return value
    start = builder.bitcast(packed, ir.IntType(8).as_pointer())
    place = first_place(context.get_abi_sizeof(context.get_value_type(kind)))
    return _with_shapes(context, builder, kind, value, _current[0].shapes, start, place)[0]


def _with_shapes(context, builder, kind, value, shapes: Shapes, start, place: int):
    """Return the value with its sizes, and the place of what follows it."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        word = ir.IntType(64)
        strides = [context.get_abi_sizeof(context.get_data_type(kind.dtype))]
        for length in shapes[:0:-1]:
            strides.insert(0, length * strides[0])
        sizes = ir.ArrayType(word, kind.ndim)
        count, itemsize = math.prod(shapes), strides[-1]
        array.nitems, array.itemsize = word(count), word(itemsize)
        array.shape = sizes([word(length) for length in shapes])
        array.strides = sizes([word(stride) for stride in strides])
        data = builder.gep(start, [word(place)], inbounds=True)
        array.data = builder.bitcast(data, array.data.type)
        return array._getvalue(), next_place(place, count * itemsize)
    if isinstance(kind, types.BaseTuple):
        for at, (inner, known) in enumerate(zip(kind.types, shapes, strict=True)):
            old = builder.extract_value(value, at)
            new, place = _with_shapes(context, builder, inner, old, known, start, place)
            value = builder.insert_value(value, new, at)
    return value, place
