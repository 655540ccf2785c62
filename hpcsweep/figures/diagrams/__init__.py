"""Still pictures of results, one module each."""
