"""Compiled kernels with numba: compilation and its cache, vectors, arenas."""
