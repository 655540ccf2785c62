"""Taylor series of the linear motion of one contact set, about any of its states.

With x' = M x of `tables` and e the unit impulse of a contact (it moves velocities, d . e = 1)::

    d . u(s) = sum_k s^k (d M^k / k!) x,        exp(M s) e = sum_k s^k M^k e / k!

The first is the distance of a contact, the second the effect at time s of an impulse at time 0.
"""

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES


@kernel
def place_of(k, n, n_rows):
    """Return where component k of n coordinates lies in an augmented state of all rows."""
    if k < n:
        return k
    return k + n_rows - n if k < 2 * n else k + 2 * (n_rows - n)


@kernel
def build_series(generator, vectors, model, series, impulses):
    """Fill both series of all contacts for one contact set.

    Parameters
    ----------
    generator : ndarray, shape (2n + 2H + 1, padded)
        M, balanced.
    vectors : ndarray, shape (3, 2n + 2H + 1)
        The units of the balanced state; the others are workspace.
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
    unit, vector, spare = vectors[0], vectors[1], vectors[2]
    for contact in range(contacts.row.shape[0]):
        for i in range(size):
            vector[i] = contacts.reach[contact, i] * unit[i] if i < n else 0.0
        for k in range(LANES):
            if k > 0:
                for j in range(size):
                    spare[j] = 0.0
                for i in range(size):
                    for j in range(size):
                        spare[j] += vector[i] * generator[i, j]
                for j in range(size):
                    vector[j] = spare[j] / k
            for j in range(size):
                series[contact, place_of(j, n, n_rows), k] = vector[j] / unit[j]
        for i in range(size):
            vector[i] = contacts.kick[contact, i - n] / unit[i] if n <= i < 2 * n else 0.0
        for k in range(LANES):
            if k > 0:
                for i in range(size):
                    spare[i] = 0.0
                    for j in range(size):
                        spare[i] += generator[i, j] * vector[j]
                for i in range(size):
                    vector[i] = spare[i] / k
            for half in range(2):
                first = half * n_rows
                for i in range(n):
                    impulses[contact, k, first + i] = vector[half * n + i] * unit[half * n + i]
                for extra in range(n_rows - n):
                    value = 0.0
                    for j in range(n):
                        value += model.rows[extra, j] * impulses[contact, k, first + j]
                    impulses[contact, k, first + n + extra] = value
