"""Responses to ground-motion records: incremental dynamic analyses, pounding studies."""
