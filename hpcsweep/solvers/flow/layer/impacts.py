"""Gather impacts over a collocation step, from its stages; see `observe.impacts`."""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import contact_force
from hpcsweep.solvers.flow.layer.quintic import hermite, root_of, turn_of, value_of
from hpcsweep.solvers.flow.observe.impacts import record
from hpcsweep.solvers.flow.rules.tableau import N_STAGES, NODES, WEIGHTS
from hpcsweep.solvers.flow.state.contacts import contact_bit, distance
from hpcsweep.solvers.measures import FORCE, TIME


@inlined
def impacts_in_layer(h, z0, z1, model, ways, tally, work):
    """Add the impacts of a step: the force by the rule of its stages, the rest by `_follow`."""
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
            force = contact_force(work.stage_u[s], 1.0, model.rho)
            tally.impacts[FORCE, k] += h * WEIGHTS[s] * force
        start = (distance(k, z0, contacts), sign * z0[n + i], sign * work.a[i])
        end = (distance(k, z1, contacts), sign * z1[n + i], sign * work.a_end[i])
        if start[0] >= 0.0:
            tally.closed[0] |= contact_bit(k)
        _follow(k, h, start, end, tally, work)


@inlined
def _follow(k, h, start, end, tally, work):
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
        begin, since = 0.0, left_s
        if inward * left[1] > 0.0 > inward * right[1] and inward * right[0] < 0.0:
            # possibly to the other side and back
            turn = turn_of(quintic, inward, left[1] / (left[1] - right[1]))
            if inward * value_of(quintic, turn) >= 0.0:
                near = left_s + d * root_of(quintic, 0.0, turn, -inward)
                begin, since = turn, _change(k, h, near, since, start, end, tally, work)
                closed = not closed
        if (right[0] >= 0.0) != closed:
            near = left_s + d * root_of(quintic, begin, 1.0, 1.0 if closed else -1.0)
            since = _change(k, h, near, since, start, end, tally, work)
            closed = not closed
        if closed:
            tally.impacts[TIME, k] += (right_s - since) * h
        left_s, left = right_s, right


@kernel
def _change(k, h, s, since, start, end, tally, work):
    """Record that a contact closes or opens near s, a fraction of the step; return s exactly."""
    closed = tally.closed[0] & contact_bit(k) != np.uint64(0)
    _interpolate(h, start, end, work)
    slope = 0.0
    for _ in range(3):
        value, slope = _interpolated(s, work)
        if slope != 0.0 and abs(value) < 1e-3 * abs(slope):
            s -= value / slope
    record(k, not closed, abs(slope) / h, tally)
    if closed:
        tally.impacts[TIME, k] += (s - since) * h
    return s


@kernel
def _interpolate(h, start, end, work):
    """Write the interpolant of distance and speed at ends and stages into ``work.newton``.

    In Newton's form, every node twice: divided differences, and nodes.
    """
    c, nodes = work.newton[0], work.newton[1]
    last = nodes.size - 1
    for s in range(N_STAGES + 2):
        at, x = 0.0, start[0]
        if s == N_STAGES + 1:
            at, x = 1.0, end[0]
        elif s > 0:
            at, x = NODES[s - 1], work.stage_u[s - 1]
        for i in (2 * s, 2 * s + 1):
            nodes[i], c[i] = at, x
    for i in range(last, 0, -1):
        if i % 2 == 0:
            c[i] = (c[i] - c[i - 1]) / (nodes[i] - nodes[i - 1])
        elif i == 1 or i == last:
            c[i] = h * (start[1] if i == 1 else end[1])
        else:
            c[i] = h * work.stage_v[i // 2 - 1]
    for order in range(2, last + 1):
        for i in range(last, order - 1, -1):
            c[i] = (c[i] - c[i - 1]) / (nodes[i] - nodes[i - order])


@kernel
def _interpolated(s, work):
    """Evaluate the polynomial of `_interpolate` and its slope."""
    c, nodes = work.newton[0], work.newton[1]
    value, slope = 0.0, 0.0
    for i in range(c.size - 1, -1, -1):
        slope = slope * (s - nodes[i]) + value
        value = value * (s - nodes[i]) + c[i]
    return value, slope
