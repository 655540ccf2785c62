r"""What is watched along the linear motion, whose peaks can be asked for: tables of a contact set.

An output is q = l . (y, y') + c, with l and c of the contact set: drifts, displacements of floors,
absolute accelerations and distances of closed contacts past their stops. A floor's absolute
acceleration is u'' + g G with g = -f where a base shakes (f = -1), that is what its springs,
dampers and contacts do,

    u'' + g G = -M^-1 K u - M^-1 C u' - sum_k beta_k x_k e_k + (f + g) G,

so that it does not jump with G'. Where forces act instead (g = 0) the last term is left, and the
polynomial of u'' along a step is the derivative of that of u'. With x' = M x of `tables` an output
has the slope l . (y', y'') + (f + g) G', linear in the augmented state x, too. A table holds the
rows of values and slopes, and bounds of |q''''| on a step, from the polynomials of the motion: what
the Hermite bound of `search` needs to tell that a peak cannot be exceeded.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, combine_moduli
from hpcsweep.model.kernel_model import ACCELERATION, CONTACT
from hpcsweep.solvers.flow.linear.propagators import max_fourth_derivative
from hpcsweep.solvers.flow.state.contacts import contact_bit
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS, ZERO
from hpcsweep.solvers.flow.state.tally import PEAKS


@kernel
def fill_outputs(index, wanted, model, tables, outputs):
    """Fill table `index` of the outputs for the contact set of that of the motion, once."""
    key, wanted = tables.keys[index], wanted & PEAKS
    if outputs.filled[index] == wanted and outputs.key[index] == key:
        return
    outputs.filled[index], outputs.key[index] = wanted, key
    rows, constant = outputs.rows[index], outputs.constant[index]
    _write_functionals(key, wanted, model, rows, constant)
    _write_accelerations(key, model, outputs.accelerations)
    _write_pairs(rows, constant, outputs.accelerations, wanted, model, outputs.pair[index])
    poly, h = tables.poly[index], tables.h[index]
    coefficients = outputs.coefficients
    for p in range(rows.shape[0]):
        if model.watched[p, 3] & wanted == 0:
            continue
        forced = forced_row(p, model)
        for column in range(poly.shape[1]):
            for c in range(N_COEFFICIENTS):
                coefficients[c] = 0.0
            if forced >= 0:
                differentiate(poly[forced, column], h, coefficients)
            else:
                for j in range(rows.shape[1]):
                    if rows[p, j] != 0.0:
                        for c in range(N_COEFFICIENTS):
                            coefficients[c] += rows[p, j] * poly[j, column, c]
            outputs.bound4[index, column, p] = max_fourth_derivative(coefficients, h)


@inlined
def forced_row(p, model):
    """Return the row whose derivative output p is, -1 where l has all of it."""
    i = model.watched[p, 0]
    if model.watched[p, 3] == ACCELERATION and model.forcing[i] + model.ground[i] != 0.0:
        return model.stiffness.shape[0] + i
    return -1


@inlined
def differentiate(polynomial, h, out):
    """Write the time derivative of a polynomial of a step of length h into `out`."""
    for c in range(N_COEFFICIENTS - 1):
        out[c] = (c + 1) * polynomial[c + 1] * (2.0 / h)
    out[N_COEFFICIENTS - 1] = 0.0


@kernel
def _write_functionals(key, wanted, model, rows, constant):
    """Write l and c of all outputs that are wanted."""
    n, n_rows = model.modal_transform.shape[0], model.stiffness.shape[0]
    contacts = model.contacts
    k = 0
    for p in range(rows.shape[0]):
        constant[p] = 0.0
        for j in range(rows.shape[1]):
            rows[p, j] = 0.0
        i, below, side, flag = model.watched[p]
        if flag & wanted == 0:
            continue
        if flag == ACCELERATION:
            for j in range(n):
                rows[p, j] = -model.stiffness[i, j]
                rows[p, n_rows + j] = -model.damping[i, j]
            for other in range(contacts.row.shape[0]):
                if key & contact_bit(other) != np.uint64(0):
                    push = contacts.beta[other] * contacts.kick[other, i]
                    rows[p, contacts.row[other]] -= push * contacts.sign[other]
                    constant[p] += push * contacts.gap[other]
        elif flag == CONTACT:
            if key & contact_bit(k) != np.uint64(0):
                rows[p, i] = side
                constant[p] = -contacts.gap[k]
            k += 1
        else:
            rows[p, i] = 1.0
            if below >= 0:
                rows[p, below] = -1.0


@kernel
def _write_accelerations(key, model, out):
    """Write y'' of all rows as rows of the augmented state."""
    n_rows = model.stiffness.shape[0]
    contacts = model.contacts
    last = out.shape[1] - 1
    for i in range(n_rows):
        for j in range(n_rows):
            out[i, j] = -model.stiffness[i, j]
            out[i, n_rows + j] = -model.damping[i, j]
        for pair in range(2 * n_rows, last, 2):
            out[i, pair], out[i, pair + 1] = model.forcing[i], 0.0
        out[i, last] = 0.0
        for k in range(contacts.row.shape[0]):
            if key & contact_bit(k) != np.uint64(0):
                push = contacts.beta[k] * contacts.kick[k, i]
                out[i, contacts.row[k]] -= push * contacts.sign[k]
                out[i, last] += push * contacts.gap[k]


@kernel
def _write_pairs(rows, constant, accelerations, wanted, model, pair):
    """Write the columns of values and slopes."""
    n_rows = accelerations.shape[0]
    last = pair.shape[0] - 1
    for p in range(rows.shape[0]):
        value_at = p + p // LANES * LANES
        slope_at = value_at + LANES
        for column in range(last + 1):
            value = rows[p, column] if column < 2 * n_rows else 0.0
            slope = rows[p, column - n_rows] if n_rows <= column < 2 * n_rows else 0.0
            for j in range(n_rows):
                slope += rows[p, n_rows + j] * accelerations[j, column]
            pair[column, value_at], pair[column, slope_at] = value, slope
        pair[last, value_at] = constant[p]
        i, flag = model.watched[p, 0], model.watched[p, 3]
        if flag == ACCELERATION and flag & wanted != 0:
            # of a harmonic the pair (sine, cosine), of a ramp (G, G')
            own = model.forcing[i] + model.ground[i]
            for h in range((last - 2 * n_rows) // 2):
                at = 2 * n_rows + 2 * h
                rate = 1.0
                if h < model.harmonics.shape[0]:
                    rate = model.harmonics[h, 0] * model.omega
                pair[at, value_at] += own
                pair[at + 1, slope_at] += own * rate


@inlined
def look(index, x, wanted, model, outputs, out):
    """Write values and slopes of the outputs that are wanted in an augmented state."""
    pair = outputs.pair
    first = index * pair.shape[1] * pair.shape[2]
    for p in range(0, model.watched.shape[0], LANES):
        if model.watched[p, 3] & wanted != 0:
            for at in (2 * p, 2 * p + LANES):
                combine(out, at, ZERO, 0, 1.0, pair, first + at, pair.shape[2], x, 0, x.shape[0])


@inlined
def bound_outputs(index, x, p, outputs):
    """Write bounds of |q''''| of `LANES` outputs from p on, on a step from x."""
    table = outputs.bound4
    first = index * table.shape[1] * table.shape[2] + p
    combine_moduli(outputs.bounds, p, ZERO, 0, 1.0, table, first, table.shape[2], x, 0, x.shape[0])
