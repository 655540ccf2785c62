"""Augmented state of a linear step, and the rows of displacements beyond the coordinates."""

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.flow.state.state import copy_state


@kernel
def start(x, z, pairs):
    """Write the augmented state: z, the pairs of the forcing, 1."""
    size = z.shape[0]
    copy_state(z, x)
    for k in range(pairs.shape[0]):
        x[size + k] = pairs[k]
    x[x.shape[0] - 1] = 1.0


@kernel
def renew_rows(z, tangent, model):
    """Recompute the rows beyond n from the first n, in z and in the columns of `tangent`."""
    n = model.modal_transform.shape[0]
    half = z.shape[0] // 2
    for start in range(0, 2 * half, half):
        for extra in range(half - n):
            value = 0.0
            for j in range(n):
                value += model.rows[extra, j] * z[start + j]
            z[start + n + extra] = value
            for column in range(tangent.shape[1]):
                value = 0.0
                for j in range(n):
                    value += model.rows[extra, j] * tangent[start + j, column]
                tangent[start + n + extra, column] = value
