"""Orbits: the end of a transient, Newton's method, runs in a batch."""
