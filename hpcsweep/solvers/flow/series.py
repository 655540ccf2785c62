"""Taylor series of the linear motion of one contact set, about any of its states.

With x' = M x of `tables` and e the unit impulse of a contact (it moves velocities, d . e = 1)::

    d . u(s) = sum_k s^k (d M^k / k!) x,        exp(M s) e = sum_k s^k M^k e / k!

The first is the distance of a contact, the second what an impulse at time 0 has done by time s.
"""

import numpy as np

from hpcsweep.kernels.compile import jit
from hpcsweep.kernels.vectors import LANES


@jit
def build_series(generator, unit, places, model, series, impulses):
    """Fill both series of all contacts for one contact set.

    Parameters
    ----------
    generator : ndarray, shape (2n + 2H + 1, the same)
        M, balanced.
    unit : ndarray, shape (2n + 2H + 1,)
        Of the balanced state.
    places : ndarray of int, the same shape
        Where its components lie in an augmented state of all rows.
    model : Model
    series : ndarray, shape (m, N, LANES)
        Receives d M^k / k!.
    impulses : ndarray, shape (m, LANES, padded 2R)
        Receives M^k e / k!.
    """
    n = model.modal_transform.shape[0]
    n_rows = model.stiffness.shape[0]
    size = generator.shape[0]
    contacts = model.contacts
    for contact in range(contacts.row.shape[0]):
        row, column = np.zeros(size), np.zeros(size)
        for i in range(n):
            row[i] = contacts.reach[contact, i] * unit[i]
            column[n + i] = contacts.kick[contact, i] / unit[n + i]
        for k in range(LANES):
            if k > 0:
                row = np.dot(row, generator) / k
                column = np.dot(generator, column) / k
            for j in range(size):
                series[contact, places[j], k] = row[j] / unit[j]
            for half in range(2):
                out = impulses[contact, k, half * n_rows :]
                for i in range(n):
                    out[i] = column[half * n + i] * unit[half * n + i]
                for extra in range(n_rows - n):
                    value = 0.0
                    for j in range(n):
                        value += model.rows[extra, j] * out[j]
                    out[n + extra] = value
