"""Amplitude sweeps: runs, their batches, the classification of motions."""
