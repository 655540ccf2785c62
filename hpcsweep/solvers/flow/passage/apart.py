r"""Decide whether a contact may pass its layer independently of all other contacts.

While contact 1 is inside its layer, another one, 2, that passes its own moves it through the
coupling c = |D_12| + |K_12| t alone (they do not push each other), and the closed form applies this
in another order: all of the impulse J_2 at the time t_2 of the stop, and, if that is earlier, over
the whole path of contact 1. Before t_2 its speed is therefore wrong by J_2 c (|t - t_2| + s_2), s_2
the mean distance in time of the force of contact 2 from t_2, and its impulse, by parts, by

    1 / v_1 int r_1 J_2 c (|t - t_2| + s_2) dt <= J_1 J_2 c (s_1 + s_2) / v_1,

t_1 = 0, as |t - t_2| < |t| where t < t_2 < 0. With the speed v and the force
r = beta |x| / (1 + exp(rho |x|)) of `crossing`, J = beta pi^2 / (6 rho^2 v) and s = 2.19 / (rho v),
where 2.19 is the mean of y with the weight y / (1 + exp(y)).
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import FULL_POTENTIAL
from hpcsweep.solvers.flow.linear.forcing import steepest_forcing
from hpcsweep.solvers.flow.passage.crossing import NEGLECTED, passage_is_fast
from hpcsweep.solvers.flow.state.contacts import approach_speed, contact_bit, distance

MEAN_WAY = 3.0
"""rho v s, at least 2.19 where the speed changes on the way."""
LATEST = 1.6
"""Longest time of a fast passage from the stop to the edge of the layer, at the speed at the stop.
Where its square falls evenly by `crossing.FAST` of itself it is 1.52."""
SLOWED = 0.6
"""Least mean speed of a slow passage, in units of that at the stop. Where the square of the speed
falls evenly by `slow_passage.FALL` of itself it is 0.66."""


class Arrival(NamedTuple):
    """A contact at its stop."""

    contact: int
    key: np.uint64
    """Contact set before the passage."""
    tau: float
    forcing: np.ndarray
    """Pairs of sine and cosine, see `forcing`."""


@kernel
def _coupling(k, model, span):
    """Bound |D_kl| + |K_kl| t over all other contacts l; inf if one pushes contact k itself."""
    contacts = model.contacts
    row = contacts.row[k]
    coupling = 0.0
    for other in range(contacts.row.shape[0]):
        if other == k:
            continue
        if contacts.is_oblique and contacts.oblique[k, other] != 0.0:
            return math.inf
        stiff = 0.0
        for p in range(contacts.first[other], contacts.first[other + 1]):
            stiff += model.stiffness[row, contacts.push_row[p]] * contacts.push[p]
        coupling = max(coupling, abs(contacts.damped[other, row]) + abs(stiff) * span)
    return coupling


@inlined
def passes_apart(arrival, z, a, amplitude, model):
    """Return whether the contact at its stop may pass its layer independently of all others.

    That holds where no other comes near its layer meanwhile, and also where those that do pass as
    fast, if their effect on each other is negligible; see the module. It does not hold for contacts
    that push each other directly.

    Returns
    -------
    bool
    promised : uint64
        The contacts on their way to the stop that were found to pass fast. They may be inside their
        layers already, so that they have to be taken through in closed form, too.
    """
    contacts, key, tau = model.contacts, arrival.key, arrival.tau
    stiffness, damping = model.stiffness, model.damping
    rho, layer = model.rho, model.layer
    n = stiffness.shape[0]
    end = model.period
    least = abs(z[n + contacts.row[arrival.contact]])
    span = LATEST * layer / least
    strongest = contacts.beta[arrival.contact]
    promised = np.uint64(0)
    found = contact_bit(arrival.contact)
    searching = True
    while searching:
        searching = False
        if tau - span < 0.0 or tau + span > end:
            return False, promised
        for k in range(contacts.row.shape[0]):
            bit = contact_bit(k)
            i = contacts.row[k]
            x, w = abs(distance(k, z, contacts)), approach_speed(k, z, contacts)
            arrives = (w < 0.0) == (key & bit != np.uint64(0))
            w = abs(w)
            if found & bit or x - (w + abs(a[i]) * span) * span > layer:
                continue
            beta = contacts.beta[k]
            way = layer + x if arrives else max(layer - x, 0.0)
            square = w * w - (2.0 * abs(a[i]) + beta * way) * way
            if not square > 0.25 * w * w:
                return False, promised
            slowest = math.sqrt(square)
            span = max(span, way / slowest)
            strongest = max(strongest, beta)
            energy = 2.0 * FULL_POTENTIAL * strongest / (rho * rho)
            jerk = steepest_forcing(amplitude, model) * abs(model.forcing[i])
            for j in range(n):
                jerk += abs(stiffness[i, j] * z[n + j]) + abs(damping[i, j] * a[j])
            coupling = _coupling(k, model, span)
            times = MEAN_WAY / rho * (1.0 / least + 1.0 / slowest)
            cube = least * slowest * min(least, slowest)
            least = min(least, slowest)
            if not energy * energy * coupling * times <= NEGLECTED * cube:
                return False, promised
            if not passage_is_fast(slowest, abs(a[i]), jerk, k, model):
                return False, promised
            found |= bit
            if arrives:
                promised |= bit
            searching = True
    return True, promised


@kernel
def is_alone(arrival, z, a, amplitude, model):
    """Return whether no other contact comes near its layer while one passes slowly, or arrives.

    In a time t a row moves by no more than (w + |a| t / 2) t + J t^3 / 6, with its speed w, J the
    largest jerk of any row and the norm |K| + |C| / t of all rows: the rows add less than J again
    while they move as long as |K| t^2 + |C| t <= 1, hence J t^3. A closed contact pulls its row
    back, which only reduces that.
    """
    contacts, stiffness, damping = model.contacts, model.stiffness, model.damping
    n = stiffness.shape[0]
    speed = SLOWED * abs(z[n + contacts.row[arrival.contact]])
    span = model.layer / speed
    if arrival.tau - span < 0.0 or arrival.tau + span > model.period:
        return False
    steepest = steepest_forcing(amplitude, model)
    jerk = 0.0
    rigid = 0.0
    for i in range(n):
        driven = steepest * abs(model.forcing[i])
        norm = 0.0
        for j in range(n):
            driven += abs(stiffness[i, j] * z[n + j]) + abs(damping[i, j] * a[j])
            norm += (abs(stiffness[i, j]) * span + abs(damping[i, j])) * span
        jerk = max(jerk, driven)
        rigid = max(rigid, norm)
    if not rigid <= 1.0:
        return False
    for k in range(contacts.row.shape[0]):
        i = contacts.row[k]
        way = (abs(z[n + i]) + (abs(a[i]) + jerk * span) * span) * span
        if k != arrival.contact and not abs(distance(k, z, contacts)) - way > model.layer:
            return False
    return True
