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
from numba.core import config as _numba_config
from numba.core import types
from numba.extending import intrinsic


def _source_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parent
    kernels = [package / "equations.py", *sorted((package / "flow").glob("*.py"))]
    for path in [*kernels, package / "stability.py", package / "sweep.py"]:
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

jit = functools.partial(numba.njit, cache=True, error_model="numpy")
"""Compile a kernel: cached, IEEE arithmetic.

No fast-math flag is set. With ``contract`` LLVM fuses products and sums where it happens to inline
them, and a kernel that has just been compiled then differs in the last bit from the same kernel
loaded from the cache. Where a fused operation pays, the kernels ask for it: `fma`.
"""


@intrinsic
def fma(typingctx, a, b, c):
    """Evaluate a b + c with one rounding (kernels only), one instruction since Haswell and Zen."""
    del typingctx, a, b, c
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context, builder, signature, arguments):
        del context, signature
        return builder.fma(*arguments)

    return signature, generate
