"""Whether results and solvers are right: files, invariants, runs computed again, extremes."""
