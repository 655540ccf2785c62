"""The switch of a contact for eight numbers at once, as LLVM instructions; see `vectors`."""

import functools
import math

from llvmlite import ir

from hpcsweep.kernels.simd.instructions import (
    ANY,
    LANES,
    LANES_TYPE,
    VECTOR,
    everywhere,
    instruction,
    on_vectors,
)

EXP_DEGREE = 13
"""Of the Taylor polynomial of exp on |r| <= ln 2 / 2; the rest is 0.35^14 / 14! = 4e-18."""
LN2_HIGH, LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
"""ln 2 in two parts; k LN2_HIGH is exact for |k| < 2^20 (W. J. Cody and W. Waite, 1980)."""
MAX_EXPONENT = 700.0


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
    one = fill(1.0)
    positive = builder.fcmp_ordered(">=", y, fill(0.0))
    return builder.fdiv(builder.select(positive, one, t), builder.fadd(one, t))
