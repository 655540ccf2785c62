r"""Pass a layer: which contact is at its stop, in closed form or not, apart from others or not.

Independence of all other contacts
----------------------------------

While contact 1 is inside its layer, another one, 2, that passes its own moves it through the
coupling c = |D_12| + |K_12| t alone (they do not push each other), and the closed form applies this
in another order: all of the impulse J_2 at the time t_2 of the stop, and, if that is earlier, over
the whole path of contact 1. Before t_2 its speed is therefore wrong by J_2 c (|t - t_2| + s_2), s_2
the mean distance in time of the force of contact 2 from t_2, and its impulse, by parts, by

    1 / v_1 int r_1 J_2 c (|t - t_2| + s_2) dt <= J_1 J_2 c (s_1 + s_2) / v_1,

t_1 = 0, as |t - t_2| < |t| where t < t_2 < 0. With the speed v and the force
r = beta |x| / (1 + exp(rho |x|)) of `crossing`, J = beta pi^2 / (6 rho^2 v) and s = 2.19 / (rho v),
where 2.19 is the mean of y with the weight y / (1 + exp(y)).

Passage of a contact: choose which one is at its stop, and whether it passes in closed form
-------------------------------------------------------------------------------------------
The passage itself is that of `crossing`. Passages without a closed form are integrated by `layer`.

The impact of a passage in closed form: its force, time and closing speed.

A passage adds the effect of the layer to the impact on linear segments (`observe.impacts`). With r
of `crossing` the true force is that of the spring less r, along the true path, while a segment has
the motion y that is linear up to, and from, the time 0 of the passage. On the side beyond the stop
the two differ by the effect of r after (or before) that time, g(t) = t - c t^2 / 2 + (b - beta) t^3
/ 6 + ... being the displacement by a unit of impulse, c = d . D e and b = d . (D^2 - K) e, so that

    int F dt = beta int y dt - J,    J = M_0 - beta (M_2 / 2 + c M_3 / 6 + (b - beta) M_4 / 24),

M_0 = int r dt of both sides and M_k = int t^k r dt of that beyond. J is what `crossing.add_kick`
adds along e. With m_k = int s^k r ds of the arriving side alone, s from the stop, the true motion
is at the stop at the time d of the linear one, p, earlier on the way in, later on the way out,
where

    p(d) = m_1 + c m_2 / 2 + b m_3 / 6,    with the speed    p'(d) + m_0 + c m_1 + b m_2 / 2,

with beta less in b if that side is the one beyond.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BOOL, BYTES, FLOAT, INT, KEY, VECTOR, entry_point
from hpcsweep.kernels.simd.vectors import total
from hpcsweep.model.contact import FULL_POTENTIAL
from hpcsweep.model.observed import FORCE, TIME
from hpcsweep.solvers.flow.guard.search import LAST_STEP
from hpcsweep.solvers.flow.layer.passage.crossing import (
    NEGLECTED,
    add_kick,
    at_stop,
    half_passage,
    moments,
    passage_is_fast,
    since_linear,
    speeds,
    sums,
)
from hpcsweep.solvers.flow.observe.impacts import record
from hpcsweep.solvers.flow.rules import strategies
from hpcsweep.solvers.flow.state.shared import read_shared
from hpcsweep.solvers.flow.state.state import (
    SEGMENT,
    accelerations,
    approach_speed,
    contact_bit,
    distance,
    is_oblique,
)
from hpcsweep.solvers.flow.step.forcing import forcing_rate, steepest_forcing, total_forcing
from hpcsweep.solvers.flow.step.polynomials import value_and_slope, value_slope_bend

MEAN_WAY = 3.0
"""rho v s, at least 2.19 where the speed changes on the way."""
LATEST = 1.6
"""Longest time of a fast passage from the stop to the edge of the layer, at the speed at the stop.
Where its square falls evenly by `crossing.FAST` of itself it is 1.52."""


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
        if is_oblique(contacts) and contacts.oblique[k, other] != 0.0:
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


EXTRAPOLATION = 1.005
"""Extent, in steps, to which a polynomial is used: its error grows less than fivefold."""


@kernel
def time_at_stop(rows, k, contacts, h, s, direction):
    """Return when a contact at the edge of its layer (time s) is at the stop; NaN if it turns.

    `direction` is 1 on the way in, -1 on the way out.
    """
    row, sign = contacts.row[k], direction * contacts.sign[k]
    stop = contacts.sign[k] * contacts.gap[k]
    for _ in range(40):
        value, slope, bend = value_slope_bend(rows, row, h, s)
        left, speed = sign * (stop - value), sign * slope
        if not speed > 0.0:
            return math.nan
        square = speed * speed + 2.0 * left * sign * bend
        step = 2.0 * left / (speed + math.sqrt(square)) if square > 0.0 else left / speed
        s += step
        # the remainder, u''' step^3 / 6, is below rounding
        if abs(step) <= LAST_STEP * h:
            return s
    return s


@kernel
def first_at_stop(contact, at_stop, near, key, rows, h, contacts):
    """Return the contact that is first at its stop, not after `at_stop`.

    The first one at the edge of its layer may be overtaken inside by a faster one of `near`.
    """
    for k in range(contacts.row.shape[0]):
        if k != contact and near & contact_bit(k) and at_stop <= h * EXTRAPOLATION:
            direction = -1.0 if key & contact_bit(k) else 1.0
            sign = direction * contacts.sign[k]
            value, slope = value_and_slope(rows, contacts.row[k], h, at_stop)
            if sign * (value - contacts.sign[k] * contacts.gap[k]) > 0.0 and sign * slope > 0.0:
                earlier = time_at_stop(rows, k, contacts, h, at_stop, direction)
                if earlier < at_stop:
                    contact = k
                    at_stop = earlier
    return contact, at_stop


@kernel
def jerk_at_stop(arrival, z, a, model):
    """Return the jerk of the row of a contact that exerts no force, with acceleration a."""
    contact, contacts = arrival.contact, model.contacts
    stiffness, damping = model.stiffness, model.damping
    n = stiffness.shape[0]
    row, sign = contacts.row[contact], contacts.sign[contact]
    jerk = model.forcing[row] * forcing_rate(arrival.forcing, 0, model)
    for j in range(n):
        jerk -= stiffness[row, j] * z[n + j] + damping[row, j] * a[j]
    if is_oblique(contacts):
        for k in range(contacts.row.shape[0]):
            if k != contact and arrival.key & contact_bit(k):
                pull = contacts.beta[k] * contacts.sign[k] * z[n + contacts.row[k]]
                jerk -= sign * contacts.oblique[contact, k] * pull
    return jerk


@entry_point(
    (BOOL, FLOAT, KEY), INT, SEGMENT, FLOAT, VECTOR, KEY, FLOAT, BYTES, inner=True, specialises=True
)
def pass_layer(contact, before, tau, z, promised, amplitude, packed):
    """Take the contact at its stop, in state z, through its layer in closed form if possible.

    Parameters
    ----------
    contact : int
    before : Segment
        The motion up to the stop.
    tau : float
        Time at the stop; ``work.forcing`` is the forcing at that time.
    z : ndarray, shape (2R,)
    promised : uint64
    amplitude : float
    packed : ndarray of bytes
        A packed `Shared`.

    Returns
    -------
    passed : bool
        If not, z is unchanged: the passage has to be integrated. ``work.step.a`` holds the
        accelerations at the stop, where the contact has no force.
    float
        Jerk of its row, likewise.
    promised : uint64
        Contacts whose next passage has to be in closed form, see `passes_apart`; updated.
    """
    shared = read_shared(packed)
    z = as_long_as(z, shared.work.step.z_end)
    model, work = shared.model, shared.work
    arrival = Arrival(contact, before.key, tau, work.forcing)
    contacts, a, rho = model.contacts, work.step.a, model.rho
    row, sign = contacts.row[contact], contacts.sign[contact]
    z[row] = sign * contacts.gap[contact]
    if rho == math.inf:
        return z[a.shape[0] + row] != 0.0, 0.0, promised
    accelerations(total_forcing(work.forcing, 0, model), z, model, a)
    jerk = jerk_at_stop(arrival, z, a, model)
    v, pushed, bend = sign * z[a.shape[0] + row], sign * a[row], sign * jerk
    if not (strategies.USED.fast and passage_is_fast(v, pushed, bend, contact, model)):
        return False, jerk, promised
    if promised & contact_bit(contact) == np.uint64(0):
        apart, more = passes_apart(arrival, z, a, amplitude, model)
        if not apart:
            return False, jerk, promised
        promised |= more
    found = moments(v, pushed, bend, contacts.beta[contact], rho)
    add_kick(found, contact, arrival.key, model, z)
    return True, jerk, promised & ~contact_bit(contact)


@kernel
def passage_at_end(segment, ending, model, tally, step):
    """Add the passage of an elastic contact through its layer at the end of a segment.

    ``step.a`` has the accelerations there without the force of the contact, ``step.z_end`` the
    state after the passage.
    """
    contacts, k = model.contacts, ending.contact
    row, sign, beta = contacts.row[k], contacts.sign[k], contacts.beta[k]
    closing = segment.key & contact_bit(k) == np.uint64(0)
    _, v = value_and_slope(step.rows, row, segment.h, ending.span)
    v *= sign
    a = sign * step.a[row]
    inner = sign * contacts.damped[k, row]
    bend = sign * contacts.bent[k, row] - beta
    stop = at_stop(v, a, sign * ending.jerk, beta, model.rho)
    free = half_passage(-1.0, stop, speeds(-1.0, stop))
    contact = half_passage(1.0, stop, speeds(1.0, stop))
    m0, _, _, m2, _, m3, m4 = since_linear(sums(free, contact), stop)
    m = free if closing else contact
    arriving = bend + beta if closing else bend
    gone = total(m[1]) + 0.5 * inner * total(m[2]) + arriving * total(m[3]) / 6.0
    d = gone / v
    d = gone / (v + 0.5 * a * d)
    speed = abs(v + a * d + total(m[0]) + inner * total(m[1]) + 0.5 * arriving * total(m[2]))
    early = abs(d)
    kick = m0 - beta * (0.5 * m2 + inner * m3 / 6.0 + bend * m4 / 24.0)
    tally.impacts[FORCE, k] -= kick / beta
    tally.impacts[TIME, k] += early
    record(k, closing, speed, step.z_end, model, tally)
