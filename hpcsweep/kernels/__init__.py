"""What numba is requested: compilation and its cache, vectors, packed arguments."""
