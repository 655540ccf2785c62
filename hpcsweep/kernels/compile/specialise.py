"""Specialise kernels to the sizes of their arrays, which become constants for the compiler.

A kernel works on structures of any size: it reads the lengths of its loops from the arrays of an
`arena.Arena`. Where they are known at compilation, loops of three or six turns are unrolled, sums
stay in registers, and unused code is removed; a forcing period takes 0.65 to 0.9 of the time. No
product or sum is reordered, so results are equal to the last bit, and a specialised kernel can
replace the other anywhere.

Wherever a kernel or one of its parts begins to read an arena it asks a function for the address of
the words that say the sizes and places of arrays (`ask_words`). Parts are lowered once for all
kernels (`inline`); the function is defined when they are linked into one (`define_words`): it
returns constants while that is specialised (`compiling`), else the words of its argument. Calls of
kernels that are also specialised go to these (`rename_addresses`).
"""

import contextlib
import hashlib
from collections.abc import Iterator

from llvmlite import binding, ir
from numba.core.cgutils import get_or_insert_function, global_constant

from hpcsweep.kernels.compile.places import Words

KEY_LENGTH = 12
ADDRESS = ir.IntType(8).as_pointer()
ASKED = ir.FunctionType(ADDRESS, [ADDRESS])
WORDS_OF = "words of "
"""How the names of functions begin that return the address of words."""


class Specialisation:
    """Sizes to which kernels are specialised.

    Parameters
    ----------
    kind : str
        Name of the type of the packed tuple.
    words : Words
        Of the `places.Pattern` of such a tuple.

    Attributes
    ----------
    key : str
        Identifies the specialisation, also in the names of kernels and of their files.
    """

    def __init__(self, kind: str, words: Words):
        self.kind, self.words = kind, words
        self.key = hashlib.sha256(repr(words).encode()).hexdigest()[:KEY_LENGTH]


def specialised_name(function, key: str) -> str:
    """Return the name of a specialised kernel, for its file and its LLVM function."""
    return f"{function.__qualname__}_{key}"


current: tuple[Specialisation, dict[str, str]] | None = None


@contextlib.contextmanager
def compiling(wanted: tuple[Specialisation, dict[str, str]]) -> Iterator[None]:
    """Specialise what is linked within the context.

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


def ask_words(builder, kind: str, packed):
    """Generate a call that returns the address of the words of a packed tuple."""
    return builder.call(get_or_insert_function(builder.module, ASKED, WORDS_OF + kind), [packed])


def define_words(module) -> None:
    """Define the functions that the parts of an LLVM module ask for words."""
    defined = ir.Module()
    defined.triple, defined.data_layout = module.triple, module.data_layout
    for asked in module.functions:
        if not asked.name.startswith(WORDS_OF):
            continue
        function = ir.Function(defined, ASKED, asked.name)
        function.linkage = "linkonce_odr"
        function.attributes.add("alwaysinline")
        builder, address = ir.IRBuilder(function.append_basic_block()), function.args[0]
        if current is not None and asked.name == WORDS_OF + current[0].kind:
            words = ir.ArrayType(ir.IntType(64), len(current[0].words))(current[0].words)
            constants = global_constant(defined, asked.name + " known", words)
            address = builder.bitcast(constants, ADDRESS)
        builder.ret(address)
    module.link_in(binding.parse_assembly(str(defined)))
