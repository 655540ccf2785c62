"""Arithmetic on eight doubles at once, as instructions and in numpy."""

LANES = 8
"""Doubles processed together."""
