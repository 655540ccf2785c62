"""Linear motion between contact changes: propagators, polynomials, series, forcing."""
