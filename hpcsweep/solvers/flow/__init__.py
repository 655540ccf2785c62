"""The exact flow map: one forcing period of the impacting structure, to rounding where it can.

`tables` propagates the linear motion between contact changes (`propagators` builds them), `events`
finds the first contact change with a proof (`search`) that none is stepped over, `passage` takes a
floor through its layer in closed form (`crossing`) when it is fast, `layer` integrates what is slow
or grazing, `period` puts them together, `march` takes periods in a row, `tangent` their derivative.
`transient` watches for the orbit at the end of a transient and `newton` jumps to it. `drift` and
`modal_norm` bring a `tally` of maxima and means over continuous time up to date (`gather`).
`shared` and `workspace` are what all of them have at hand, and `flow_map` is the solver.
"""

from hpcsweep.solvers.flow.flow_map import FlowMap

__all__ = ["FlowMap"]
