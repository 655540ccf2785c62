"""The operations of `hpcsweep.kernels.simd.vectors` as LLVM instructions, for compiled kernels.

Nothing is checked, and arrays are contiguous. `hpcsweep.kernels.simd.fallback` has the same in
numpy. Each is declared by the types of its result and of its arguments, and written as a function
of LLVM's builder, which is passed an array by the address of its data.
"""

import functools
import inspect
import math
import operator
from collections.abc import Callable

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import intrinsic, lower_builtin, models, register_model

from hpcsweep.kernels.simd import LANES

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
"""A vector register of 64 bytes."""
WORD = ir.IntType(64)
ALIGNMENT = 64
"""Of arrays on the stack, bytes."""
EXP_DEGREE = 13
"""Of the Taylor polynomial of exp on |r| <= ln 2 / 2; the rest is 0.35^14 / 14! = 4e-18."""
LN2_HIGH, LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
"""ln 2 in two parts; k LN2_HIGH is exact for |k| < 2^20 (W. J. Cody and W. Waite, 1980)."""
MAX_EXPONENT = 700.0


def _lanes(builder, data, index):
    """Return a pointer to the `LANES` numbers data[index:]."""
    return builder.bitcast(builder.gep(data, [index]), VECTOR.as_pointer())


def everywhere(builder, value):
    """Fill a vector with one number, a Python constant or a value of the kernel."""
    if not isinstance(value, ir.Value):
        return ir.Constant(VECTOR, [value] * LANES)
    undefined = ir.Constant(VECTOR, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    return _shuffled(builder, first, undefined, [0] * LANES)


def _shuffled(builder, first, second, lanes: list[int]):
    """Return the given lanes of two vectors, those of the second from `LANES` on."""
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), lanes)
    return builder.shuffle_vector(first, second, mask)


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


NUMBER, LANES_TYPE, INDEX = types.float64, Lanes(), types.intp
ANY, SPREAD = object(), object()
"""Types of arguments: as it is given; `Lanes`, of which a number fills all."""


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, VECTOR)


def _spread(builder, kind, value):
    """Convert a number to a vector."""
    return value if kind == LANES_TYPE else everywhere(builder, value)


def instruction(result, *declared) -> Callable:
    """Make an operation of kernels from a function of a builder and of the arguments' values.

    A type is one of numba's, `ANY` or `SPREAD`. The result is a type, or None.
    """

    def decorate(write: Callable):
        def typed(typingctx, *types_of_arguments):
            del typingctx
            kinds = [
                actual if kind is ANY or (kind is SPREAD and actual == LANES_TYPE) else kind
                for kind, actual in zip(declared, types_of_arguments, strict=True)
            ]
            kinds = [NUMBER if kind is SPREAD else kind for kind in kinds]
            return (types.void if result is None else result)(*kinds), generate

        def generate(context, builder, signature, arguments):
            values = []
            for kind, actual, value in zip(declared, signature.args, arguments, strict=True):
                if isinstance(actual, types.Array):
                    value = context.make_array(actual)(context, builder, value).data
                values.append(_spread(builder, actual, value) if kind is SPREAD else value)
            written = write(builder, *values)
            return context.get_dummy_value() if result is None else written

        typed.__doc__, typed.__name__ = write.__doc__, write.__name__
        typed.__signature__ = inspect.signature(write)  # type: ignore[attr-defined]
        return intrinsic(typed)

    return decorate


def _define_operator(symbol, name: str) -> None:
    kinds = ((LANES_TYPE, LANES_TYPE), (LANES_TYPE, NUMBER), (NUMBER, LANES_TYPE))

    def generate(context, builder, signature, arguments):
        del context
        pairs = zip(signature.args, arguments, strict=True)
        return getattr(builder, name)(*(_spread(builder, *pair) for pair in pairs))

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
    kinds = [LANES_TYPE if kind == LANES_TYPE else NUMBER for kind in (a, b, c)]

    def generate(context, builder, signature, arguments):
        del context
        if signature.return_type == NUMBER:
            return builder.fma(*arguments)
        spread = [_spread(builder, *pair) for pair in zip(kinds, arguments, strict=True)]
        return builder.call(on_vectors(builder, "fma", 3), spread)

    return (LANES_TYPE if LANES_TYPE in kinds else NUMBER)(*kinds), generate


@instruction(LANES_TYPE, ANY, INDEX)
def load(builder, array, index):
    """Read array[index:index + LANES] (contiguous, flat; nothing is checked; kernels only)."""
    return builder.load(_lanes(builder, array, index), align=8)


@instruction(None, ANY, INDEX, SPREAD)
def store(builder, array, index, value):
    """Write array[index:index + LANES] as `load` reads it."""
    builder.store(value, _lanes(builder, array, index), align=8)


def _local(*shape):
    """Return the signature of an array on the stack, and what writes it."""
    kind = types.Array(NUMBER, len(shape), "C")

    def generate(context, builder, signature, arguments):
        lengths = [
            context.get_constant(INDEX, size.literal_value) if _is_constant(size) else value
            for size, value in zip(signature.args, arguments, strict=True)
        ]
        double, item = ir.DoubleType(), context.get_constant(INDEX, 8)
        if all(map(_is_constant, signature.args)):
            count = WORD(math.prod(length.constant for length in lengths))
            data = cgutils.alloca_once(builder, double, size=count)
        else:
            data = builder.alloca(double, functools.reduce(builder.mul, lengths))
        data.align = ALIGNMENT
        strides = [builder.mul(item, length) for length in lengths[1:]] + [item]
        array = context.make_array(kind)(context, builder)
        context.populate_array(
            array, data=data, shape=lengths, strides=strides, itemsize=item, meminfo=None
        )
        return array._getvalue()

    return kind(*shape), generate


def _is_constant(size) -> bool:
    """Return whether a type of an argument is that of a constant."""
    return isinstance(size, types.Literal)


@intrinsic(prefer_literal=True)
def local_vector(typingctx, size):
    """Make an array of doubles on the stack, until its function returns; it holds anything.

    Of a constant size it is a variable like any other, which LLVM may keep in registers. Made at
    the top of a function, not in a loop: each call takes new memory.
    """
    del typingctx
    return _local(size)


@intrinsic(prefer_literal=True)
def local_matrix(typingctx, rows, columns):
    """Make a matrix as `local_vector` makes a vector."""
    del typingctx
    return _local(rows, columns)


@instruction(LANES_TYPE, SPREAD)
def root(builder, value):
    """Return the square roots (kernels only)."""
    return builder.call(on_vectors(builder, "sqrt", 1), [value])


@instruction(LANES_TYPE, SPREAD)
def modulus(builder, value):
    """Return the moduli (kernels only)."""
    return builder.call(on_vectors(builder, "fabs", 1), [value])


@instruction(LANES_TYPE, SPREAD, SPREAD)
def greatest(builder, a, b):
    """Return the greater of each two, NaN if one is (kernels only)."""
    return _greater(builder, a, b)


def _greater(builder, a, b):
    return builder.call(on_vectors(builder, "maximum", 2), [a, b])


def _folded(builder, fold, value):
    """Fold the halves of `Lanes` until one number is left."""
    width = LANES // 2
    while width:
        lanes = [*range(width, 2 * width), *range(width), *range(2 * width, LANES)]
        value = fold(builder, value, _shuffled(builder, value, value, lanes))
        width //= 2
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


@instruction(NUMBER, ANY)
def total(builder, value):
    """Return the sum (kernels only)."""
    return _folded(builder, ir.IRBuilder.fadd, value)


@instruction(NUMBER, ANY)
def maximum(builder, value):
    """Return the greatest, NaN if one is (kernels only)."""
    return _folded(builder, _greater, value)


def _negative(builder, value):
    """Return a bit for each lane that is negative; NaN is not."""
    below = builder.fcmp_ordered("<", value, everywhere(builder, 0.0))
    return builder.bitcast(below, ir.IntType(LANES))


@instruction(types.int64, ANY)
def negative(builder, value):
    """Return which are negative: the sum of 2^k of those lanes k (kernels only)."""
    return builder.zext(_negative(builder, value), WORD)


@instruction(types.int64, ANY)
def first_not_negative(builder, value):
    """Return the first lane that is not negative, `LANES` if all are (kernels only)."""
    others = builder.zext(builder.not_(_negative(builder, value)), WORD)
    return builder.cttz(builder.or_(others, WORD(1 << LANES)), ir.IntType(1)(1))


@instruction(NUMBER, ANY, ANY)
def lane(builder, value, index):
    """Read one lane (nothing is checked; kernels only)."""
    return builder.extract_element(value, index)


@instruction(LANES_TYPE, NUMBER, LANES_TYPE)
def shifted(builder, first, value):
    """Put a number before the lanes; the last one falls off (kernels only)."""
    return _shuffled(builder, value, everywhere(builder, first), [LANES, *range(LANES - 1)])


def _combined(builder, out, o, init, i, scale, table, t, stride, x, s, n, moduli: bool = False):
    """Write `combine`, or the same with the moduli of x."""
    fused = on_vectors(builder, "fma", 3)

    def add(term, total):
        place = builder.add(t, builder.mul(term, stride))
        column = builder.load(_lanes(builder, table, place), align=8)
        factor = builder.load(builder.gep(x, [builder.add(s, term)]))
        if moduli:
            modulus = builder.module.declare_intrinsic("llvm.fabs", [ir.DoubleType()])
            factor = builder.call(modulus, [factor])
        factors = everywhere(builder, builder.fmul(factor, scale))
        builder.store(builder.call(fused, [column, factors, builder.load(total)]), total)

    # even and odd terms separately: each addition waits for the previous one
    total, odd = (cgutils.alloca_once(builder, VECTOR) for _ in range(2))
    builder.store(builder.load(_lanes(builder, init, i), align=8), total)
    builder.store(everywhere(builder, 0.0), odd)
    unit = ir.Constant(n.type, 1)
    with cgutils.for_range(builder, builder.lshr(n, unit)) as loop:
        even = builder.shl(loop.index, unit)
        add(even, total)
        add(builder.add(even, unit), odd)
    with builder.if_then(builder.trunc(n, ir.IntType(1))):
        add(builder.sub(n, unit), total)
    builder.store(builder.fadd(builder.load(total), builder.load(odd)), total)
    builder.store(builder.load(total), _lanes(builder, out, o), align=8)


_combination = instruction(
    None, *(ANY, INDEX, ANY, INDEX, NUMBER), *(ANY, INDEX, INDEX), *(ANY, INDEX, INDEX)
)


@_combination
def combine(builder, out, o, init, i, scale, table, t, stride, x, s, n):
    """Write out[o:] = init[i:] + sum_k table[t + k stride:] (scale x[s + k]), k < n.

    These are `LANES` numbers in one register; indices are flat, nothing is checked (kernels only).
    """
    _combined(builder, out, o, init, i, scale, table, t, stride, x, s, n)


@_combination
def combine_moduli(builder, out, o, init, i, scale, table, t, stride, x, s, n):
    """Write like `combine`, with |x[s + k]|."""
    _combined(builder, out, o, init, i, scale, table, t, stride, x, s, n, moduli=True)


@instruction(LANES_TYPE, ANY)
def switches(builder, y):
    """Evaluate S(y) = 1 / (1 + exp(-y)) of `Lanes` (kernels only).

    With t = exp(-|y|) it is S = 1 / (1 + t) for y >= 0 and t / (1 + t) for y < 0, both without
    cancellation; exp(-|y|) = 2^k exp(r), k the integer nearest to -|y| / ln 2. S is right to 4e-16,
    relative, and t = 0 from |y| = `MAX_EXPONENT` on.
    """
    integers = ir.VectorType(ir.IntType(64), LANES)
    fill = functools.partial(everywhere, builder)
    fused, nearest = on_vectors(builder, "fma", 3), on_vectors(builder, "rint", 1)
    modulus, least = on_vectors(builder, "fabs", 1), on_vectors(builder, "minnum", 2)
    size = builder.call(least, [builder.call(modulus, [y]), fill(MAX_EXPONENT)])
    k = builder.call(nearest, [builder.fmul(size, fill(-1.0 / math.log(2.0)))])
    r = builder.call(fused, [k, fill(-LN2_HIGH), builder.fneg(size)])
    r = builder.call(fused, [k, fill(-LN2_LOW), r])
    # sum of r^k / k!, neighbours first: four products one after the other instead of 13
    terms = [fill(1.0 / math.factorial(k)) for k in range(EXP_DEGREE + 1)]
    power = r
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        odd = terms[len(terms) & ~1 :]
        terms = [builder.call(fused, [b, power, a]) for a, b in pairs] + odd
        power = builder.fmul(power, power)
    (t,) = terms
    bias = ir.Constant(integers, [1023] * LANES)
    shift = ir.Constant(integers, [52] * LANES)
    power = builder.shl(builder.add(builder.fptosi(k, integers), bias), shift)
    t = builder.fmul(t, builder.bitcast(power, VECTOR))
    tiny = builder.fcmp_ordered(">=", size, fill(MAX_EXPONENT))
    t = builder.select(tiny, fill(0.0), t)
    unit = fill(1.0)
    positive = builder.fcmp_ordered(">=", y, fill(0.0))
    return builder.fdiv(builder.select(positive, unit, t), builder.fadd(unit, t))
