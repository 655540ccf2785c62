"""Values of the kernels, tuples of arrays too, written into an array of bytes and read from it.

numba looks into every array of a call; what is read from one buffer costs nothing to hand over.
Where kernels are not compiled (`twins`) a tuple is handed over as it is.
"""

import numba
import numpy as np
from numba.core import types
from numba.extending import intrinsic

from hpcsweep.kernels import fitting, twins
from hpcsweep.kernels.compile import jit, kernel

_INDEX = types.intp


@intrinsic
def size_of(typingctx, value):
    """Count the bytes of a value as the kernels hold it."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del builder, arguments
        size = context.get_abi_sizeof(context.get_value_type(signature.args[0]))
        return context.get_constant(_INDEX, size)

    return _INDEX(value), generate


def _place_of(context, builder, signature, arguments, which: int, kind):
    """Point at a value of type `kind` at the start of the array that is argument `which`."""
    array = context.make_array(signature.args[which])(context, builder, arguments[which])
    return builder.bitcast(array.data, context.get_value_type(kind).as_pointer())


@intrinsic
def write(typingctx, value, buffer):
    """Write a value into an array of bytes, as the kernels hold it; arrays by their addresses."""
    del typingctx

    def generate(context, builder, signature, arguments):
        place = _place_of(context, builder, signature, arguments, 1, signature.args[0])
        builder.store(arguments[0], place, align=8)
        return context.get_dummy_value()

    return types.void(value, buffer), generate


def reader(kind):
    """Make the function of kernels that reads a value of a type of numba from where it was written.

    Nothing is checked, and nothing is counted: see `kernel`.
    """

    @intrinsic
    def read(typingctx, buffer):
        del typingctx

        def generate(context, builder, signature, arguments):
            place = _place_of(context, builder, signature, arguments, 0, kind)
            value = builder.load(place, align=8)
            return fitting.with_known_sizes(context, builder, kind, value)

        return kind(buffer), generate

    return read


@intrinsic
def _as_long_as(typingctx, array, other):
    del typingctx

    def generate(context, builder, signature, arguments):
        ours, its = (
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
        )
        length = builder.extract_value(its.shape, 0)
        ours.shape = builder.insert_value(ours.shape, length, 0)
        return ours._getvalue()

    return array(array, other), generate


as_long_as = twins.as_long_as if numba.config.DISABLE_JIT else _as_long_as
"""``as_long_as(array, other)``, kernels only: `array`, whose length is that of `other`.

Nothing is checked. The length of an array that was read from a packing may be known when a kernel
is compiled (`fitting`), that of an argument is not.
"""


@jit
def _size(value):
    return size_of(value)


@kernel
def _write(value, buffer):
    write(value, buffer)


class Packing:
    """Tuples of one type, packed and read.

    Parameters
    ----------
    example : tuple
        Any value of the type.

    Attributes
    ----------
    read : function of kernels
        Reads such a tuple from the buffer it was packed into.
    """

    def __init__(self, example: tuple):
        self._kind = numba.typeof(example)
        self.read = twins.read if numba.config.DISABLE_JIT else reader(self._kind)

    def fit(self, shapes: fitting.Shapes) -> fitting.Fit:
        """Tell what kernels are to be fitted to for tuples of these shapes, see `shapes_of`."""
        return fitting.Fit(self._kind, shapes)

    def pack(self, value: tuple) -> np.ndarray | tuple:
        """Write a tuple into a buffer for the kernels.

        The buffer holds addresses: it is good as long as `value` is kept.

        Raises
        ------
        TypeError
            If the value is of another type: the kernels would read nonsense.
        """
        kind = numba.typeof(value)
        if kind != self._kind:
            raise TypeError(f"the kernels read {self._kind}, not {kind}")
        if numba.config.DISABLE_JIT:
            return value
        buffer = np.zeros(_size(value), np.uint8)
        _write(value, buffer)
        return buffer
