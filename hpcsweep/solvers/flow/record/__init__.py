"""Motions under a ground-motion record: sample intervals in a row, and the peaks of outputs."""
