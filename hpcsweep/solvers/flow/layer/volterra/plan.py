"""Choose the contacts of a step, and its length.

The force of a contact is an analytic function of time except where the contact is at a pole of the
sigmoid, rho x = +-i pi. With the initial motion, x + v t + a t^2 / 2, that is at two complex times,
ahead or behind, and their conjugates,

    t = -2 (x - i pi / rho) / (v + w),  -(v + w) / a,        w^2 = v^2 - 2 a (x - i pi / rho).

The step is as long as the ellipse of `layer.scheme` excludes the nearer of them, for each contact
that is in its layer or comes near it meanwhile, and as the iteration for all forces converges fast.
Contacts that stay before their layers on it do not push, which is confirmed at its end.
"""

import math

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import MAX_STIFFNESS
from hpcsweep.solvers.flow.layer.scheme import reach, stiffness_up_to
from hpcsweep.solvers.flow.state.state import is_oblique
from hpcsweep.solvers.flow.state.tables import LEVELS
from hpcsweep.solvers.flow.state.workspace import MOST

ELLIPSE = 3.0
"""kappa + 1 / kappa with kappa = 2.62: kappa^-32 = 4e-14."""
CONTRACTION = 3.0
"""Largest h sqrt(|df/dx|): rounding grows by less than cosh(3) = 10 over the iteration."""
SURE = 1.5
"""Factor by which another contact may move further on a step than estimated."""
INSIDE = 1.001
"""Distance, in half-widths of the layer, of a contact that counts as being inside."""


@kernel
def until_poles(x, v, pushed, rho):
    """Return the length of a step from the times at which the contact is at a pole; see the module.

    Parameters
    ----------
    x, v, pushed : float
        Distance past the stop, speed and acceleration towards it.
    rho : float
    """
    pole = math.pi / rho
    # w = u + i s, the root of v^2 - 2 a (x - i pi / rho) that has the sign of v
    square, twist = v * v - 2.0 * pushed * x, 2.0 * pushed * pole
    larger = math.sqrt(0.5 * (math.sqrt(square * square + twist * twist) + abs(square)))
    smaller = 0.5 * abs(twist) / larger if larger > 0.0 else 0.0
    u, s = (larger, smaller) if square >= 0.0 else (smaller, larger)
    ahead = 1.0 if v >= 0.0 else -1.0
    pushing = 1.0 if pushed >= 0.0 else -1.0
    s *= pushing * ahead
    # v + w
    u = u * ahead + v
    size = u * u + s * s
    if not size > 0.0:
        return math.inf
    # t = -2 (x - i pi / rho) / (v + w) and -(v + w) / a
    first = 2.0 * math.sqrt((x * x + pole * pole) / size)
    h = reach(first, -2.0 * (x * u - pole * s) / size, ELLIPSE)
    if pushed != 0.0:
        h = min(h, reach(math.sqrt(size), -u * pushing, ELLIPSE) / abs(pushed))
    return h


@kernel
def plan_step(most, model, own):
    """Choose the contacts of a step, in ``own.which``, and its length, at most `most`.

    Returns
    -------
    r : int
        Number of contacts, 0 if they are too many.
    h : float
    stiffness : float
        See `equation.take_step`.
    """
    contacts, rho, layer, x = model.contacts, model.rho, model.layer, own.distances
    h, stiffness, r = most, 0.0, 0
    # first those inside their layers, which limit the step most
    for outside in range(2):
        for k in range(contacts.row.shape[0]):
            place, speed, pushed, beta = x[0, k], x[1, k], x[2, k], contacts.beta[k]
            if (abs(place) < INSIDE * layer) == (outside == 1):
                continue
            way = SURE * h * (abs(speed) + abs(pushed) * h)
            near = outside == 0 or way > abs(place) - layer
            if not near and place < 0.0:
                continue
            if r == MOST:
                return 0, 0.0, 0.0
            own.which[r] = k
            r += 1
            stiff = MAX_STIFFNESS * beta if near else beta
            if near:
                h = min(h, until_poles(place, speed, pushed, rho))
                if place < 0.0:
                    turn = min(h, speed / -pushed) if speed > 0.0 > pushed else h
                    nearest = place + max(0.0, speed + 0.5 * pushed * turn) * turn
                    stiff = abs(stiffness_up_to(nearest, beta, rho))
            stiffness = stiffness + stiff if is_oblique(contacts) else max(stiffness, stiff)
            if h * h * stiffness > CONTRACTION * CONTRACTION:
                h = CONTRACTION / math.sqrt(stiffness)
    return r, h, stiffness


@inlined
def level_of(h, longest):
    """Return level and length of the longest step of the tables not longer than h."""
    level = 0
    while level < LEVELS and longest > h:
        longest *= math.sqrt(0.5)
        level += 1
    return level, longest
