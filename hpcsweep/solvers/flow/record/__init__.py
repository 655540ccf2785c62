"""Motions under a ground-motion record: consecutive sample intervals, and peaks of outputs."""
