"""Combine segments to a forcing period, and periods to longer motions."""
