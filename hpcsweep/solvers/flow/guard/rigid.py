r"""Guards of rigid contacts: of one that has just bounced, and the reaction of one that rests.

A hop starts at the stop, x = 0, with x' < 0. Rounding of the displacement would hide where it lands
to its size over the speed; x over the time since then rises through 0 there as well, as fast as the
acceleration is, and starts with the speed of the state.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import local_matrix
from hpcsweep.model.elements import SPEED, SPRING
from hpcsweep.model.observed import ROUNDING
from hpcsweep.solvers.flow.state.state import approach_speed, distance
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.flow.step.constraint import is_rigid
from hpcsweep.solvers.flow.step.forcing import n_pairs
from hpcsweep.solvers.flow.step.polynomials import fourth_derivative, integral, value_and_slope
from hpcsweep.solvers.flow.step.series import renew
from hpcsweep.solvers.flow.step.spectral import write_forcing
from hpcsweep.solvers.flow.step.step import expand

LOCAL = N_COEFFICIENTS - 2
"""Degree of what mends a polynomial near its start alone, the highest once it is divided."""


@inlined
def is_reaction(guard):
    """Return whether a guard is that of a rigid contact that rests."""
    return guard[SPRING] == 0.0 and guard[SPEED] == 0.0


@inlined
def hops(k, x, contacts):
    """Return whether a rigid contact is at its stop in a state and does not close."""
    at = is_rigid(k, contacts) and distance(k, x, contacts) == 0.0
    return at and approach_speed(k, x, contacts) <= 0.0


@kernel
def divide_by_time(slope, h, rows):
    """Divide polynomial 0, which starts at 0 with a slope but for rounding, by 2 s / h, in place.

    Without a slope, of a contact that has been let go, it starts as far below 0 as rounding tells.
    What the slope of the polynomial has of that is its own near the end alone: what mends it there,
    times (1 - s / h)^14, leaves the rest as exact as the polynomial is.

    Returns
    -------
    float
        Bound of its fourth derivative.
    """
    above = 0.0
    for p in range(N_COEFFICIENTS - 1, 0, -1):
        above, rows[0, p] = rows[0, p] - above, above
    rows[0, 0] = above
    start = 0.5 * h * slope if slope < 0.0 else -ROUNDING
    term = (start - value_and_slope(rows, 0, h, 0.0)[0]) * 0.5**LOCAL
    for p in range(LOCAL + 1):
        rows[0, p] += term
        term *= -(LOCAL - p) / (p + 1.0)
    return fourth_derivative(rows, h)


@kernel
def write_reaction(k, releases, segment, model, tables, step, out):
    """Write the reaction m_k of a contact that rests along the present step into polynomial 0.

    With `releases` what rises through 0 where it ends, -m_k over the size of what it is made of.

    Returns
    -------
    float
        Bound of its fourth derivative.
    """
    size, last = step.z_end.shape[0], step.x.shape[0]
    renew(segment.key, model, step.series)
    shares, scale = step.series.reactions[k], 0.0
    write_forcing(segment.h, step.x, size, model, out[0])
    for p in range(N_COEFFICIENTS):
        out[0, p] *= shares[size]
        scale += abs(out[0, p])
    for row in range(size):
        if shares[row] != 0.0:
            expand(row, segment, tables, step)
            for p in range(N_COEFFICIENTS):
                out[0, p] += shares[row] * step.rows[row, p]
                scale += abs(shares[row] * step.rows[row, p])
    for i in range(size + n_pairs(model), last):
        out[0, 0] += shares[i] * step.x[i]
    for p in range(N_COEFFICIENTS if releases and scale > 0.0 else 0):
        out[0, p] /= -scale
    return fourth_derivative(out, segment.h)


@inlined
def reaction_on_segment(k, segment, span, model, tables, step):
    """Return the integral of the reaction of a contact over the first `span` of a step."""
    rows = local_matrix(1, N_COEFFICIENTS)
    write_reaction(k, False, segment, model, tables, step, rows)
    return integral(rows, 0, segment.h, span)
