"""The operations of `hpcsweep.kernels.simd.vectors` as LLVM instructions, for compiled kernels.

Nothing is checked. `hpcsweep.kernels.simd.fallback` has the same in numpy.
"""

import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import intrinsic, lower_builtin, models, register_model

from hpcsweep.kernels.simd import LANES

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
"""A vector register of 64 bytes."""


def _lanes(builder, data, index):
    """Return a pointer to the `LANES` numbers data[index:]."""
    return builder.bitcast(builder.gep(data, [index]), VECTOR.as_pointer())


def everywhere(builder, value):
    """Fill a vector with one number, a Python constant or a value of the kernel."""
    if not isinstance(value, ir.Value):
        return ir.Constant(VECTOR, [value] * LANES)
    undefined = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, undefined, mask)


def on_vectors(builder, name: str, count: int):
    """Declare an LLVM function of `count` vectors."""
    kind = ir.FunctionType(VECTOR, [VECTOR] * count)
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")


class Lanes(types.Type):
    """`LANES` doubles in one vector register, for kernels where loops would be slow.

    Sums, products and quotients of `Lanes` and numbers are written like those of numbers.
    """

    def __init__(self):
        super().__init__(name="Lanes")


_NUMBER, LANES_TYPE, _INDEX = types.float64, Lanes(), types.intp


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, VECTOR)


def _spread(builder, signature, arguments):
    """Convert number arguments to vectors."""
    pairs = zip(signature.args, arguments, strict=True)
    return [value if kind == LANES_TYPE else everywhere(builder, value) for kind, value in pairs]


def _define_operator(symbol, instruction: str) -> None:
    kinds = ((LANES_TYPE, LANES_TYPE), (LANES_TYPE, _NUMBER), (_NUMBER, LANES_TYPE))

    def generate(context, builder, signature, arguments):
        del context
        return getattr(builder, instruction)(*_spread(builder, signature, arguments))

    class Signatures(ConcreteTemplate):
        cases = [LANES_TYPE(*kind) for kind in kinds]  # noqa: RUF012 (so numba wants it)

    infer_global(symbol)(Signatures)
    for kind in kinds:
        lower_builtin(symbol, *kind)(generate)


_define_operator(operator.add, "fadd")
_define_operator(operator.sub, "fsub")
_define_operator(operator.mul, "fmul")
_define_operator(operator.truediv, "fdiv")


@intrinsic
def fma(typingctx, a, b, c):
    """Evaluate a b + c with one rounding, numbers or `Lanes` (kernels only).

    One instruction since Haswell and Zen.
    """
    del typingctx
    kinds = [LANES_TYPE if kind == LANES_TYPE else _NUMBER for kind in (a, b, c)]

    def generate(context, builder, signature, arguments):
        del context
        if signature.return_type == _NUMBER:
            return builder.fma(*arguments)
        return builder.call(on_vectors(builder, "fma", 3), _spread(builder, signature, arguments))

    return (LANES_TYPE if LANES_TYPE in kinds else _NUMBER)(*kinds), generate


def _contiguous(context, builder, signature, arguments, which, index):
    make = context.make_array(signature.args[which])
    return _lanes(builder, make(context, builder, arguments[which]).data, index)


@intrinsic
def load(typingctx, array, index):
    """Read array[index:index + LANES] (contiguous, flat; nothing is checked; kernels only)."""
    del typingctx, index

    def generate(context, builder, signature, arguments):
        place = _contiguous(context, builder, signature, arguments, 0, arguments[1])
        return builder.load(place, align=8)

    return LANES_TYPE(array, _INDEX), generate


@intrinsic
def store(typingctx, array, index, value):
    """Write array[index:index + LANES] as `load` reads it."""
    del typingctx, index

    def generate(context, builder, signature, arguments):
        place = _contiguous(context, builder, signature, arguments, 0, arguments[1])
        value = arguments[2]
        if signature.args[2] == _NUMBER:
            value = everywhere(builder, value)
        builder.store(value, place, align=8)
        return context.get_dummy_value()

    return types.void(array, _INDEX, LANES_TYPE if value == LANES_TYPE else _NUMBER), generate


def _lanewise(name: str, count: int, doc: str):
    """Return a function of `count` `Lanes` or numbers from an LLVM intrinsic."""

    def typed(typingctx, *kinds):
        del typingctx
        return LANES_TYPE(
            *(LANES_TYPE if kind == LANES_TYPE else _NUMBER for kind in kinds)
        ), generate

    def generate(context, builder, signature, arguments):
        del context
        vectors = _spread(builder, signature, arguments)
        return builder.call(on_vectors(builder, name, count), vectors)

    one, two = (lambda typingctx, a: typed(typingctx, a)), (lambda t, a, b: typed(t, a, b))
    made = one if count == 1 else two
    made.__doc__ = doc
    return intrinsic(made)


root = _lanewise("sqrt", 1, "Square roots (kernels only).")
modulus = _lanewise("fabs", 1, "Moduli (kernels only).")
greatest = _lanewise("maximum", 2, "The greater of each two, NaN if one is (kernels only).")


def _folding(fold, doc: str):
    """Return a function that folds the halves of `Lanes` until one number is left."""

    def typed(typingctx, value):
        del typingctx
        return _NUMBER(value), generate

    def generate(context, builder, signature, arguments):
        del context, signature
        value = arguments[0]
        width = LANES // 2
        while width:
            lanes = [*range(width, 2 * width), *range(width), *range(2 * width, LANES)]
            mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), lanes)
            value = fold(builder, value, builder.shuffle_vector(value, value, mask))
            width //= 2
        return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    typed.__doc__ = doc
    return intrinsic(typed)


total = _folding(lambda builder, a, b: builder.fadd(a, b), "The sum (kernels only).")
maximum = _folding(
    lambda builder, a, b: builder.call(on_vectors(builder, "maximum", 2), [a, b]),
    "The greatest, NaN if one is (kernels only).",
)


def _negative(builder, value):
    """Return a bit for each lane that is negative; NaN is not."""
    below = builder.fcmp_ordered("<", value, everywhere(builder, 0.0))
    return builder.bitcast(below, ir.IntType(LANES))


@intrinsic
def negative(typingctx, value):
    """Return which are negative: the sum of 2^k of those lanes k (kernels only)."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        return builder.zext(_negative(builder, arguments[0]), ir.IntType(64))

    return types.int64(value), generate


@intrinsic
def first_not_negative(typingctx, value):
    """Return the first lane that is not negative, `LANES` if all are (kernels only)."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        word = ir.IntType(64)
        others = builder.zext(builder.not_(_negative(builder, arguments[0])), word)
        return builder.cttz(builder.or_(others, word(1 << LANES)), ir.IntType(1)(1))

    return types.int64(value), generate


@intrinsic
def lane(typingctx, value, index):
    """Read one lane (nothing is checked; kernels only)."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        return builder.extract_element(*arguments)

    return _NUMBER(value, index), generate


@intrinsic
def shifted(typingctx, first, value):
    """Put a number before the lanes; the last one falls off (kernels only)."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        first, value = arguments
        lanes = [LANES, *range(LANES - 1)]
        mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), lanes)
        return builder.shuffle_vector(value, everywhere(builder, first), mask)

    return LANES_TYPE(_NUMBER, LANES_TYPE), generate


def _combination(moduli: bool):
    """Return `combine`, or the same with the moduli of x."""

    def typed(typingctx, out, o, init, i, scale, table, t, stride, x, s, n):
        del typingctx, o, i, scale, t, stride, s, n
        index = types.intp
        signature = types.void(
            out, index, init, index, types.float64, table, index, index, x, index, index
        )
        return signature, generate

    def generate(context, builder, signature, arguments):
        def data(argument):
            make = context.make_array(signature.args[argument])
            return make(context, builder, arguments[argument]).data

        fused = on_vectors(builder, "fma", 3)
        table, x = data(5), data(8)

        def add(term, total):
            place = builder.add(arguments[6], builder.mul(term, arguments[7]))
            column = builder.load(_lanes(builder, table, place), align=8)
            factor = builder.load(builder.gep(x, [builder.add(arguments[9], term)]))
            if moduli:
                modulus = builder.module.declare_intrinsic("llvm.fabs", [ir.DoubleType()])
                factor = builder.call(modulus, [factor])
            factors = everywhere(builder, builder.fmul(factor, arguments[4]))
            builder.store(builder.call(fused, [column, factors, builder.load(total)]), total)

        # even and odd terms separately: each addition waits for the previous one
        total, odd = (cgutils.alloca_once(builder, VECTOR) for _ in range(2))
        builder.store(builder.load(_lanes(builder, data(2), arguments[3]), align=8), total)
        builder.store(everywhere(builder, 0.0), odd)
        n, one = arguments[10], ir.Constant(arguments[10].type, 1)
        with cgutils.for_range(builder, builder.lshr(n, one)) as loop:
            even = builder.shl(loop.index, one)
            add(even, total)
            add(builder.add(even, one), odd)
        with builder.if_then(builder.trunc(n, ir.IntType(1))):
            add(builder.sub(n, one), total)
        builder.store(builder.fadd(builder.load(total), builder.load(odd)), total)
        builder.store(builder.load(total), _lanes(builder, data(0), arguments[1]), align=8)
        return context.get_dummy_value()

    return typed


combine = intrinsic(_combination(moduli=False))
"""``combine(out, o, init, i, scale, table, t, stride, x, s, n)``, kernels only: the `LANES` numbers
out[o:] = init[i:] + sum_k table[t + k stride:] (scale x[s + k]), k < n, in one register.

The arrays are contiguous and the indices flat; nothing is checked.
"""
combine_moduli = intrinsic(_combination(moduli=True))
"""Like `combine`, with |x[s + k]|."""
