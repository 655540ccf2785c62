r"""Absolute accelerations of the floors along the linear motion: tables of a contact set.

A floor's absolute acceleration is q = u'' + g G with g = -f where a base shakes (f = -1), that is
what its springs, dampers and contacts do,

    u'' + g G = -M^-1 K u - M^-1 C u' - sum_k (beta_k x_k + drag_k x_k') e_k + (f + g) G,

so that q = l . (y, y') + c, with l and c of the contact set, does not jump with G'. Where forces
act instead (g = 0) the last term is left, and the polynomial of u'' along a step is the derivative
of that of u'. With x' = M x of `tables` q has the slope l . (y', y'') + (f + g) G', linear in the
augmented state x, too. A table holds the rows of values and slopes, the polynomials of q on a step,
and bounds of |q''''| from these: what the Hermite bound of `search` needs to tell that a peak
cannot be exceeded.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES
from hpcsweep.model.kernel_contacts import DRAG
from hpcsweep.solvers.flow.linear.propagators import max_fourth_derivative
from hpcsweep.solvers.flow.state.state import contact_bit
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS


@inlined
def fill_outputs(index, model, tables, outputs):
    """Fill table `index` of the accelerations for the contact set of that of the motion, once."""
    if not (outputs.filled[index] and outputs.key[index] == tables.keys[index]):
        _fill(index, model, tables, outputs)


@kernel
def _fill(index, model, tables, outputs):
    """Fill table `index` of the accelerations."""
    key = tables.keys[index]
    outputs.filled[index], outputs.key[index] = True, key
    rows, n_rows = outputs.accelerations, model.stiffness.shape[0]
    _write_accelerations(key, model, rows)
    _write_pairs(rows, model, outputs.pair[index])
    poly, h = tables.poly[index], tables.h[index]
    loads = poly.shape[1] - 1 - model.elements.stiffness.shape[0]
    for i in range(model.ground.shape[0]):
        own = outputs.poly[index, i]
        for column in range(poly.shape[1]):
            for c in range(N_COEFFICIENTS):
                own[column, c] = 0.0
            if model.forcing[i] + model.ground[i] != 0.0:
                differentiate(poly[n_rows + i, column], h, own[column])
            else:
                for j in range(2 * n_rows):
                    if rows[i, j] != 0.0:
                        for c in range(N_COEFFICIENTS):
                            own[column, c] += rows[i, j] * poly[j, column, c]
                if column >= loads:
                    own[column, 0] += rows[i, column]
            outputs.bound4[index, column, i] = max_fourth_derivative(own[column], h)


@inlined
def differentiate(polynomial, h, out):
    """Write the time derivative of a polynomial of a step of length h into `out`."""
    for c in range(N_COEFFICIENTS - 1):
        out[c] = (c + 1) * polynomial[c + 1] * (2.0 / h)
    out[N_COEFFICIENTS - 1] = 0.0


@kernel
def _write_accelerations(key, model, out):
    """Write y'' of all rows as rows of the augmented state."""
    n_rows = model.stiffness.shape[0]
    contacts = model.contacts
    last, elements = out.shape[1] - 1, model.elements
    loads = last - elements.stiffness.shape[0]
    for i in range(n_rows):
        for j in range(n_rows):
            out[i, j] = -model.stiffness[i, j]
            out[i, n_rows + j] = -model.damping[i, j]
        for pair in range(2 * n_rows, loads, 2):
            out[i, pair], out[i, pair + 1] = model.forcing[i], 0.0
        out[i, last] = 0.0
        for k in range(contacts.row.shape[0]):
            if key & contact_bit(k) != np.uint64(0):
                push = contacts.beta[k] * contacts.kick[k, i]
                out[i, contacts.row[k]] -= push * contacts.sign[k]
                drag = contacts.edges[k, DRAG] * contacts.kick[k, i]
                out[i, n_rows + contacts.row[k]] -= drag * contacts.sign[k]
                out[i, last] += push * contacts.gap[k]
        for j in range(elements.stiffness.shape[0]):
            push = elements.stiffness[j] * elements.kick[j, i]
            out[i, loads + j] = push
            if key & contact_bit(contacts.row.shape[0] + j):
                for k in range(elements.reach.shape[1]):
                    out[i, k] += push * elements.reach[j, k]


@kernel
def _write_pairs(rows, model, pair):
    """Write the columns of values and slopes."""
    n_rows = rows.shape[0]
    last = pair.shape[0] - 1
    loads = last - model.elements.stiffness.shape[0]
    for i in range(model.ground.shape[0]):
        value_at = i + i // LANES * LANES
        slope_at = value_at + LANES
        for column in range(last + 1):
            forced = 2 * n_rows <= column < loads
            value = rows[i, column] if not forced else 0.0
            slope = rows[i, column - n_rows] if n_rows <= column < 2 * n_rows else 0.0
            for j in range(n_rows):
                slope += rows[i, n_rows + j] * rows[j, column]
            pair[column, value_at], pair[column, slope_at] = value, slope
        # of a harmonic the pair (sine, cosine), of a ramp (G, G')
        own = model.forcing[i] + model.ground[i]
        for h in range((loads - 2 * n_rows) // 2):
            at = 2 * n_rows + 2 * h
            rate = 1.0
            if h < model.harmonics.shape[0]:
                rate = model.harmonics[h, 0] * model.omega
            pair[at, value_at] += own
            pair[at + 1, slope_at] += own * rate
