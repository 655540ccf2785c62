"""Distribute work over ranks, without knowledge of physics or of results files."""
