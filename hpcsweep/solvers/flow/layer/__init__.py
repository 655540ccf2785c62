"""Motion inside a contact layer, where the equations are smooth and stiff.

Interface of a layer integrator
-------------------------------
A visit, `visit.visit_layer`, takes steps from the edge of a layer until no contact is inside its
layer. They are those of `volterra` where damping couples no modes and few contacts are inside;
otherwise it needs five things of the scheme, here Gauss collocation:

- step: `scheme.collocate` takes a step of length h from a state and its accelerations and leaves
  its stages in ``work.step.layer``; it may decline (False), and h is halved;
- end: `scheme.finish` gives the state at the end of the step from its stages;
- error: `scheme.quadrature_error` measures the error of that state, relative to max(1, |z|), of a
  known order in h (`visit.shortening`); it is a bound or an estimate from above;
- dense output: its stages give the polynomials of rows and what bounds them (`step.step`), from
  which maxima, peaks and impacts are taken as on a linear step (`measures`); those of parts of a
  step of `volterra` are given likewise (`volterra.equation.write_part`);
- tangent: `variations.layer_tangent` multiplies a matrix by the derivative of the map from start to
  end of the step, the same map as that of `finish`.

The length of a step is chosen by `visit.step_limit` before and `visit.shortening` after it; a
scheme without poles to heed would have its own. Nothing outside this folder depends on stages.
"""
