"""Steps with a few contacts in their layers, on a rest that is solved in its modes.

`equation` derives and solves them, with their tangent map and the motion along one for its
measures, from `tables` by the length of a step alone; `plan` chooses the length, `step` takes the
steps of a visit.
"""
