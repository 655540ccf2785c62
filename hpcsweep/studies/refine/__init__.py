"""Refined maps: computed only where something changes; the rest is inferred, and audited."""
