"""Contact law (5), (9): the stop, the spring behind it, and the layer that switches it on.

At a distance x past a stop the force beta S(rho x) x pushes back, S the sigmoid. The law is here in
every form: for numbers, for `Lanes` of kernels, and with its derivative.
`reference` has a form of its own, to be independent.

The force depends on the position alone. Passages in closed form, by their
energy (`flow.layer.passage.passage.pass_layer`), and steps with a few contacts in their layers
(`flow.layer.volterra`) rely on that. Collocation evaluates the force at a state, whatever it
depends on.

With a dashpot (`hpcsweep.model.dashpot`) it depends on the speed, too, and jumps where the
contact closes. Such a contact is sharp, and its motion is linear from one change of the contact to
the next: `flow.guard.elements`.
"""

import math

from hpcsweep.kernels.compile import inlined, jit
from hpcsweep.kernels.simd.vectors import fma, switches

NEGLIGIBLE_FORCE = 1e-13
"""Acceleration at the edge of the layer, in units of the structure, that is neglected outside."""
FAR = 45.0
"""rho |x| above which the sigmoid is 0 or 1 to rounding (exp(-45) = 3e-20)."""
STIFFEST = 2.4
"""rho x at which the contact is stiffest, `MAX_STIFFNESS` times beta."""
MAX_STIFFNESS = 1.0999
FULL_POTENTIAL = math.pi**2 / 12.0
"""Work that the sigmoid adds to the linear spring's on either side, in beta / rho^2."""


def layer_half_width(beta: float, rho: float) -> float:
    """Return the half-width of the contact layer.

    Outside it the neglected force r = beta/rho y exp(-y), y = rho |x|, is below
    `NEGLIGIBLE_FORCE`.
    """
    if rho == math.inf or beta == 0.0:
        return 0.0
    if rho == 0.0:
        return math.inf
    y = 20.0
    for _ in range(50):
        y = max(20.0, math.log(beta / rho * y / NEGLIGIBLE_FORCE))
    return y / rho


@jit
def sigmoid(y):
    """Evaluate 1 / (1 + exp(-y)) without overflow (5).

    Parameters
    ----------
    y : float
        rho x; any finite value or an infinity.
    """
    if y >= 0.0:
        return 1.0 / (1.0 + math.exp(-y))
    e = math.exp(y)
    return e / (1.0 + e)


@jit
def switch(x, rho):
    """Evaluate the contact sigmoid at distance x past the stop, in [0, 1].

    ``rho = inf`` gives the unit step with value 1/2 at x = 0.
    """
    if rho == math.inf:
        if x > 0.0:
            return 1.0
        return 0.0 if x < 0.0 else 0.5
    return sigmoid(rho * x)


@jit
def contact_force(x, beta, rho):
    """Evaluate the force beta S(x) x with which the stop pushes back."""
    return beta * switch(x, rho) * x


@jit
def contact_stiffness(x, beta, rho):
    """Differentiate the contact force with respect to x.

    d/dx [x S] = S + rho x S (1 - S); at rho = inf the unit step.
    """
    s = switch(x, rho)
    if rho == math.inf:
        return beta * s
    return beta * s * (1.0 + rho * x * (1.0 - s))


@inlined
def contact_forces(x, beta, rho):
    """Evaluate `contact_force` of `Lanes`, rho finite."""
    return beta * switches(rho * x) * x


@inlined
def less_contact_forces(force, x, beta, rho):
    """Subtract `contact_force` of `Lanes` from `force`, with one rounding; rho finite."""
    return fma(switches(rho * x), -1.0 * beta * x, force)


@inlined
def contact_stiffnesses(x, beta, rho):
    """Evaluate `contact_stiffness` of `Lanes`, rho finite."""
    s = switches(rho * x)
    return beta * s * (1.0 + rho * x * (1.0 - s))
