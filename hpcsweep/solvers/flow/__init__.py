"""The exact flow map: one forcing period of the impacting structure, to rounding where possible.

A folder is a concept, and uses those named before it. `rules` are constants of numerical rules,
`state` is what lasts between calls. `step` is a stretch of smooth motion, and answers what is asked
of one (`step.step`). `guard` is a row at whose zero a step ends: the edge of a layer, a stop, a
slip; the first is found, with a proof that none is stepped over. `observe` takes maxima and means
over continuous time from the rows of steps, `layer` takes contacts through their layers, in closed
form or in steps. `march` is the one loop, over forcing periods and sample intervals
(`march.interval`), `orbit` watches for the end of a transient and jumps to the orbit. `specialised`
chooses the kernels, and `flow_map` is the solver.
"""

from hpcsweep.solvers.flow.flow_map import FlowMap

__all__ = ["FlowMap"]
