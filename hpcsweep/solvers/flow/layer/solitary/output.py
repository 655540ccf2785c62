"""Displacements and velocities along a step with one contact in its layer, for `observation`."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, store
from hpcsweep.solvers.flow.linear.polynomials import evaluate, expand_row
from hpcsweep.solvers.flow.rules.solitary_rule import N_NODES, RESPONSES
from hpcsweep.solvers.flow.rules.tableau import NODES as STAGE_NODES
from hpcsweep.solvers.flow.state.augmented import start
from hpcsweep.solvers.flow.state.tables import ZERO


@inlined
def dense_output(contact, index, linear, h, z, model, tables, work):
    """Write displacements and velocities at the stages of `scheme` into ``work.layer``.

    The linear motion is that of the table `index`, without this contact; the response to its whole
    force is a sum of powers of time. With the spring's stiffness `linear` within the motion these
    sums would not converge on a long step in a wide layer, where beta h^2 is up to 13.
    """
    solitary, stage, rows = work.solitary, work.layer, work.rows
    x, forces, moments = work.x, solitary.free, solitary.moments
    for block in range(0, N_NODES, LANES):
        whole = fma(load(solitary.x, block), linear, load(solitary.forces, block))
        store(forces, block, whole)
    n = model.stiffness.shape[0]
    start(x, z, work.forcing)
    factor = h
    for m in range(LANES):
        combine(
            moments,
            m * LANES,
            ZERO,
            0,
            factor,
            RESPONSES,
            m * N_NODES * LANES,
            LANES,
            forces,
            0,
            N_NODES,
        )
        factor *= h
    sigma = fma(load(STAGE_NODES, 0), 2.0 * h / tables.h[index], load(ZERO, 0) - 1.0)
    for row in range(2 * n):
        expand_row(tables.poly, index, row, x, rows)
        value = evaluate(rows[row], sigma)
        for m in range(LANES):
            moved = tables.impulses[index, contact, m, row]
            value = fma(load(moments, m * LANES), -moved, value)
        if row < n:
            store(stage.u, row * LANES, value)
        else:
            store(stage.v, (row - n) * LANES, value)
