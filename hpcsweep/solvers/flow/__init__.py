"""The exact flow map: one forcing period of the impacting structure, to rounding where it can.

`tables` propagates the linear motion between contact changes, `search` finds the first contact
change with a proof that none is stepped over, `crossing` takes a floor through its contact layer
in closed form when it is fast, `layer` integrates what is slow or grazing, `period` puts them
together, `march` takes periods in a row, `approach` finds the orbit at the end of a transient,
`metrics` gathers maxima and means over continuous time, and `flow_map` is the solver.
"""

from hpcsweep.solvers.flow.flow_map import FlowMap

__all__ = ["FlowMap"]
