"""Compiled kernels with numba: compilation and its cache, vectors, arenas."""

KERNELS = ("**/*.py",)
"""Files that define kernels and the constants in them (`hpcsweep.kernels.compile.cache`)."""
