"""Functions of the package that compute motions and return datasets, for use from Python."""
