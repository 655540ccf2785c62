"""Steps with one contact alone in its layer: exact except for its force, an integral equation.

`equation` derives and solves it, with its tangent map, from `tables` that are built when a length
of step first occurs and kept in `state.responses`; `rules.solitary_rule` has their nodes. `plan`
chooses the length, `output` gives the motion along it, `step` combines them.
"""
