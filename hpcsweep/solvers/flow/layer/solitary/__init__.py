"""Steps with one contact alone in its layer: exact except for its force, an integral equation.

`equation` derives and solves it, with its tangent map, from `tables` that are built when a length
of step first occurs and kept in `state.responses`; `rules.solitary_rule` has their nodes. `plan`
chooses the length, `output` gives the motion along it, `step` combines them.

With all layer steps by `layer.scheme` instead, 20 frames with the damping as printed take 16 % more
processor time (18.53 s for 15.97 s).
"""
