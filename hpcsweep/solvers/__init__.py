"""Solvers of one forcing period behind one interface, and independent references."""
