"""Products of tables and vectors."""

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, combine_moduli
from hpcsweep.solvers.flow.state.tables import ZERO


@kernel
def product(table, index, x, out):
    """Multiply the columns ``table[index]`` by x into `out`, whose length is padded to `LANES`."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])


@kernel
def product_of_moduli(table, index, x, out):
    """Multiply like `product`, by the moduli |x|."""
    rows = table.shape[2]
    start = index * table.shape[1] * rows
    for first in range(0, out.shape[0], LANES):
        combine_moduli(out, first, ZERO, 0, 1.0, table, start + first, rows, x, 0, x.shape[0])
