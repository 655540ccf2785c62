"""Tally of a motion: contact set, drift, modal norms, peaks, impacts.

`drift`, `peaks`, `impacts` and `modal_norm` update it on linear segments, `layer.observation`
inside a layer.
"""

from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.places import zeros
from hpcsweep.model.kernel_model import PEAK_FLAGS, Model
from hpcsweep.solvers.measures import IMPACT_FLAG, N_IMPACTS

NO_TALLY, MAXIMA, NORMS = range(3)
PEAKS, IMPACTS = sum(PEAK_FLAGS), IMPACT_FLAG
ANY_MEASURE = PEAKS | IMPACTS
"""What to gather: nothing; contact set and drift; these and the modal norms. To the latter two
`PEAK_FLAGS` may be added, for the peaks of watched rows, and `IMPACT_FLAG`, for impacts."""


class Tally(NamedTuple):
    """Quantities gathered over a window."""

    contact: np.ndarray
    """(1,) uint64: bit k is set once contact k has closed."""
    peak_drift: np.ndarray
    """(1,)"""
    free_time: np.ndarray
    """(1,): time without contact."""
    modal: np.ndarray
    """(n,): integral of |q_j| / ||q|| over that time."""
    peaks: np.ndarray
    """(Q,): of each row of `Model.watched`, of a contact past its stop; they start from 0 ..."""
    times: np.ndarray
    """(Q,): ... and when they are."""
    impacts: np.ndarray
    """(N_IMPACTS, m): see `hpcsweep.solvers.measures`."""
    closed: np.ndarray
    """(1,) uint64: the contacts that are closed now."""
    beside: np.ndarray
    """(1,) uint64: those that have not come apart since they have last been closed ..."""
    size: np.ndarray
    """(1,): ... by the rounding of this largest displacement or speed, see `measures.ROUNDING`."""


def new_tally(n: int, model: Model) -> Tally:
    """Return a tally for n modes of a structure."""
    return Tally(
        contact=zeros(1, dtype=np.uint64),
        peak_drift=zeros(1),
        free_time=zeros(1),
        modal=zeros(n),
        peaks=zeros(len(model.watched)),
        times=zeros(len(model.watched)),
        impacts=zeros(N_IMPACTS, model.contacts.gap.size),
        closed=zeros(1, dtype=np.uint64),
        beside=zeros(1, dtype=np.uint64),
        size=zeros(1),
    )


@inlined
def wants_norms(wanted):
    """Return whether modal norms are requested."""
    return wanted & 3 == NORMS


@kernel
def clear(tally):
    """Reset the tally."""
    tally.contact[0] = 0
    tally.peak_drift[0] = 0.0
    tally.free_time[0] = 0.0
    for j in range(tally.modal.shape[0]):
        tally.modal[j] = 0.0
    for w in range(tally.peaks.shape[0]):
        tally.peaks[w] = tally.times[w] = 0.0
    tally.closed[0] = tally.beside[0] = 0
    tally.size[0] = 0.0
    for i in range(tally.impacts.shape[0]):
        for k in range(tally.impacts.shape[1]):
            tally.impacts[i, k] = 0.0
