r"""Impacts of each contact: closings, closing speed, impulse, time in contact; on linear segments.

A contact is closed where its distance past the stop is x >= 0. Its impulse is beta int x S dt over
all time, gathered as the integral of x S. On a linear segment x S is max(x, 0), a polynomial.

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
from hpcsweep.model.observed import CLOSINGS, DISSIPATED, FLOOR, FORCE, ROUNDING, SPEED, TIME
from hpcsweep.solvers.flow.guard.rigid import reaction_on_segment
from hpcsweep.solvers.flow.state.state import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.state.tables import MODAL_NODES, MODAL_WEIGHTS, N_MODAL
from hpcsweep.solvers.flow.step.constraint import is_rigid
from hpcsweep.solvers.flow.step.polynomials import evaluate, integral, value_and_slope
from hpcsweep.solvers.flow.step.step import expand


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
        if is_rigid(k, contacts):
            tally.impacts[FORCE, k] += reaction_on_segment(k, segment, span, model, tables, step)
            continue
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
