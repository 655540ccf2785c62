r"""Rigid stops: at an impact the speed jumps by the law of restitution, without a spring.

A rigid contact has x = d . u - g <= 0. Where x rises through 0 with the speed w = d . v the stop
gives the impulse p = (1 + e) w / (d . M^-1 d) along -d, and with e_k = M^-1 d / (d . M^-1 d)

    v <- v - (1 + e) w e_k,        w <- -e w,        energy lost: (1 - e^2) w^2 / (2 d . M^-1 d).

Tangent vectors. With f-, f+ the rates of the state before and after and R the jump of velocities,
(du, dv) <- (du, R dv) + (f+ - R f-) (d . du) / w, R f- that of velocities alone: of rank one.

Chatter. Under an acceleration a = d . u'' > 0 to the stop a rebound with the speed w comes back
after 2 w / a from a height w^2 / 2 a, and e < 1 leaves e of it: all that follow take

    w (2 / a) (1 + e + e^2 + ..) = 2 w / (a (1 - e)).

Impacts act along e_k alone. So what they leave of all else is what a contact does that is held at
its stop meanwhile, but for forces of a displacement of w^2 / 2 a at most, and of speeds whose
integral that is. Where it is below the rounding of lengths (`observed.ROUNDING`) the motion is that
of a contact that *rests*; the time 2 w / (a (1 - e)) is left out of that in which it is closed.
Not while another that pushes it closes at the same instant, which would find it at rest.

Rest is x = 0, x' = 0, with u'' = a - sum m_k e_k, see `solvers.flow.step.constraint`. It ends where
a reaction m_k falls through 0. Which of several contacts at their stops without speed rest is a
linear complementarity problem: m_k >= 0 for these, d_k . u'' <= 0 for others.

Contacts that close at one instant and push each other, d_j . M^-1 d_k != 0, reverse their speeds by
e at once; those that rest take part with the speed 0. If one of the impulses would pull, they
follow one after another in the order of their numbers, until none closes. So do those that have
bounced and that others push back: the time between falls as its square, soon below rounding.
"""

import math
from typing import Any

import numpy as np

from hpcsweep.model.arguments import number, wrong

FROM_0_TO_1 = "from 0 to 1", 0.0, 1.0
MOST_ROWS = 64
"""Of a structure with rigid contacts: larger ones go in modes, which know no constraints."""


def bounces(contacts: Any) -> np.ndarray:
    """Return e of each contact, shape (m,), -1 of those with a spring; (0,) if all have one."""
    found = [-1.0 if one.stiffness < math.inf else one.restitution for one in contacts]
    return np.array(found if max(found, default=-1.0) >= 0.0 else [], float)


def read_bounce(contact: Any) -> float | None:
    """Read the restitution of a contact, which is that of a rigid one: from 0 to 1."""
    e, damping = contact.restitution, contact.damping
    if contact.stiffness < math.inf:
        if e is not None:
            other = "a spring has Contact.from_restitution"
            raise wrong("contact.restitution", f"goes with stiffness = inf: {other}")
        return None
    if e is None:
        raise wrong("contact.restitution", "is missing: stiffness = inf needs it, from 0 to 1")
    if damping or contact.tension:
        name = "damping" if damping else "tension"
        raise wrong(f"contact.{name}", "does not go with stiffness = inf: give restitution")
    if contact.gap < 0.0:
        raise wrong("contact.gap", f"must be at least 0 with stiffness = inf, is {contact.gap:g}")
    return number("contact.restitution", e, *FROM_0_TO_1)


def refuse_beside(structure: Any) -> None:
    """Refuse what does not go with rigid contacts, of a building by the names that it has."""
    name, of_building = "contact.stiffness", structure.matrices is None
    if of_building and np.inf in np.atleast_1d(structure.stiffness_ratio):
        name = "stiffness_ratio"
        if structure.restitution is None:
            raise wrong("stiffness_ratio", "= inf must have restitution beside it, from 0 to 1")
        for e in np.atleast_1d(structure.restitution).tolist():
            number("restitution", e, *FROM_0_TO_1)
        for side in ("gap", "gap_left"):
            if min(np.atleast_1d(getattr(structure, side)).tolist()) < 0.0:
                raise wrong(side, "must be at least 0 with stiffness_ratio = inf")
    if not any(contact.stiffness == math.inf for contact in structure.all_contacts.values()):
        return
    if structure.sharpness != math.inf:
        raise wrong(name, f"= inf needs sharpness = inf, sharpness is {structure.sharpness:g}")
    if structure.sliders:
        raise wrong(name, "= inf does not go with springs that yield")
    if structure.n_floors > MOST_ROWS:
        limit = f"= inf goes with at most {MOST_ROWS} rows, the structure has {structure.n_floors}"
        raise wrong(name, limit)


def springs_of(contacts: Any) -> np.ndarray:
    """Return the stiffness of each contact, shape (m,), of which a model is reduced."""
    found = np.array([contact.stiffness for contact in contacts], float)
    if math.inf in found:
        raise wrong("contact.stiffness", "= inf does not go with a model that is reduced")
    return found
