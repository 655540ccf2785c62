"""Verify results and solvers: files, invariants, recomputed runs, extremes."""
