r"""What rigid contacts do to rows: impulses at an instant, reactions while they rest.

With e_k = M^-1 d_k / (d_k . M^-1 d_k), as in `hpcsweep.model.kernel_model`, a set of contacts takes
from velocities, or from accelerations, the combination sum_k m_k e_k after which their own are what
is asked for: values that change by c_j need

    sum_k (d_j . e_k) m_k = c_j.

Of contacts that rest c_j = d_j . a, a the accelerations without their reactions; a - sum m_k e_k is
the field of a linear motion of its own, and m_k, the reaction over the mass that the contact feels,
is a row of the augmented state as any acceleration is.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_matrix, local_vector
from hpcsweep.solvers.flow.state.state import contact_bit, is_oblique

DEPENDENT = 1e-12
"""Part of its own that is left of a contact beside others which it hardly differs from."""


@inlined
def is_rigid(k, contacts):
    """Return whether a contact is rigid."""
    return k < contacts.bounce.shape[0] and contacts.bounce[k] >= 0.0


@inlined
def rigid_of(some, contacts):
    """Return the rigid contacts of a set."""
    rigid = np.uint64(0)
    for k in range(contacts.bounce.shape[0]):
        rigid |= contact_bit(k) if contacts.bounce[k] >= 0.0 else np.uint64(0)
    return some & rigid


@kernel
def solve_for(some, contacts, values):
    """Solve sum_k (d_j . e_k) m_k = values_j for the contacts of a set, in place.

    The matrix is that of d_j . M^-1 d_k with scaled columns, of which the pivots are at least 0;
    a contact that does not differ from those before gets 0, as do those not of the set.
    """
    m = values.shape[0]
    matrix = local_matrix(m, m)
    for j in range(m):
        inside = some & contact_bit(j) != np.uint64(0)
        if not inside:
            values[j] = 0.0
        for k in range(m):
            matrix[j, k] = 0.0
            if inside and some & contact_bit(k) != np.uint64(0):
                oblique = contacts.oblique[j, k] if is_oblique(contacts) else 0.0
                matrix[j, k] = 1.0 if j == k else oblique
    for p in range(m):
        if matrix[p, p] <= DEPENDENT:
            continue
        for j in range(p + 1, m):
            factor = matrix[j, p] / matrix[p, p]
            for k in range(p + 1, m):
                matrix[j, k] -= factor * matrix[p, k]
            values[j] -= factor * values[p]
    for p in range(m - 1, -1, -1):
        for k in range(p + 1, m):
            values[p] -= matrix[p, k] * values[k]
        values[p] = values[p] / matrix[p, p] if matrix[p, p] > DEPENDENT else 0.0


@kernel
def take_out(some, bounces, contacts, vector, values):
    """Take from a vector of all rows what the contacts of a set take of it, into `values`.

    After that they have 0, or with `bounces` -e of what they had.
    """
    for k in range(values.shape[0]):
        factor = 1.0 + contacts.bounce[k] if bounces else 1.0
        values[k] = factor * contacts.sign[k] * vector[contacts.row[k]]
    solve_for(some, contacts, values)
    push(values, contacts, vector)


@kernel
def push(values, contacts, vector):
    """Take e_k times these values from a vector of all rows."""
    for k in range(values.shape[0]):
        if values[k] != 0.0:
            for p in range(contacts.first[k], contacts.first[k + 1]):
                vector[contacts.push_row[p]] -= contacts.push[p] * values[k]


@kernel
def constrain_field(key, model, field, reactions):
    """Take reactions of a set out of its field, y'' of all rows by columns, and write them."""
    contacts = model.contacts
    resting, values = rigid_of(key, contacts), local_vector(contacts.row.shape[0])
    if resting == np.uint64(0):
        return
    for column in range(field.shape[0]):
        take_out(resting, False, contacts, field[column], values)
        for k in range(values.shape[0]):
            reactions[k, column] = values[k]


@kernel
def constrain_generator(key, model, out):
    """Take the same out of a generator, as `generator.write_generator` has it."""
    contacts, unit, n = model.contacts, model.balance, model.modal_transform.shape[0]
    resting, values = rigid_of(key, contacts), local_vector(contacts.row.shape[0])
    if resting == np.uint64(0):
        return
    for column in range(out.shape[1]):
        for k in range(values.shape[0]):
            values[k] = 0.0
            for i in range(n):
                values[k] += contacts.reach[k, i] * unit[i] * out[n + i, column]
        solve_for(resting, contacts, values)
        for k in range(values.shape[0]):
            for i in range(n):
                out[n + i, column] -= contacts.kick[k, i] / unit[i] * values[k]
