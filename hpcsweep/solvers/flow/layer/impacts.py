"""Gather impacts over a collocation step, from its stages; see `observe.impacts`."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import load, total
from hpcsweep.model.contact import contact_forces
from hpcsweep.solvers.flow.layer.interpolant import (
    hermite,
    integral_of_force,
    interpolate,
    interpolated,
    root_of,
    turn_of,
    value_of,
)
from hpcsweep.solvers.flow.layer.observation import range_of, stays
from hpcsweep.solvers.flow.layer.scheme import allowed_error, distances
from hpcsweep.solvers.flow.observe.impacts import note_apart, record
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, WEIGHTS
from hpcsweep.solvers.flow.state.state import contact_bit, distance
from hpcsweep.solvers.measures import FORCE, TIME

MISSED = 1e-13
"""Allowed error of the integral of x S over a step, in units of length and time."""


@inlined
def missed_force(z):
    """Return the allowed error of the integral of x S over a step that ends in state z."""
    return allowed_error(z, MISSED)


@inlined
def impacts_in_layer(h, z0, z1, alone, model, ways, tally, work):
    """Add the impacts of a step: the force by the rule of its stages, the rest by `_follow`.

    A contact too soft for the motion, to which steps are fitted, to feel what the rule misses is
    integrated along the interpolant; that of the contact `alone` is known.
    """
    contacts, stage = model.contacts, work.layer
    n = model.stiffness.shape[0]
    for k in range(contacts.row.shape[0]):
        i, sign, gap = contacts.row[k], contacts.sign[k], contacts.gap[k]
        if distance(k, z0, contacts) + ways[i] < -model.layer:
            continue
        for s in range(N_STAGES):
            work.stage_u[s] = sign * stage.u[i, s] - gap
            work.stage_v[s] = sign * stage.v[i, s]
            work.stage_a[s] = sign * stage.g[i, s]
        start = (distance(k, z0, contacts), sign * z0[n + i], sign * work.a[i])
        end = (distance(k, z1, contacts), sign * z1[n + i], sign * work.a_end[i])
        if stage.active[k] == 2 and stage.missed[k] > contacts.beta[k] * missed_force(z1):
            interpolate(h, start, end, work)
            tally.impacts[FORCE, k] += integral_of_force(h, model.rho, work)
        elif k != alone:
            forces = contact_forces(load(work.stage_u, 0), 1.0, model.rho)
            tally.impacts[FORCE, k] += h * total(load(WEIGHTS, 0) * forces)
        if start[0] >= 0.0:
            tally.closed[0] |= contact_bit(k)
            tally.beside[0] |= contact_bit(k)
        _follow(k, h, start, end, z0, model, tally, work)


@inlined
def impacts_without_change(h, z0, z1, model, tally, work):
    """Add the impacts of a collocated step on which no contact closes or opens.

    Return whether that is so; nothing is added where one may, or where the rule misses too much.
    """
    contacts, stage = model.contacts, work.layer
    for k in range(contacts.row.shape[0]):
        first, last = distance(k, z0, contacts), distance(k, z1, contacts)
        if first + work.ways[contacts.row[k]] < -model.layer:
            continue
        if stage.active[k] == 2 and stage.missed[k] > contacts.beta[k] * missed_force(z1):
            return False
        closed = first >= 0.0 or tally.closed[0] & contact_bit(k) != np.uint64(0)
        bottom, top = range_of(distances(k, stage.u, contacts), first, last)
        if not closed:
            note_apart(k, bottom, contacts, tally)
        if not stays(closed, bottom, top):
            return False
    for k in range(contacts.row.shape[0]):
        first = distance(k, z0, contacts)
        if first + work.ways[contacts.row[k]] < -model.layer:
            continue
        forces = contact_forces(distances(k, stage.u, contacts), 1.0, model.rho)
        tally.impacts[FORCE, k] += h * total(load(WEIGHTS, 0) * forces)
        if first >= 0.0:
            tally.closed[0] |= contact_bit(k)
            tally.beside[0] |= contact_bit(k)
            tally.impacts[TIME, k] += h
    return True


@inlined
def _follow(k, h, start, end, z0, model, tally, work):
    """Add closings and the time at x >= 0 of a contact, with x given as in `_highest`.

    Crossings are found on quintics through neighbours, as in `_highest`, and then on the polynomial
    through distance and speed at the ends and all stages.
    """
    left_s, left = 0.0, start
    for s in range(N_STAGES + 1):
        if s < N_STAGES:
            right_s, right = NODES[s], (work.stage_u[s], work.stage_v[s], work.stage_a[s])
        else:
            right_s, right = 1.0, end
        d = right_s - left_s
        quintic = hermite(d * h, left, right)
        closed = tally.closed[0] & contact_bit(k) != np.uint64(0)
        inward = -1.0 if closed else 1.0
        if not closed:
            note_apart(k, left[0], model.contacts, tally)
        begin, since = 0.0, left_s
        if inward * left[1] > 0.0 > inward * right[1] and inward * right[0] < 0.0:
            # possibly to the other side and back
            turn = turn_of(quintic, inward, left[1] / (left[1] - right[1]))
            if inward * value_of(quintic, turn) >= 0.0:
                near = left_s + d * root_of(quintic, 0.0, turn, -inward)
                begin, since = turn, _change(k, h, near, since, start, end, z0, model, tally, work)
                closed = not closed
                if not closed:
                    note_apart(k, value_of(quintic, turn), model.contacts, tally)
        if (right[0] >= 0.0) != closed:
            near = left_s + d * root_of(quintic, begin, 1.0, 1.0 if closed else -1.0)
            since = _change(k, h, near, since, start, end, z0, model, tally, work)
            closed = not closed
        if closed:
            tally.impacts[TIME, k] += (right_s - since) * h
        left_s, left = right_s, right


@kernel
def _change(k, h, s, since, start, end, z0, model, tally, work):
    """Record that a contact closes or opens near s, a fraction of the step; return s exactly."""
    closed = tally.closed[0] & contact_bit(k) != np.uint64(0)
    interpolate(h, start, end, work)
    slope = 0.0
    for _ in range(3):
        value, slope, _ = interpolated(s, work)
        if slope != 0.0 and abs(value) < 1e-3 * abs(slope):
            s -= value / slope
    record(k, not closed, abs(slope) / h, z0, model, tally)
    if closed:
        tally.impacts[TIME, k] += (s - since) * h
    return s
