"""Maxima and means over continuous time, from the exact segments."""
