"""Gather impacts over a step inside a layer, from its stages; see `observe.impacts`."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import load, total
from hpcsweep.model.contact import contact_forces
from hpcsweep.model.observed import FORCE, TIME
from hpcsweep.solvers.flow.guard.search import (
    Bracket,
    Level,
    Stretch,
    Trace,
    first_passage,
    may_reach,
    rising_root,
)
from hpcsweep.solvers.flow.layer.scheme import allowed_error, distances
from hpcsweep.solvers.flow.observe.impacts import note_arch, record
from hpcsweep.solvers.flow.rules.tableau import NODES, WEIGHTS
from hpcsweep.solvers.flow.state.state import approach_speed, contact_bit, distance
from hpcsweep.solvers.flow.step.polynomials import evaluate, fourth_derivative, value_and_slope
from hpcsweep.solvers.flow.step.step import expand

MISSED = 1e-13
"""Allowed error of the integral of x S over a step, in units of length and time."""
SAME_INTEGRAL = 1e-13
MAX_PARTS = 256
MAX_CHANGES = 16
"""Most closings and openings of a contact on a step."""


@inlined
def impacts_in_layer(segment, shared):
    """Add the impacts of the present step: the force by the rule of its stages.

    A contact too soft for the motion, to which steps are fitted, to feel what the rule misses is
    integrated along its polynomial.
    """
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    contacts, stage, h = model.contacts, work.step.layer, segment.h
    missed = allowed_error(work.step.z_end, MISSED)
    for k in range(contacts.row.shape[0]):
        bit = contact_bit(k)
        if stage.active[k] == 2 and stage.missed[k] > contacts.beta[k] * missed:
            expand(contacts.row[k], segment, tables, work.step)
            tally.impacts[FORCE, k] += _integral_of_force(k, h, model, work.step.rows)
        elif stage.active[k] > 0:
            forces = contact_forces(distances(k, stage.u, contacts), 1.0, model.rho)
            tally.impacts[FORCE, k] += h * total(load(WEIGHTS, 0) * forces)
        if distance(k, work.step.x, contacts) >= 0.0:
            tally.closed[0] |= bit
            tally.beside[0] |= bit
        if may_change(k, h, contacts, tally, work):
            _follow(k, segment, shared)
        elif tally.closed[0] & bit:
            tally.impacts[TIME, k] += h
        elif tally.beside[0] & bit:
            note_arch(k, 0.0, h, segment, contacts, tables, tally, work.step)


@inlined
def may_change(k, h, contacts, tally, work):
    """Return whether a contact may close or open on the present step."""
    x = distance(k, work.step.x, contacts)
    closed = tally.closed[0] & contact_bit(k) != np.uint64(0) or x >= 0.0
    inward = -1.0 if closed else 1.0
    x1 = inward * distance(k, work.step.z_end, contacts)
    v = inward * approach_speed(k, work.step.x, contacts)
    v1 = inward * approach_speed(k, work.step.z_end, contacts)
    return may_reach(h, inward * x, v, x1, v1, work.step.bounds[contacts.row[k]])


@kernel
def _follow(k, segment, shared):
    """Add closings and the time at x >= 0 of a contact, from one change to the next."""
    model, tables, work, tally = shared.model, shared.tables, shared.work, shared.tally
    contacts, rows, h, bit = model.contacts, work.step.rows, segment.h, contact_bit(k)
    row, sign, stop = contacts.row[k], contacts.sign[k], contacts.sign[k] * contacts.gap[k]
    speed_row = work.step.a.shape[0] + row
    expand(row, segment, tables, work.step)
    expand(speed_row, segment, tables, work.step)
    curve, bound4 = Trace(rows, row, h), fourth_derivative(rows[row : row + 1], h)
    x, v = distance(k, work.step.x, contacts), approach_speed(k, work.step.x, contacts)
    x1, v1 = distance(k, work.step.z_end, contacts), approach_speed(k, work.step.z_end, contacts)
    since = 0.0
    for change in range(MAX_CHANGES + 1):
        closed = tally.closed[0] & bit != np.uint64(0)
        inward = -1.0 if closed else 1.0
        level = Level(inward * sign, stop)
        part = Stretch(since, inward * x, inward * v, h, inward * x1, inward * v1)
        bracket = Bracket(-1.0, 0.0, h, 0.0)
        if change < MAX_CHANGES and since < h:
            bracket = first_passage(curve, part, level, bound4)
        until = rising_root(curve, bracket, level) if bracket.a >= 0.0 else h
        if closed:
            tally.impacts[TIME, k] += until - since
        else:
            note_arch(k, since, until, segment, contacts, tables, tally, work.step)
        if bracket.a < 0.0:
            return
        x = sign * (value_and_slope(rows, row, h, until)[0] - stop)
        v = sign * value_and_slope(rows, speed_row, h, until)[0]
        record(k, not closed, abs(v), work.step.z_end, model, tally)
        since = until


@kernel
def _integral_of_force(k, h, model, rows):
    """Integrate x S of a contact over a step, along its polynomial, in the parts that needs."""
    contacts, found, parts = model.contacts, 0.0, 2
    while True:
        before, found = found, 0.0
        for part in range(parts):
            sigma = (load(NODES, 0) + part) * (2.0 / parts) - 1.0
            x = evaluate(rows[contacts.row[k]], sigma) * contacts.sign[k] - contacts.gap[k]
            found += total(load(WEIGHTS, 0) * contact_forces(x, 1.0, model.rho))
        found *= h / parts
        if abs(found - before) <= SAME_INTEGRAL * abs(found) or parts >= MAX_PARTS:
            return found
        parts *= 2
