"""What ends a linear step: the first floor at the edge of its contact layer.

Each floor is cleared by a proof or searched (`search`); the contact set and the side of each layer
are those of the motion at hand.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import STOP
from hpcsweep.solvers.flow.layer.scheme import accelerations
from hpcsweep.solvers.flow.polynomials import expand_row, value_and_slope
from hpcsweep.solvers.flow.search import (
    UNDECIDED,
    Bracket,
    Curve,
    Level,
    Part,
    first_passage,
    leaves,
    may_reach,
    rising_root,
)


@kernel
def floor_bit(floor):
    """Give the bit of a floor in a contact set."""
    return np.uint64(1) << np.uint64(floor)


@kernel
def contact_key(tau, z, amplitude, model, a):
    """Find the contact set of a state outside all layers.

    A floor exactly at a stop of infinite sharpness touches if it is moving, or else
    accelerating, towards it. `a` is workspace for n accelerations.
    """
    key = np.uint64(0)
    n = a.shape[0]
    for i in range(n):
        x = z[i] - STOP
        if x == 0.0 and z[n + i] == 0.0:
            accelerations(amplitude * math.sin(model.omega * tau), z, model, a)
        if x > 0.0 or (x == 0.0 and (z[n + i] > 0.0 or (z[n + i] == 0.0 and a[i] > 0.0))):
            key |= floor_bit(i)
    return key


@kernel
def layer_edge(key, i, layer):
    """Give the edge of the layer of floor i in its contact state, and the sign of its way there."""
    if key & floor_bit(i):
        return Level(-1.0, STOP + layer)
    return Level(1.0, STOP - layer)


@kernel
def is_clear(key, i, d, x, z_end, layer, bound4):
    """Tell whether floor i keeps away from its layer, or leaves it, within d; True is proved.

    `x` is the augmented state at the start, `z_end` begins with the state at the end.
    """
    n = (x.shape[0] - 3) // 2
    sign, level = layer_edge(key, i, layer)
    g0, slope0 = sign * (x[i] - level), sign * x[n + i]
    g1, slope1 = sign * (z_end[i] - level), sign * z_end[n + i]
    return not may_reach(d, g0, slope0, g1, slope1, bound4) or leaves(
        d, g0, slope0, g1, slope1, bound4
    )


@inlined
def first_event(segment, span, layer, poly, work):
    """Find the first floor that reaches the edge of its layer within `span` of a step.

    Parameters
    ----------
    segment : Segment
    span : float
        The step from ``work.x`` ends there, at ``work.z_end``.
    poly : ndarray
        Of `Tables`.

    Returns
    -------
    floor : int
        -1 if none does (proved), `UNDECIDED` if rounding forbids to tell.
    bracket : Bracket
        See `first_passage`. No other floor reaches the edge of its layer before b.
    """
    key, index, h = segment.key, segment.index, segment.h
    x, z_end, rows, expanded = work.x, work.z_end, work.rows, work.expanded
    n = z_end.shape[0] // 2
    floor = -1
    first = Bracket(span, 0.0, span, 0.0)
    for i in range(n):
        if is_clear(key, i, span, x, z_end, layer, work.bounds[i]):
            continue
        if not expanded[i]:
            expand_row(poly, index, i, x, rows)
            expanded[i] = True
        curve = Curve(rows, i, h)
        edge = layer_edge(key, i, layer)
        sign, level = edge
        value, slope = z_end[i], z_end[n + i]
        if first.b < span:
            value, slope = value_and_slope(rows, i, h, first.b)
        start = sign * (x[i] - level), sign * x[n + i]
        end = sign * (value - level), sign * slope
        part = Part(0.0, start[0], start[1], first.b, end[0], end[1])
        found = first_passage(curve, part, edge, work.bounds[i], work.stack)
        if found.a == UNDECIDED:
            return UNDECIDED, found
        if found.a < 0.0:
            continue
        if floor >= 0:
            # both within one interval: the time of the first
            a = rising_root(Curve(rows, floor, h), first, layer_edge(key, floor, layer))
            b = rising_root(curve, found, edge)
            if b >= a:
                first = Bracket(a, 0.0, a, 0.0)
                continue
            found = Bracket(b, 0.0, b, 0.0)
        floor, first = i, found
    return floor, first
