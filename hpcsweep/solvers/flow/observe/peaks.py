"""Peaks of single rows over continuous time, on linear segments: storeys, floors, contacts.

Like the largest drift (`drift`), but each row of `Model.watched` has a peak of its own: of |y_i -
y_below|, or, for a row with a side, of that side times y_i.
"""

from hpcsweep.kernels.compile import kernel
from hpcsweep.solvers.flow.observe.drift import peak_of_row


@kernel
def peaks_on_segment(index, x, z_end, s, wanted, model, tables, tally, work):
    """Update the requested peaks of the watched rows over the first `s` of a linear step.

    Arguments as of `drift.drift_on_segment`.
    """
    for w in range(model.watched.shape[0]):
        i, below, side, flag = model.watched[w]
        if wanted & flag:
            row = (i, below, side)
            peak_of_row(row, index, x, z_end, s, w, tally.peaks, tables, work)
