"""Compilation of the numerical kernels with numba, cached on disk.

numba's own cache looks only at the file of the function it compiled, not at the files of the
functions that were inlined into it, so an edited kernel could go on running in its old form.
The cache folder is therefore named after the contents of every file of the package that holds
kernels. It lies under ``$NUMBA_CACHE_DIR`` where that is set, else ``$XDG_CACHE_HOME/hpcsweep``
or ``~/.cache/hpcsweep``. numba writes each entry to a temporary file and renames it into
place, so that many ranks may compile at once: the worst that happens is that work is done
twice. `hpcsweep.campaign` lets one rank of each node compile first.
"""

import functools
import hashlib
import os
from pathlib import Path

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core import config as _numba_config
from numba.extending import intrinsic


def _source_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parent
    kernels = [package / "equations.py", *sorted((package / "flow").glob("*.py"))]
    for path in [*kernels, Path(__file__)]:
        if path.exists():
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    if os.environ.get("NUMBA_CACHE_DIR"):
        root = Path(os.environ["NUMBA_CACHE_DIR"])
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hpcsweep"
    return root / _source_hash()


_numba_config.CACHE_DIR = str(_cache_folder())

jit = functools.partial(numba.njit, cache=True, error_model="numpy", _nrt=True)
"""Compile a kernel: cached, IEEE arithmetic.

No fast-math flag is set. With ``contract`` LLVM fuses products and sums where it happens to inline
them, and a kernel that has just been compiled then differs in the last bit from the same kernel
loaded from the cache. Where a fused operation pays, the kernels ask for it: `fma`.
"""

kernel = functools.partial(jit, _nrt=False)
"""Compile a kernel that allocates no array and returns none: arrays are not counted.

numba counts the references to each array by atomic operations, which were half of the time of a
forcing period. What allocates is compiled by `jit`, and may be called from a kernel.
"""
inlined = functools.partial(kernel, forceinline=True)
"""Compile a kernel that becomes part of its callers, with their arguments as constants."""


@intrinsic
def fma(typingctx, a, b, c):
    """Evaluate a b + c with one rounding (kernels only), one instruction since Haswell and Zen."""
    del typingctx, a, b, c
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context, builder, signature, arguments):
        del context, signature
        return builder.fma(*arguments)

    return signature, generate


LANES = 8
"""Doubles worked on together: what a vector register of 64 bytes holds."""


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
        double, vector = ir.DoubleType(), ir.VectorType(ir.DoubleType(), LANES)

        def data(argument):
            make = context.make_array(signature.args[argument])
            return make(context, builder, arguments[argument]).data

        def lanes(base, index):
            return builder.bitcast(builder.gep(base, [index]), vector.as_pointer())

        fused = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(vector, [vector] * 3), f"llvm.fma.v{LANES}f64"
        )
        total = cgutils.alloca_once(builder, vector)
        builder.store(builder.load(lanes(data(2), arguments[3]), align=8), total)
        table, x = data(5), data(8)
        with cgutils.for_range(builder, arguments[10]) as loop:
            place = builder.add(arguments[6], builder.mul(loop.index, arguments[7]))
            column = builder.load(lanes(table, place), align=8)
            factor = builder.load(builder.gep(x, [builder.add(arguments[9], loop.index)]))
            if moduli:
                modulus = builder.module.declare_intrinsic("llvm.fabs", [double])
                factor = builder.call(modulus, [factor])
            factor = builder.fmul(factor, arguments[4])
            one = builder.insert_element(
                ir.Constant(vector, ir.Undefined), factor, ir.Constant(ir.IntType(32), 0)
            )
            everywhere = builder.shuffle_vector(
                one,
                ir.Constant(vector, ir.Undefined),
                ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES),
            )
            value = builder.call(fused, [column, everywhere, builder.load(total)])
            builder.store(value, total)
        builder.store(builder.load(total), lanes(data(0), arguments[1]), align=8)
        return context.get_dummy_value()

    return typed


combine = intrinsic(_combination(moduli=False))
"""``combine(out, o, init, i, scale, table, t, stride, x, s, n)``, kernels only: the `LANES` numbers
out[o:] = init[i:] + sum_k table[t + k stride:] (scale x[s + k]), k < n, in one register.

The arrays are contiguous and the indices flat; nothing is checked.
"""
combine_moduli = intrinsic(_combination(moduli=True))
"""As `combine`, with |x[s + k]|."""
