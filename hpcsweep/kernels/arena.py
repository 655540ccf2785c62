"""Write values of the kernels, even tuples of arrays, into an array of bytes, and read them.

numba unpacks every array argument of a call; values read from one buffer cost nothing to pass. The
arrays themselves lie in it too (`places`). Where kernels are not compiled (`fallback`) a tuple is
passed unchanged.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from hpcsweep.kernels.compile import kernel, specialise
from hpcsweep.kernels.compile.places import Pattern, Shapes, Zeros
from hpcsweep.kernels.simd import fallback


def _place_of(context, builder, signature, arguments, which: int, kind):
    """Return a pointer to a value of type `kind` at the start of the array argument `which`."""
    array = context.make_array(signature.args[which])(context, builder, arguments[which])
    return builder.bitcast(array.data, context.get_value_type(kind).as_pointer())


@intrinsic
def write(typingctx, value, buffer):
    """Write a value into an array of bytes, in the kernels' form; arrays by their addresses."""
    del typingctx

    def generate(context, builder, signature, arguments):
        place = _place_of(context, builder, signature, arguments, 1, signature.args[0])
        builder.store(arguments[0], place, align=8)
        return context.get_dummy_value()

    return types.void(value, buffer), generate


def reader(kind):
    """Return a kernel function that reads a value of a numba type from where it was written.

    Nothing is checked, and nothing is counted: see `kernel`.
    """

    @intrinsic
    def read(typingctx, buffer):
        del typingctx

        def generate(context, builder, signature, arguments):
            place = _place_of(context, builder, signature, arguments, 0, kind)
            value = builder.load(place, align=8)
            return specialise.with_known_sizes(context, builder, kind, value, place)

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


as_long_as = fallback.as_long_as if numba.config.DISABLE_JIT else _as_long_as
"""``as_long_as(array, other)``, kernels only: `array`, whose length is that of `other`.

Nothing is checked. The length of an array read from an arena may be known at compilation
(`specialise`), that of an argument is not.
"""


@kernel
def _write(value, buffer):
    write(value, buffer)


def _form_of(value):
    """Return all that the type of a placed tuple depends on: that of its values and arrays.

    It takes a twentieth of the time of numba's type.
    """
    if isinstance(value, np.ndarray | Zeros):
        return value.dtype, len(value.shape)
    if isinstance(value, tuple):
        return type(value), *map(_form_of, value)
    return type(value)


class Arena:
    """Tuples of one type, packed and read.

    Parameters
    ----------
    example : tuple
        A value of the type.

    Attributes
    ----------
    read : function of kernels
        Reads such a tuple from the buffer into which it was packed.
    """

    def __init__(self, example: tuple):
        self._kind = numba.typeof(Pattern(example, 0).copy()[0])
        self._form: tuple = ()
        self.read = fallback.read if numba.config.DISABLE_JIT else reader(self._kind)

    def specialise(self, shapes: Shapes) -> specialise.Specialisation:
        """Return the specialisation for tuples of these shapes: `shapes_of`."""
        return specialise.Specialisation(self._kind, shapes)

    @cached_property
    def _head(self) -> int:
        """Bytes of such a tuple in the kernels' form: its numbers and array descriptors."""
        context = cpu_target.target_context
        return context.get_abi_sizeof(context.get_value_type(self._kind))

    def pattern(self, value: tuple) -> Pattern:
        """Return a tuple as the pattern of copies that have the same arrays.

        Parameters
        ----------
        value : tuple
            `places.zeros` may stand for an array.

        Raises
        ------
        TypeError
            If the value is of another type, which kernels would misread.
        """
        form, made = _form_of(value), Pattern(value, self._head)
        if form != self._form:
            kind = numba.typeof(made.copy()[0])
            if kind != self._kind:
                raise TypeError(f"the kernels read {self._kind}, not {kind}")
            self._form = form
        return made

    def copy(
        self, pattern: Pattern, change: Callable[[Any], Any] = lambda value: value
    ) -> tuple[Any, np.ndarray]:
        """Copy a tuple into memory from which kernels read it (`places`).

        Parameters
        ----------
        pattern : Pattern
            Of this arena.
        change : callable, optional
            Replaces numbers of the copy.

        Returns
        -------
        value : tuple
            The copy, whose arrays the kernels work on.
        packed : ndarray of bytes
            Argument of the kernels.
        """
        value, packed = pattern.copy()
        value = change(value)
        if numba.config.DISABLE_JIT:
            return value, value
        _write(value, packed)
        return value, packed

    def place(self, value: tuple) -> tuple[Any, np.ndarray]:
        """Copy a tuple like `copy`, once."""
        return self.copy(self.pattern(value))

    def pack(self, value: tuple) -> np.ndarray:
        """Copy like `place`, and return only the argument of the kernels."""
        return self.place(value)[1]
