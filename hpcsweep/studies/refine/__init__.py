"""Maps that are computed only where something happens; the rest is inferred, and audited."""
