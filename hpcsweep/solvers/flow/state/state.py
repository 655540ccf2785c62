"""Copy states of motions and matrices, and test their size."""

from hpcsweep.kernels.compile import kernel

OVERFLOW = 1e100
"""A coordinate beyond this ends the run as NON_FINITE."""


@kernel
def is_ordinary(z):
    """Return whether no coordinate is NaN or exceeds `OVERFLOW`."""
    for value in z:
        if not abs(value) < OVERFLOW:
            return False
    return True


@kernel
def copy_state(z, out):
    """Copy z into `out`, which may be longer."""
    for i in range(z.shape[0]):
        out[i] = z[i]


@kernel
def copy_matrix(matrix, out):
    """Copy the rows of a matrix into `out`."""
    for i in range(matrix.shape[0]):
        copy_state(matrix[i], out[i])


@kernel
def make_unit(matrix):
    """Set a square matrix to the unit matrix."""
    matrix[:] = 0.0
    for i in range(matrix.shape[0]):
        matrix[i, i] = 1.0
