"""Tangent map of half a slow passage (`slow_passage`).

A variation of the distance is that of the linear motion plus the response to the variations r'(x)
dx of the force, at the nodes of the passage.
"""

import math

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, MATRIX, entry_point
from hpcsweep.kernels.simd.vectors import LANES, fma, greatest, load, maximum, modulus, store
from hpcsweep.solvers.flow.passage.slow_passage import expand_series, respond, sum_up
from hpcsweep.solvers.flow.rules.passage_rule import N_NODES
from hpcsweep.solvers.flow.state.shared import read_shared

TANGENT_SWEEPS = 7
SETTLED = 1e-10
"""Change after which one more sweep is the last, relative."""


@entry_point(INT, FLOAT, INT, INT, MATRIX, BYTES, inner=True, specialises=True)
def half_tangent(direction, index, contact, tangent, shared):
    """Multiply `tangent` by the tangent map of the half taken last by `cross_half`.

    Parameters
    ----------
    direction, index, contact, shared
        As in `cross_half`.
    tangent : ndarray, shape (2R, m)

    Returns
    -------
    int
        m
    """
    common = read_shared(shared)
    tangent = as_long_as(tangent, common.previous)
    model, tables, workspace = common.model, common.tables, common.work
    work = workspace.departing if direction > 0.0 else workspace.arriving
    contacts = model.contacts
    place = index * contacts.row.shape[0] + contact
    size = tangent.shape[0]
    x, forces, moved, shares = work.x, work.forces, work.moved, work.shares
    for i in range(size, x.shape[0]):
        x[i] = 0.0
    for column in range(tangent.shape[1]):
        for i in range(size):
            x[i] = tangent[i, column]
        expand_series(direction, 1.0, place * x.shape[0] * LANES, x, tables, work)
        for block in range(0, N_NODES, LANES):
            t = load(work.times, block)
            value = t * 0.0 + work.series[LANES - 1]
            for k in range(LANES - 2, -1, -1):
                value = fma(value, t, work.series[k])
            store(shares, block, value)
            store(moved, block, value)
        largest = maximum(greatest(modulus(load(moved, 0)), modulus(load(moved, LANES))))
        change = math.inf
        for sweep in range(TANGENT_SWEEPS):
            for block in range(0, N_NODES, LANES):
                store(forces, block, load(work.slopes, block) * load(moved, block))
            if sweep == TANGENT_SWEEPS - 1 or change <= SETTLED * largest:
                break
            change = respond(forces, shares, work)
        sum_up(direction, place * LANES * tables.impulses.shape[3], tables, work)
        for i in range(size):
            tangent[i, column] += work.kicked[i]
    return tangent.shape[1]
