"""Arithmetic on eight doubles at once, as instructions and in numpy."""
