"""Basins of attraction on a slice of starts."""
