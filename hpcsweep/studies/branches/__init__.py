"""Branches of periodic orbits through all motions of results files."""
