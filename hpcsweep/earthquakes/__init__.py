"""Earthquakes: ground-motion records, their spectra, and the statistics of responses to them."""
