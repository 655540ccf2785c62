"""Steps with any few contacts in their layers at once, on a rest that is solved in its modes.

`equation` derives and solves them, with their tangent map, from tables by the length of a step
alone; `step` chooses the length and takes the steps of a visit, `output` gives the motion along one
for its measures.
"""
