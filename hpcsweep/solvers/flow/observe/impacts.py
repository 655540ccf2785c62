r"""Impacts of each contact: closings, closing speed, impulse, time in contact; on linear segments.

A contact is closed where its distance past the stop is x >= 0. Its impulse is beta int x S dt over
all time, gathered as the integral of x S. On a linear segment x S is max(x, 0), a polynomial.

A passage in closed form adds the effect of the layer. With r of `crossing` the true force is that
of the spring less r, along the true path, while a segment has the motion y that is linear up to,
and from, the time 0 of the passage. On the side beyond the stop the two differ by the effect of r
after (or before) that time, g(t) = t - c t^2 / 2 + (b - beta) t^3 / 6 + ... being the displacement
by a unit of impulse, c = d . D e and b = d . (D^2 - K) e, so that

    int F dt = beta int y dt - J,    J = M_0 - beta (M_2 / 2 + c M_3 / 6 + (b - beta) M_4 / 24),

M_0 = int r dt of both sides and M_k = int t^k r dt of that beyond. J is what `crossing.add_kick`
adds along e. With m_k = int s^k r ds of the arriving side alone, s from the stop, the true motion
is at the stop at the time d of the linear one, p, earlier on the way in, later on the way out,
where

    p(d) = m_1 + c m_2 / 2 + b m_3 / 6,    with the speed    p'(d) + m_0 + c m_1 + b m_2 / 2,

with beta less in b if that side is the one beyond.

Energy
------
A contact takes the energy int F x' dt less what its spring holds, kappa x^2 / 2. While it pushes
that grows by c int x'^2 dt; once it has let go the spring relaxes by itself, without force, and its
energy is lost to the dashpot: (kappa / 2) times what x^2 falls by.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, total
from hpcsweep.model.kernel_contacts import DASHPOT, SPRING
from hpcsweep.model.kernel_model import FLOOR
from hpcsweep.solvers.flow.linear.polynomials import evaluate, integral, value_and_slope
from hpcsweep.solvers.flow.linear.step import expand
from hpcsweep.solvers.flow.passage.crossing import at_stop, half_passage, since_linear, sums
from hpcsweep.solvers.flow.state.state import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.state.tables import MODAL_NODES, MODAL_WEIGHTS, N_MODAL
from hpcsweep.solvers.measures import CLOSINGS, DISSIPATED, FORCE, ROUNDING, SPEED, TIME


@kernel
def impacts_on_segment(segment, past, span, model, tables, tally, step):
    """Add force, time and energy of the contacts past their stops on the first `span` of a step."""
    contacts, h, n = model.contacts, segment.h, step.z_end.shape[0] // 2
    note_closed(segment, past, span, model, tables, tally, step)
    for k in range(contacts.row.shape[0]):
        if past & contact_bit(k) == np.uint64(0):
            continue
        tally.impacts[TIME, k] += span
        row, spring, dashpot = (
            contacts.row[k],
            contacts.edges[k, SPRING],
            contacts.edges[k, DASHPOT],
        )
        x0, x1 = distance(k, step.x, contacts), distance(k, step.z_end, contacts)
        if segment.key & contact_bit(k) == np.uint64(0):
            tally.impacts[DISSIPATED, k] += 0.5 * spring * (x0 - x1) * (x0 + x1)
            continue
        expand(row, segment, tables, step)
        way = contacts.sign[k] * integral(step.rows, row, h, span) - contacts.gap[k] * span
        tally.impacts[FORCE, k] += spring * way + dashpot * (x1 - x0)
        if dashpot > 0.0:
            expand(n + row, segment, tables, step)
            tally.impacts[DISSIPATED, k] += dashpot * _square(step.rows[n + row], h, span)


@kernel
def _square(coefficients, h, span):
    """Integrate the square of a polynomial over the first `span` of a step, exactly."""
    sum_of_squares = 0.0
    for first in range(0, N_MODAL, LANES):
        s = 0.5 * span * (load(MODAL_NODES, first) + 1.0)
        value = evaluate(coefficients, fma(s, 2.0 / h, -1.0))
        sum_of_squares += total(load(MODAL_WEIGHTS, first) * value * value)
    return 0.5 * span * sum_of_squares


@inlined
def note_closed(segment, past, span, model, tables, tally, step):
    """Note which contacts, a set, are past their stops on the first `span` of a linear step.

    A step is a part of the fastest free motion, and an opening within one an arch.
    """
    tally.closed[0] = past
    tally.beside[0] |= past
    if tally.beside[0] & ~past != np.uint64(0):
        come_apart(segment, past, span, model, tables, tally, step)


@inlined
def record(k, closing, speed, z, model, tally):
    """Record that a contact closes or opens about a state z.

    A closing counts that is faster than rounding, if the contact has come apart since it has last
    closed (`measures.ROUNDING`).
    """
    bit = contact_bit(k)
    if not closing:
        tally.closed[0] &= ~bit
        return
    _raise_size(z, model, tally)
    if tally.beside[0] & bit == np.uint64(0) and speed > ROUNDING * tally.size[0]:
        tally.impacts[CLOSINGS, k] += 1.0
        tally.impacts[SPEED, k] = max(tally.impacts[SPEED, k], speed)
    tally.beside[0] |= bit
    tally.closed[0] |= bit


@kernel
def _raise_size(z, model, tally):
    """Raise the size of a motion by a state, and by the peaks of floors that are gathered."""
    for i in range(z.shape[0]):
        tally.size[0] = max(tally.size[0], abs(z[i]))
    for p in range(tally.peaks.shape[0]):
        if model.watched[p, 3] == FLOOR:
            tally.size[0] = max(tally.size[0], tally.peaks[p])


@kernel
def come_apart(segment, past, span, model, tables, tally, step):
    """Note the open contacts that come apart on the first `span` of a linear step."""
    for k in range(model.contacts.row.shape[0]):
        if tally.beside[0] & ~past & contact_bit(k):
            note_arch(k, 0.0, span, segment, model.contacts, tables, tally, step)


@inlined
def note_arch(k, a, b, segment, contacts, tables, tally, step):
    """Note whether an open contact comes apart from time a to b of a step.

    The middle of an arch tells its height.
    """
    row, h = contacts.row[k], segment.h
    expand(row, segment, tables, step)
    x = math.inf
    for at in (a, 0.5 * (a + b), b):
        x = min(x, contacts.sign[k] * value_and_slope(step.rows, row, h, at)[0] - contacts.gap[k])
    if x < -ROUNDING * max(abs(contacts.gap[k]), tally.size[0]):
        tally.beside[0] &= ~contact_bit(k)


@inlined
def record_passing(passing, past, model, tally, z):
    """Record the contacts that pass their stops in a state; `past` is as it was before."""
    for k in range(model.contacts.row.shape[0]):
        bit = contact_bit(k)
        if passing & bit:
            closing = past & bit == np.uint64(0)
            record(k, closing, abs(approach_speed(k, z, model.contacts)), z, model, tally)


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
    free, _, _ = half_passage(-1.0, stop)
    contact, _, _ = half_passage(1.0, stop)
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
