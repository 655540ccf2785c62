"""The exact flow map: one forcing period of the impacting structure, to rounding where possible.

A room uses those named before it: `rules` are constants of numerical rules, `state` holds the
kernels' data. `linear` makes steps of the motion between changes and answers what is asked of them
(`linear.step`), `search` finds the first contact that reaches its layer, with a proof that none is
stepped over. `passage` takes a contact through its layer in closed form, `observe` updates maxima
and means over continuous time, `layer` integrates slow and grazing motions. `elements` are the
modes and guards of dashpots, sliders and limits. `period` is the one march, over forcing periods
and sample intervals (`period.interval`), `orbit` watches for the end of a transient and jumps to
the orbit. `specialised` chooses the kernels, and `flow_map` is the solver.
"""

from hpcsweep.solvers.flow.flow_map import FlowMap

__all__ = ["FlowMap"]
