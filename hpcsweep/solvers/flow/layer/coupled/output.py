"""Motion along a step in modes, for what is gathered, as steps that are collocated at 8 nodes.

With the polynomials of all forces the responses of modes are sums of powers of the time left, as
the terms of S_j and S_j' are. A step is planned for 16 nodes, with E = 3 (`scheme`); a collocated
one, with E = 5.5, would be 2.9 times as short: four parts serve all measures. Contact set and drift
take two, on which E is 4 or more.
"""

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.simd.vectors import LANES, combine, fma, load, store
from hpcsweep.solvers.flow.layer.coupled.equation import sum_at
from hpcsweep.solvers.flow.rules.solitary_rule import (
    N_NODES,
    N_POWERS,
    PART_NODES,
    PART_RESPONSES,
)
from hpcsweep.solvers.flow.state.tables import ZERO


@kernel
def _write_moments(part, h, own):
    """Write the integrals of each force times powers of the time left, at the nodes of a part."""
    last = own.forces.shape[0] - 1
    for force in range(own.last[0] + 1):
        i = force if force < own.last[0] else last
        for m in range(N_POWERS):
            at, first = (i * N_POWERS + m) * LANES, (part * N_POWERS + m) * N_NODES * LANES
            table, forces, place = PART_RESPONSES, own.forces, i * N_NODES
            combine(own.moments, at, ZERO, 0, h, table, first, LANES, forces, place, N_NODES)


@kernel
def write_part(part, h, level, spectrum, own, u, v):
    """Write displacements and velocities of all rows at the nodes of a part of the last step.

    `part` is its place in `solitary_rule.PARTS`, h and `level` are of the whole step.
    """
    modes, motion, speeds, width = own.before, own.motion, own.speeds, spectrum.squares.shape[0]
    _write_moments(part, h, own)
    r, last, nodes = own.last[0], own.forces.shape[0] - 1, load(PART_NODES, part * LANES)
    for j in range(width):
        terms = own.powers[level, j]
        s, d = sum_at(nodes, terms)
        q, p = modes[j], modes[width + j]
        value = fma(s, fma(-spectrum.rates[j], q, p), d * q)
        slope = fma(s, -spectrum.squares[j] * q, d * p)
        for m in range(N_POWERS):
            push = load(own.moments, (last * N_POWERS + m) * LANES) * spectrum.forcing[j]
            for i in range(r):
                kick = spectrum.kicks[own.which[i], j]
                push = fma(load(own.moments, (i * N_POWERS + m) * LANES), kick, push)
            value = fma(push, -terms[0, m], value)
            slope = fma(push, -terms[1, m], slope)
        store(motion, j * LANES, value)
        store(speeds, j * LANES, slope)
    for row in range(u.shape[0]):
        at, shape = row * LANES, row * width
        combine(u, at, ZERO, 0, 1.0, motion, 0, LANES, spectrum.shapes, shape, width)
        combine(v, at, ZERO, 0, 1.0, speeds, 0, LANES, spectrum.shapes, shape, width)
