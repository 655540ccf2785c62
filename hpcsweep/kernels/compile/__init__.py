"""Compilation of the numerical kernels with numba: decorators, cache, entry points."""

from hpcsweep.kernels.compile.decorators import inlined, jit, kernel

__all__ = ["inlined", "jit", "kernel"]
