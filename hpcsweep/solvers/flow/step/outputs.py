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

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, local_matrix
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.flow.step.propagators import max_fourth_derivative
from hpcsweep.solvers.flow.step.series import write_field


@inlined
def fill_outputs(index, model, tables, outputs):
    """Fill table `index` of the accelerations for the contact set of that of the motion, once."""
    if outputs.key[index] != tables.keys[index]:
        _fill(index, model, tables, outputs)


@kernel
def _fill(index, model, tables, outputs):
    """Fill table `index` of the accelerations."""
    key = tables.keys[index]
    outputs.key[index] = key
    n_rows = model.stiffness.shape[0]
    rows = local_matrix(outputs.pair.shape[1], n_rows)
    write_field(key, model, rows)
    _write_pairs(rows, model, outputs.pair[index])
    poly, h = tables.poly[index], tables.h[index]
    loads = poly.shape[1] - 1 - model.elements.stiffness.shape[0]
    for i in range(model.ground.shape[0]):
        polynomial = outputs.poly[index, i]
        for column in range(poly.shape[1]):
            for c in range(N_COEFFICIENTS):
                polynomial[column, c] = 0.0
            if model.forcing[i] + model.ground[i] != 0.0:
                differentiate(poly[n_rows + i, column], h, polynomial[column])
            else:
                for j in range(2 * n_rows):
                    if rows[j, i] != 0.0:
                        for c in range(N_COEFFICIENTS):
                            polynomial[column, c] += rows[j, i] * poly[j, column, c]
                if column >= loads:
                    polynomial[column, 0] += rows[column, i]
            outputs.bound4[index, column, i] = max_fourth_derivative(polynomial[column], h)


@inlined
def differentiate(polynomial, h, out):
    """Write the time derivative of a polynomial of a step of length h into `out`."""
    for c in range(N_COEFFICIENTS - 1):
        out[c] = (c + 1) * polynomial[c + 1] * (2.0 / h)
    out[N_COEFFICIENTS - 1] = 0.0


@kernel
def _write_pairs(rows, model, pair):
    """Write the columns of values and slopes."""
    n_rows = rows.shape[1]
    last = pair.shape[0] - 1
    loads = last - model.elements.stiffness.shape[0]
    for i in range(model.ground.shape[0]):
        value_at = i + i // LANES * LANES
        slope_at = value_at + LANES
        for column in range(last + 1):
            forced = 2 * n_rows <= column < loads
            value = rows[column, i] if not forced else 0.0
            slope = rows[column - n_rows, i] if n_rows <= column < 2 * n_rows else 0.0
            for j in range(n_rows):
                slope += rows[n_rows + j, i] * rows[column, j]
            pair[column, value_at], pair[column, slope_at] = value, slope
        # of a harmonic the pair (sine, cosine), of a ramp (G, G')
        total = model.forcing[i] + model.ground[i]
        for h in range((loads - 2 * n_rows) // 2):
            at = 2 * n_rows + 2 * h
            rate = 1.0
            if h < model.harmonics.shape[0]:
                rate = model.harmonics[h, 0] * model.omega
            pair[at, value_at] += total
            pair[at + 1, slope_at] += total * rate
