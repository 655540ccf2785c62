"""The error of a collocation step (`scheme`).

The error of the velocity is the error of the Gauss rule along the collocation polynomial, and that
is measured by a rule of 17 points, exact to degree 16, which adds to the Gauss nodes the nodes of
Kronrod (Laurie, Math. Comp. 66 (1997) 1133) with the start of the step in place of the first. The
same difference with the weight 2 s - 1 detects residuals whose mean vanishes.
"""

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import fma, load, total
from hpcsweep.model.contact import contact_force, contact_forces
from hpcsweep.solvers.flow.layer.scheme import distances, weighted
from hpcsweep.solvers.flow.rules.tableau import (
    ADDED_SLOPE,
    CHECK_ADDED,
    CHECK_GAUSS,
    CHECK_NODES,
    CHECK_ROWS,
    CHECK_START,
    GAUSS_SLOPE,
)
from hpcsweep.solvers.flow.state.contacts import approach_speed, distance


@inlined
def quadrature_error(h, z, model, work):
    """Estimate the velocity error of the step from z that `collocate` has left in `work`.

    See the module. Only the forces of contacts inside their layers count: all others are
    linear, and resolved far better. That of the integral of each force is left in ``missed``.
    """
    contacts, rho = model.contacts, model.rho
    worst = 0.0
    for k in range(contacts.row.shape[0]):
        if work.active[k] != 2:
            continue
        sign, beta = contacts.sign[k], contacts.beta[k]
        x0 = distance(k, z, contacts)
        start = contact_force(x0, beta * CHECK_START, rho)
        gauss = contact_forces(distances(k, work.u, contacts), beta, rho) * load(CHECK_GAUSS, 0)
        x = fma(load(CHECK_NODES, 0), h * approach_speed(k, z, contacts), x0)
        x = fma(weighted(CHECK_ROWS, work.g, contacts.row[k]), h * h * sign, x)
        added = contact_forces(x, beta, rho) * load(CHECK_ADDED, 0)
        mean = start + total(gauss + added)
        slope = total(gauss * load(GAUSS_SLOPE, 0) + added * load(ADDED_SLOPE, 0)) - start
        worst = max(worst, max(abs(mean), abs(slope)) * contacts.gain[k])
        work.missed[k] = h * abs(mean)
    return h * worst
