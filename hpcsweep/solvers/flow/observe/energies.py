"""Integrals of the energy over a step, by the polynomials of its rows (`step.step`)."""

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import fma
from hpcsweep.solvers.flow.state.tables import MODAL_NODES, MODAL_WEIGHTS, N_MODAL
from hpcsweep.solvers.flow.step.polynomials import evaluate
from hpcsweep.solvers.flow.step.step import expand


@kernel
def energies_on_segment(segment, span, tables, tally, step):
    """Add the integrals of u_i' u_j' and of G u_i' over the first `span` of a step, exactly."""
    v, size, n = step.a_end, step.z_end.shape[0], tally.energy.shape[1]
    for row in range(size):
        expand(row, segment, tables, step)
    for node in range(N_MODAL):
        s = 0.5 * span * (MODAL_NODES[node] + 1.0)
        weight = 0.5 * span * MODAL_WEIGHTS[node]
        ground = fma(s, step.x[size + 1], step.x[size])
        for i in range(n):
            v[i] = evaluate(step.rows[size // 2 + i], fma(s, 2.0 / segment.h, -1.0))
            tally.energy[n, i] += weight * ground * v[i]
        for i in range(n):
            for j in range(n):
                tally.energy[i, j] += weight * v[i] * v[j]
