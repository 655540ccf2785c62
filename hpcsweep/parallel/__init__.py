"""Ranks and the work they share; knows no physics and no files of results."""
