"""Solvers of one forcing period behind one interface, and independent references."""

KERNELS = ("flow/**/*.py", "free.py", "outcome.py", "skip_rule.py")
"""Files that define kernels and the constants in them (`hpcsweep.kernels.compile.cache`)."""
