"""Place named tuples of numbers and arrays, nested, in an array of bytes that kernels read.

numba unpacks every array argument of a call, and passes a tuple by its values: the 250 of a
structure would be copied into every call, typed and optimised away in every kernel. Kernels see a
placed tuple as a `View` of three addresses, and read a field where they use it. The values do not
change while a kernel runs (``invariant.load``), so that the compiler reads each once, or never
where it knows the sizes (`specialise`). Where kernels are not compiled (`fallback`) a tuple is
passed unchanged.
"""

import hashlib
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, lower_getattr_generic, models, register_model

from hpcsweep.kernels.compile import specialise
from hpcsweep.kernels.compile.places import Pattern, Words, Zeros
from hpcsweep.kernels.simd import fallback

WORD = ir.IntType(64)


class View(types.Type):
    """A placed named tuple, as kernels see it.

    Parameters
    ----------
    kind : numba.types.NamedTuple
        Type of the tuple.

    Attributes
    ----------
    fields : dict
        Type of each field, and its first word.
    """

    def __init__(self, kind):
        self.fields, at = {}, 0
        for name, inner in zip(kind.fields, kind.types, strict=True):
            part = View(inner) if isinstance(inner, types.BaseTuple) else inner
            self.fields[name] = part, at
            at += getattr(part, "n_words", 1 + getattr(inner, "ndim", 0))
        self.n_words = at
        # short: it is part of the name of every function that such a view is passed to
        digest = hashlib.sha256(str(kind).encode()).hexdigest()[:12]
        super().__init__(f"view_{kind.instance_class.__name__}_{digest}")


@register_model(View)
class _ViewModel(models.StructModel):
    """Addresses: of the memory, of the words in which the numbers are, and of those of arrays."""

    def __init__(self, manager, kind):
        fields = [(name, types.voidptr) for name in ("memory", "numbers", "at")]
        super().__init__(manager, kind, fields)


@infer_getattr
class _ViewFields(AttributeTemplate):
    key = View

    def generic_resolve(self, value, attr):  # type: ignore[override]
        """Return the type of a field."""
        return value.fields[attr][0] if attr in value.fields else None


@lower_getattr_generic(View)
def _read_field(context, builder, kind, value, name):
    """Generate what reads a field."""
    from numba.np.arrayobj import populate_array  # only what compiles needs it

    inner, first = kind.fields[name]
    view = cgutils.create_struct_proxy(kind)(context, builder, value=value)

    def word(address, at: int, form=WORD):
        place = builder.gep(address, [WORD(8 * at)], inbounds=True)
        read = builder.load(builder.bitcast(place, form.as_pointer()), align=8)
        read.set_metadata("invariant.load", builder.module.add_metadata([]))
        return read

    if isinstance(inner, View):
        part = cgutils.create_struct_proxy(inner)(context, builder)
        part.memory = view.memory
        part.numbers = builder.gep(view.numbers, [WORD(8 * first)], inbounds=True)
        part.at = builder.gep(view.at, [WORD(8 * first)], inbounds=True)
        return part._getvalue()
    if isinstance(inner, types.Array):
        shape = [word(view.at, first + 1 + axis) for axis in range(inner.ndim)]
        form = context.get_data_type(inner.dtype)
        itemsize = context.get_constant(types.intp, context.get_abi_sizeof(form))
        strides = [itemsize]
        for length in shape[:0:-1]:
            strides.insert(0, builder.mul(length, strides[0], flags=["nsw"]))
        data = builder.gep(view.memory, [word(view.at, first)], inbounds=True)
        array = context.make_array(inner)(context, builder)
        data = builder.bitcast(data, form.as_pointer())
        return populate_array(array, data, shape, strides, itemsize, None)._getvalue()
    if inner == types.boolean:
        return builder.icmp_signed("!=", word(view.numbers, first), WORD(0))
    return word(view.numbers, first, context.get_value_type(inner))


def reader(seen: View):
    """Return a kernel function that reads a placed named tuple as a view."""

    @intrinsic
    def read(typingctx, buffer):
        del typingctx

        def generate(context, builder, signature, arguments):
            array = context.make_array(signature.args[0])(context, builder, arguments[0])
            view = cgutils.create_struct_proxy(seen)(context, builder)
            view.memory = view.numbers = builder.bitcast(array.data, cgutils.voidptr_t)
            view.at = specialise.ask_words(builder, seen.name, view.memory)
            return view._getvalue()

        return seen(buffer), generate

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


as_long_as: Any = fallback.as_long_as if fallback.PLAIN else _as_long_as
"""``as_long_as(array, other)``, kernels only: `array`, whose length is that of `other`.

Nothing is checked. The length of an array read from an arena may be known at compilation
(`specialise`), that of an argument is not.
"""


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
        self._kind = numba.typeof(Pattern(example).copy()[0])
        self._form: tuple = ()
        self._view = View(self._kind)
        self.read: Any = fallback.read if fallback.PLAIN else reader(self._view)

    def specialise(self, words: Words) -> specialise.Specialisation:
        """Return the specialisation for tuples whose `Pattern` has these words."""
        return specialise.Specialisation(self._view.name, words)

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
        form, made = _form_of(value), Pattern(value)
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
        if fallback.PLAIN:
            return value, value
        pattern.write_numbers(value, packed)
        return value, packed

    def place(self, value: tuple) -> tuple[Any, np.ndarray]:
        """Copy a tuple like `copy`, once."""
        return self.copy(self.pattern(value))

    def pack(self, value: tuple) -> np.ndarray:
        """Copy like `place`, and return only the argument of the kernels."""
        return self.place(value)[1]
