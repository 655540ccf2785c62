"""What numba is asked for: compilation and its cache, vectors, packed arguments."""
