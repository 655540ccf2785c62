"""Tangent map of a collocation step: the variational equations at the stages of `scheme`."""

import math

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import fma, load, local_matrix, maximum, store
from hpcsweep.model.contact import (
    contact_stiffnesses,
)
from hpcsweep.solvers.flow.layer.scheme import (
    MAX_ITERATIONS,
    distances,
    integrals,
    iterations_needed,
    less_linear,
    replace,
    stages,
)
from hpcsweep.solvers.flow.rules.tableau import (
    N_STAGES,
    NODES,
)
from hpcsweep.solvers.flow.state.state import is_oblique

CONVERGED = 1e-13
"""Last change of the stage accelerations, or the next one, relative."""


@inlined
def layer_tangent(h, model, work, tangent):
    """Multiply `tangent` by the tangent map of one collocation step, in place.

    The first guess is the acceleration of the variation without acceleration, the first iterate
    from 0. The last iteration is checked; its result is better than its change.

    Parameters
    ----------
    h : float
    work : LayerWorkspace
        As left by `scheme.collocate`; overwritten.
    tangent : ndarray, shape (2R, m)
    """
    u, v, g, n, contacts = work.u, work.v, work.g, work.u.shape[0], model.contacts
    fresh, spring = local_matrix(n, N_STAGES), local_matrix(contacts.row.shape[0], N_STAGES)
    free, speeds = local_matrix(n, N_STAGES), local_matrix(n, N_STAGES)
    hardest = 0.0
    for k in range(contacts.row.shape[0]):
        beta = contacts.beta[k]
        stiffest = beta * work.active[k]
        if work.active[k] == 2:
            stiff = contact_stiffnesses(distances(k, u, contacts), beta, model.rho)
            store(spring, k * N_STAGES, stiff)
            stiffest = maximum(stiff)
        else:
            store(spring, k * N_STAGES, stiffest)
        hardest = hardest + max(stiffest, 0.0) if is_oblique(contacts) else max(hardest, stiffest)
    unchecked, least_ratio = iterations_needed(h * h * (model.stiffness_bound + hardest))
    for column in range(tangent.shape[1]):
        for i in range(n):
            row = i * N_STAGES
            store(free, row, fma(load(NODES, 0), h * tangent[n + i, column], tangent[i, column]))
            store(speeds, row, tangent[n + i, column])
        _variations(free, speeds, spring, model, g)
        for _ in range(unchecked - 2):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, model, g)
        ratio = least_ratio
        previous = math.inf
        for _ in range(MAX_ITERATIONS):
            stages(h, free, speeds, g, u, v)
            _variations(u, v, spring, model, fresh)
            change, largest = replace(g, fresh)
            if previous < math.inf:
                ratio = change / previous
            if change * min(ratio, 1.0) <= CONVERGED * largest:
                break
            previous = change
        for i in range(n):
            du, dv = integrals(g, i)
            tangent[i, column] += h * (tangent[n + i, column] + h * du)
            tangent[n + i, column] += h * dv


@inlined
def _variations(u, v, spring, model, out):
    """Write the accelerations of a variation with stages u, v; all (R, N_STAGES)."""
    contacts = model.contacts
    for i in range(u.shape[0]):
        row = i * N_STAGES
        k = contacts.solo[i]
        force = load(u, row) * 0.0
        if k >= 0:
            force = -1.0 * load(spring, k * N_STAGES) * load(u, row)
        store(out, row, less_linear(force, i, u, v, model))
    for other in range(contacts.others.shape[0]):
        k = contacts.others[other]
        stretched = load(u, contacts.row[k] * N_STAGES) * contacts.sign[k]
        force = -1.0 * load(spring, k * N_STAGES) * stretched
        for p in range(contacts.first[k], contacts.first[k + 1]):
            row = contacts.push_row[p] * N_STAGES
            store(out, row, load(out, row) + force * contacts.push[p])
