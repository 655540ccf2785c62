"""Steps with a few contacts in their layers, on a rest that is solved in its modes.

`equation` derives and solves them, with their tangent map, from `tables` by the length of a step
alone; `plan` chooses the length, `step` takes the steps of a visit, `output` gives the motion along
one for its measures.
"""
