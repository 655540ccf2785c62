"""Specialise kernels to the sizes of their arrays, which become constants for the compiler.

A kernel works on structures of any size: it reads the lengths of its loops from the arrays of an
`arena.Arena`. Where they are known at compilation, loops of three or six turns are unrolled, sums
stay in registers, and unused code is removed; a forcing period takes 0.55 to 0.8 of the time. No
product or sum is reordered, so results are equal to the last bit, and a specialised kernel can
replace the other anywhere.

While a kernel is specialised (`Specialisation.compiling`), the reader of an arena substitutes the
sizes of `Specialisation.shapes` for those that it reads, and with them the places of all arrays
behind the one address (`places`); calls of kernels that are also specialised go to these. Both
happen only in the kernel being compiled: its parts are lowered once for all (`inline`), and have no
sizes until they are linked into it.
"""

import contextlib
import hashlib
import math
from collections.abc import Iterator

from llvmlite import ir
from numba.core import types

from hpcsweep.kernels.compile.places import Shapes, next_place

KEY_LENGTH = 12


class Specialisation:
    """Sizes to which kernels are specialised.

    Parameters
    ----------
    kind : numba.types.Type
        Type of the packed tuple.
    shapes : tuple
        `shapes_of` such a tuple.

    Attributes
    ----------
    key : str
        Identifies the specialisation, also in the names of kernels and of their files.
    """

    def __init__(self, kind, shapes: Shapes):
        self.kind, self.shapes = kind, shapes
        self.key = hashlib.sha256(repr(shapes).encode()).hexdigest()[:KEY_LENGTH]

    def compiling(self, renamed: dict[str, str]) -> contextlib.AbstractContextManager:
        """Specialise what is compiled within the context.

        Parameters
        ----------
        renamed : dict of str to str
            Replacements of the symbols that hold the addresses of kernels.
        """
        return _meanwhile((self, renamed))


def specialised_name(function, key: str) -> str:
    """Return the name of a specialised kernel, for its file and its LLVM function."""
    return f"{function.__qualname__}_{key}"


_current: tuple[Specialisation, dict[str, str]] | None = None


def unspecialised() -> contextlib.AbstractContextManager:
    """Compile an inlined part without any specialisation, as kernels share it."""
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
    """Redirect the calls of an LLVM module to kernels with the same specialisation."""
    if _current is None:
        return
    _, renamed = _current
    for variable in module.global_variables:
        if variable.name in renamed:
            variable.name = renamed[variable.name]


def with_known_sizes(context, builder, kind, value, packed):
    """Substitute the known sizes in a value of the kernels.

    The arrays are then located from the address `packed`, at which the value was read.
    """
    if _current is None or _current[0].kind != kind:
        return value
    start = builder.bitcast(packed, ir.IntType(8).as_pointer())
    place = next_place(0, context.get_abi_sizeof(context.get_value_type(kind)))
    return _with_shapes(context, builder, kind, value, _current[0].shapes, start, place)[0]


def _with_shapes(context, builder, kind, value, shapes: Shapes, start, place: int):
    """Return the value with its sizes, and the place behind it."""
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
