"""Limits of a step inside a layer, whatever its scheme.

The sigmoid has poles at y = rho x = +-i pi (2 m + 1). A Gauss rule of N nodes on a step from 0 to L
converges as kappa^(-2 N), kappa the parameter of the Bernstein ellipse about the step on which the
nearest pole p lies: |p| + |p - L| = E L / 2 with E = kappa + 1 / kappa. Hence::

    L = (E |p| - 2 Re p) / (E^2 / 4 - 1).

In y, counted from where the step starts, p = -y + i pi; in time see `solitary.plan`.
"""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import FAR, MAX_STIFFNESS, STIFFEST, contact_stiffness


@inlined
def reach(size, ahead, ellipse):
    """Return the length of the step on whose ellipse a pole lies; see the module.

    Parameters
    ----------
    size, ahead : float
        Distance of the pole from the start of the step, and its component along the step.
    ellipse : float
        E
    """
    return (ellipse * size - 2.0 * ahead) / (0.25 * ellipse**2 - 1.0)


@kernel
def stiffness_up_to(x, beta, rho):
    """Return the largest stiffness of a contact up to a distance x past its stop.

    The stiffness of a contact that is switched on is negative at first.
    """
    if rho * x >= STIFFEST:
        return MAX_STIFFNESS * beta
    return contact_stiffness(x, beta, rho) if rho * x > -FAR else 0.0


@kernel
def allowed_error(z, tolerance):
    """Return the allowed error of a step that ends in state z."""
    size = 1.0
    for value in z:
        size = max(size, abs(value))
    return tolerance * size
