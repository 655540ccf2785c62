"""Bounds of a component between its values at the ends and the nodes of a step inside a layer."""

from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.simd.vectors import maximum

BETWEEN = 0.1
"""How far a component may come beyond its values at ends and nodes, over their range; of a parabola
between nodes it is 0.03, with its top in the step."""


@inlined
def range_of(inner, first, last):
    """Return the least and the greatest of Lanes and two numbers."""
    top = max(maximum(inner), max(first, last))
    return min(-maximum(0.0 - inner), min(first, last)), top


@inlined
def above(bottom, top):
    """Return whether a component of a range is above 0 between its values, too."""
    return bottom > BETWEEN * (top - bottom)


@inlined
def beyond(bottom, top):
    """Return what a component of a range may reach."""
    return top + BETWEEN * (top - bottom)


@inlined
def stays(closed, bottom, top):
    """Return whether a contact whose distances past its stop have a range stays as it is."""
    return above(bottom, top) if closed else above(-top, -bottom)


@inlined
def keeps_sign(bottom, top):
    """Return whether a component of a range has one sign on the step."""
    return above(bottom, top) or above(-top, -bottom)
