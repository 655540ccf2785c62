"""The operations of `hpcsweep.kernels.vectors` as instructions of LLVM, for compiled kernels.

Nothing is checked. `hpcsweep.kernels.twins` says the same in numpy.
"""

import functools
import math
import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 8
"""Doubles worked on together: what a vector register of 64 bytes holds."""
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


def _lanes(builder, data, index):
    """Point at the `LANES` numbers data[index:]."""
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _everywhere(builder, value):
    """Fill a vector with one number, a constant of Python or a value of the kernel."""
    if not isinstance(value, ir.Value):
        return ir.Constant(_VECTOR, [value] * LANES)
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, undefined, mask)


def _on_vectors(builder, name: str, count: int):
    """Declare an LLVM function of `count` vectors."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR] * count)
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")


class Lanes(types.Type):
    """`LANES` doubles in one vector register: what kernels reckon with where loops would be slow.

    Sums, products and quotients of `Lanes` and numbers are written as those of numbers.
    """

    def __init__(self):
        super().__init__(name="Lanes")


_NUMBER, _LANES, _INDEX = types.float64, Lanes(), types.intp


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


def _spread(builder, signature, arguments):
    """Make vectors of the arguments that are numbers."""
    pairs = zip(signature.args, arguments, strict=True)
    return [value if kind == _LANES else _everywhere(builder, value) for kind, value in pairs]


def _define_operator(symbol, instruction: str) -> None:
    kinds = ((_LANES, _LANES), (_LANES, _NUMBER), (_NUMBER, _LANES))

    def generate(context, builder, signature, arguments):
        del context
        return getattr(builder, instruction)(*_spread(builder, signature, arguments))

    class Signatures(ConcreteTemplate):
        cases = [_LANES(*kind) for kind in kinds]  # noqa: RUF012 (so numba wants it)

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
    kinds = [_LANES if kind == _LANES else _NUMBER for kind in (a, b, c)]

    def generate(context, builder, signature, arguments):
        del context
        if signature.return_type == _NUMBER:
            return builder.fma(*arguments)
        return builder.call(_on_vectors(builder, "fma", 3), _spread(builder, signature, arguments))

    return (_LANES if _LANES in kinds else _NUMBER)(*kinds), generate


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

    return _LANES(array, _INDEX), generate


@intrinsic
def store(typingctx, array, index, value):
    """Write array[index:index + LANES] as `load` reads it."""
    del typingctx, index

    def generate(context, builder, signature, arguments):
        place = _contiguous(context, builder, signature, arguments, 0, arguments[1])
        value = arguments[2]
        if signature.args[2] == _NUMBER:
            value = _everywhere(builder, value)
        builder.store(value, place, align=8)
        return context.get_dummy_value()

    return types.void(array, _INDEX, _LANES if value == _LANES else _NUMBER), generate


def _lanewise(name: str, count: int, doc: str):
    """Make a function of so many `Lanes` or numbers from that of LLVM."""

    def typed(typingctx, *kinds):
        del typingctx
        return _LANES(*(_LANES if kind == _LANES else _NUMBER for kind in kinds)), generate

    def generate(context, builder, signature, arguments):
        del context
        vectors = _spread(builder, signature, arguments)
        return builder.call(_on_vectors(builder, name, count), vectors)

    one, two = (lambda typingctx, a: typed(typingctx, a)), (lambda t, a, b: typed(t, a, b))
    made = one if count == 1 else two
    made.__doc__ = doc
    return intrinsic(made)


root = _lanewise("sqrt", 1, "Square roots (kernels only).")
modulus = _lanewise("fabs", 1, "Moduli (kernels only).")
greatest = _lanewise("maximum", 2, "The greater of each two, NaN if one is (kernels only).")


def _folding(fold, doc: str):
    """Make a function that folds the halves of `Lanes` until one number is left."""

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
    lambda builder, a, b: builder.call(_on_vectors(builder, "maximum", 2), [a, b]),
    "The greatest, NaN if one is (kernels only).",
)


@intrinsic
def negative(typingctx, value):
    """Tell which are negative: the sum of 2^k of those lanes k (kernels only)."""
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        below = builder.fcmp_ordered("<", arguments[0], _everywhere(builder, 0.0))
        return builder.zext(builder.bitcast(below, ir.IntType(LANES)), ir.IntType(64))

    return types.int64(value), generate


def _combination(moduli: bool):
    """Make `combine`, or the same with the moduli of x."""

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

        fused = _on_vectors(builder, "fma", 3)
        table, x = data(5), data(8)

        def add(term, total):
            place = builder.add(arguments[6], builder.mul(term, arguments[7]))
            column = builder.load(_lanes(builder, table, place), align=8)
            factor = builder.load(builder.gep(x, [builder.add(arguments[9], term)]))
            if moduli:
                modulus = builder.module.declare_intrinsic("llvm.fabs", [ir.DoubleType()])
                factor = builder.call(modulus, [factor])
            factors = _everywhere(builder, builder.fmul(factor, arguments[4]))
            builder.store(builder.call(fused, [column, factors, builder.load(total)]), total)

        # even and odd terms apart: a sum waits for the one before
        total, odd = (cgutils.alloca_once(builder, _VECTOR) for _ in range(2))
        builder.store(builder.load(_lanes(builder, data(2), arguments[3]), align=8), total)
        builder.store(_everywhere(builder, 0.0), odd)
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
"""As `combine`, with |x[s + k]|."""


EXP_DEGREE = 13
"""Of the Taylor polynomial of exp on |r| <= ln 2 / 2; the rest is 0.35^14 / 14! = 4e-18."""
LN2_HIGH, LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
"""ln 2 in two parts; k LN2_HIGH is exact for |k| < 2^20 (W. J. Cody and W. Waite, 1980)."""
MOST_EXPONENT = 700.0


@intrinsic
def switches(typingctx, y):
    """Evaluate S(y) = 1 / (1 + exp(-y)) of `Lanes` (kernels only).

    With t = exp(-|y|) it is S = 1 / (1 + t) for y >= 0 and t / (1 + t) for y < 0, both without
    cancellation; exp(-|y|) = 2^k exp(r), k the integer nearest to -|y| / ln 2. S is right to 4e-16,
    relative, and t = 0 from |y| = `MOST_EXPONENT` on.
    """
    del typingctx

    def generate(context, builder, signature, arguments):
        del context, signature
        integers = ir.VectorType(ir.IntType(64), LANES)
        everywhere = functools.partial(_everywhere, builder)
        fused, nearest = _on_vectors(builder, "fma", 3), _on_vectors(builder, "rint", 1)
        modulus, least = _on_vectors(builder, "fabs", 1), _on_vectors(builder, "minnum", 2)
        (y,) = arguments
        size = builder.call(least, [builder.call(modulus, [y]), everywhere(MOST_EXPONENT)])
        k = builder.call(nearest, [builder.fmul(size, everywhere(-1.0 / math.log(2.0)))])
        r = builder.call(fused, [k, everywhere(-LN2_HIGH), builder.fneg(size)])
        r = builder.call(fused, [k, everywhere(-LN2_LOW), r])
        # sum of r^k / k!, neighbours first: four products one after the other instead of 13
        terms = [everywhere(1.0 / math.factorial(k)) for k in range(EXP_DEGREE + 1)]
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
        t = builder.fmul(t, builder.bitcast(power, _VECTOR))
        tiny = builder.fcmp_ordered(">=", size, everywhere(MOST_EXPONENT))
        t = builder.select(tiny, everywhere(0.0), t)
        one = everywhere(1.0)
        positive = builder.fcmp_ordered(">=", y, everywhere(0.0))
        return builder.fdiv(builder.select(positive, one, t), builder.fadd(one, t))

    return _LANES(y), generate
