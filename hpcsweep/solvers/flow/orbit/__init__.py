"""Orbits: the end of a transient, Newton's method, batches of runs."""
