"""Motion along parts of a step in modes, for what is gathered, at the nodes of collocated steps.

The forces of a step are polynomials, so that a mode's coordinate and speed at any time are sums of
their values at the nodes, by tables of a length of step. A step is planned for 16 nodes, with E = 3
(`scheme`); on its halves E is 4 or more, on its quarters as on a collocated one.
"""

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, store
from hpcsweep.solvers.flow.layer.volterra.tables import have_part
from hpcsweep.solvers.flow.rules.volterra_rule import N_NODES
from hpcsweep.solvers.flow.state.tables import ZERO


@kernel
def write_part(part, h, level, model, spectrum, own, u, v):
    """Write displacements and velocities of all rows at the nodes of a part of the last step.

    `part` is its place in `volterra_rule.PARTS`, h and `level` are of the whole step.
    """
    have_part(part, level, h, model, spectrum, own)
    modes, seen, drive, forces = own.before, own.seen, own.drive, own.forces
    (n, width), r, count = spectrum.to_modes.shape, own.last[0], own.drive.shape[0]
    rows = count * LANES
    for p in range(N_NODES + 2, count):
        drive[p] = modes[2 * width + p - N_NODES - 2]
    for j in range(n):
        for block in range(0, N_NODES, LANES):
            push = load(ZERO, 0)
            for i in range(r):
                kick = spectrum.kicks[own.which[i], j]
                push = fma(load(forces, i * N_NODES + block), kick, push)
            store(drive, block, push)
        drive[N_NODES], drive[N_NODES + 1] = modes[j], modes[width + j]
        first, at = ((level * seen.shape[1] + part) * n + j) * 2 * rows, j * LANES
        combine(own.motion, at, ZERO, 0, 1.0, seen, first, LANES, drive, 0, count)
        combine(own.speeds, at, ZERO, 0, 1.0, seen, first + rows, LANES, drive, 0, count)
    for row in range(u.shape[0]):
        at, shape = row * LANES, row * width
        combine(u, at, ZERO, 0, 1.0, own.motion, 0, LANES, spectrum.shapes, shape, n)
        combine(v, at, ZERO, 0, 1.0, own.speeds, 0, LANES, spectrum.shapes, shape, n)
