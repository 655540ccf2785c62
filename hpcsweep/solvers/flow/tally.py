"""What is gathered along the motion: contact set, drift, modal norms.

`drift` and `modal_norm` bring it up to date on linear segments, `layer.observation` inside a layer.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.placing import zeros

NO_TALLY, MAXIMA, NORMS = range(3)
"""What is wanted: nothing; contact set and drift; these and the modal norms."""


class Tally(NamedTuple):
    """What has been gathered over a window."""

    contact: np.ndarray
    """(1,) uint64: bit k is set once contact k has touched."""
    peak_drift: np.ndarray
    """(1,)"""
    free_time: np.ndarray
    """(1,): time in which nothing touched."""
    modal: np.ndarray
    """(n,): integral of |q_j| / ||q|| over that time."""


def new_tally(n: int) -> Tally:
    """Make a tally for n modes."""
    return Tally(zeros(1, dtype=np.uint64), zeros(1), zeros(1), zeros(n))


@kernel
def clear(tally):
    """Begin anew."""
    tally.contact[0] = 0
    tally.peak_drift[0] = 0.0
    tally.free_time[0] = 0.0
    for j in range(tally.modal.shape[0]):
        tally.modal[j] = 0.0
