"""Classify motions: orbit period, stability, class."""
