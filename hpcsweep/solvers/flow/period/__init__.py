"""A forcing period put together, and periods in a row."""
