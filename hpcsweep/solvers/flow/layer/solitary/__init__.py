"""Steps with one contact alone in its layer: exact but for its force, an integral equation.

`equation` derives and solves it, with its tangent map, from `tables` that are made when a length of
step first occurs and kept in a `store`; `rule` has their nodes. `plan` chooses the length, `output`
gives what is observed along it, `step` is the whole.
"""
