"""What is gathered along the motion: contact set, drift, modal norms.

`drift` and `modal_norm` bring it up to date on linear segments, `layer.observation` inside a layer.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.separate import type_of


class Tally(NamedTuple):
    """What is gathered over a window, and what is asked for."""

    contact: np.ndarray
    """(1,) uint64: bit k is set once contact k has touched."""
    peak_drift: np.ndarray
    """(1,)"""
    free_time: np.ndarray
    """(1,): time in which nothing touched."""
    modal: np.ndarray
    """(n,): integral of |q_j| / ||q|| over that time."""
    modal_norm: bool
    wanted: bool
    """Whether anything is gathered."""


def empty_tally(n: int, modal_norm: bool = False, wanted: bool = True) -> Tally:
    """Make a tally for n modes."""
    return Tally(
        np.zeros(1, np.uint64),
        np.zeros(1),
        np.zeros(1),
        np.zeros(n),
        modal_norm,
        wanted,
    )


TALLY = type_of(empty_tally(1))
"""Of the structures of any size, for the declaration of kernels."""
