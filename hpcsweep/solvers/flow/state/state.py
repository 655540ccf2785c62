"""The state of a motion: copied, and whether it is of ordinary size."""

from hpcsweep.kernels.compile import kernel

OVERFLOW = 1e100
"""A coordinate beyond this ends the run as NON_FINITE."""


@kernel
def is_ordinary(z):
    """Return whether no coordinate is beyond `OVERFLOW` or NaN."""
    for value in z:
        if not abs(value) < OVERFLOW:
            return False
    return True


@kernel
def copy_state(z, out):
    """Write z into `out`, which may be longer."""
    for i in range(z.shape[0]):
        out[i] = z[i]
