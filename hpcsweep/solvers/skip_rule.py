"""Which rule spared periods in one run."""

from enum import IntEnum


class SkipRule(IntEnum):
    """Which rule spared periods in one run; stored in the file as an integer."""

    NONE = 0
    """All periods of transient and window were integrated."""
    LINEAR = 1
    """No floor can reach the stop: closed form."""
    CONVERGED = 2
    """The orbit had closed before the transient's end: one orbit in place of the window."""
    NEWTON = 3
    """A verified jump to the orbit that was approached, and one orbit in place of the window."""
