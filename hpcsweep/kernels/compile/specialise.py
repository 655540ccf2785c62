"""Specialise kernels to the sizes of their arrays, which become constants for the compiler.

A kernel works on structures of any size: it reads the lengths of its loops from the arrays of an
`arena.Arena`. Where they are known at compilation, loops of three or six turns are unrolled, sums
stay in registers, and unused code is removed; a forcing period takes 0.55 to 0.8 of the time. No
product or sum is reordered, so results are equal to the last bit, and a specialised kernel can
replace the other anywhere.

While a kernel is specialised (`compiling`), what it reads the sizes and places of
arrays from (`places`) are constants in place of the words of its argument (`known_words`); calls of
kernels that are also specialised go to these. Both happen only in the kernel being compiled: its
parts are lowered once for all (`inline`), and have no sizes until they are linked into it.
"""

import contextlib
import hashlib
from collections.abc import Iterator

from llvmlite import ir

from hpcsweep.kernels.compile.places import Words

KEY_LENGTH = 12


class Specialisation:
    """Sizes to which kernels are specialised.

    Parameters
    ----------
    kind : numba.types.Type
        Type of the packed tuple.
    words : Words
        Of the `places.Pattern` of such a tuple.

    Attributes
    ----------
    key : str
        Identifies the specialisation, also in the names of kernels and of their files.
    """

    def __init__(self, kind, words: Words):
        self.kind, self.words = kind, words
        self.key = hashlib.sha256(repr(words).encode()).hexdigest()[:KEY_LENGTH]


def specialised_name(function, key: str) -> str:
    """Return the name of a specialised kernel, for its file and its LLVM function."""
    return f"{function.__qualname__}_{key}"


current: tuple[Specialisation, dict[str, str]] | None = None


@contextlib.contextmanager
def compiling(wanted: tuple[Specialisation, dict[str, str]] | None) -> Iterator[None]:
    """Specialise what is compiled within the context; None: an inlined part, which kernels share.

    With a specialisation there are the replacements of the symbols that hold the addresses of
    kernels.
    """
    global current  # numba compiles under one lock
    before, current = current, wanted
    try:
        yield
    finally:
        current = before


def rename_addresses(module) -> None:
    """Redirect the calls of an LLVM module to kernels with the same specialisation."""
    renamed = current[1] if current else {}
    for variable in module.global_variables:
        if variable.name in renamed:
            variable.name = renamed[variable.name]


def known_words(builder, kind):
    """Return the address of the words of arrays where they are known, as constants; else None."""
    if current is None or current[0].kind != kind:
        return None
    sizes = current[0]
    name = f"words of {sizes.key}"
    if name not in builder.module.globals:
        form = ir.ArrayType(ir.IntType(64), len(sizes.words))
        constants = ir.GlobalVariable(builder.module, form, name)
        constants.global_constant, constants.linkage = True, "internal"
        constants.initializer = form(sizes.words)
    return builder.module.globals[name]
