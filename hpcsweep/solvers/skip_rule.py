"""Skip rules, and when an orbit is verified to attract a motion.

Newton's method finds an orbit near a motion for a skip rule (`flow.orbit.newton`, compiled) and for
a classification (`dynamics.verification`). Both accept it by `LINEAR_DEFECT`. They differ in the
multiplier. A classification needs the limit of a motion: any multiplier below 1 will do. A jump
replaces the state after a transient: an approach slower than `STABLE` has covered less than a fifth
of its way after 2,000 periods, where the window procedure would find another motion.
"""

from enum import IntEnum

LINEAR_DEFECT = 0.05
"""Largest share of the distance to an orbit by which the map may differ from its tangent."""
STABLE = 0.9999
"""Largest multiplier of an orbit that a skip rule jumps to."""


class SkipRule(IntEnum):
    """Skip rule that a run used; stored in the file as an integer."""

    NONE = 0
    """All periods of transient and window were integrated."""
    LINEAR = 1
    """No floor can reach the stop: closed form."""
    CONVERGED = 2
    """The orbit had closed before the transient's end: one orbit in place of the window."""
    NEWTON = 3
    """A verified jump to the orbit that was approached, and one orbit in place of the window."""
