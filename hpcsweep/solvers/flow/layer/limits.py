"""What limits a step inside a layer, whatever its scheme.

The sigmoid has poles at y = rho x = +-i pi (2 m + 1). On a step on which y moves by L, a Gauss rule
of N nodes converges as kappa^(-2 N), kappa the parameter of the Bernstein ellipse about the step
on which the nearest poles lie: |i pi - y| + |i pi - y - L| = E L / 2 with E = kappa + 1 / kappa.
Hence, y negative on the way to the stop::

    L = (E sqrt(pi^2 + y^2) + 2 y) / (E^2 / 4 - 1).
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import FAR, MOST_STIFFNESS, STIFFEST, contact_stiffness


@inlined
def reach(y, ellipse):
    """Choose how far y may move on a step from y (negative: towards the stop); see the module."""
    return (ellipse * math.sqrt(math.pi**2 + y * y) + 2.0 * y) / (0.25 * ellipse**2 - 1.0)


@kernel
def stiffness_up_to(x, beta, rho):
    """Give the stiffness that a contact has on its way to a distance x past its stop, the largest.

    A contact that is switched on softens at first; that is negative.
    """
    if rho * x >= STIFFEST:
        return MOST_STIFFNESS * beta
    return contact_stiffness(x, beta, rho) if rho * x > -FAR else 0.0


@kernel
def allowed_error(z, tolerance):
    """Give the error that a step may have which ends in state z."""
    size = 1.0
    for value in z:
        size = max(size, abs(value))
    return tolerance * size
