"""Consecutive forcing periods of structures with sliders: the state is (u, u', p), p behind.

A period depends on the state where it begins alone, which tells the mode of each slider: it slips
where its force is beyond its strength, or is that with which it slips, to rounding, and its
elongation goes on; p then follows it.
"""

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined
from hpcsweep.kernels.compile.entry_points import (
    BYTES,
    FLOAT,
    INT,
    MATRIX,
    VECTOR,
    entry_point,
    type_of,
)
from hpcsweep.kernels.simd.vectors import local_matrix, local_vector
from hpcsweep.model.elements import AFTER, LEVEL, SHARE, SIGN, SPRING, TAKES
from hpcsweep.model.observed import ROUNDING
from hpcsweep.solvers.flow.guard.elements import difference
from hpcsweep.solvers.flow.march.march import march
from hpcsweep.solvers.flow.orbit.transient import begin_watch, period_of
from hpcsweep.solvers.flow.state.shared import read_shared, read_watch
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.outcome import COMPLETE

PATH, EXCURSIONS, SLIPPING = range(3)
"""Rows of what sliders do: the sum of the changes of p, how often each has slipped by more than
rounding, and at the end of how many periods it does."""


@inlined
def begin_period(z, first, modes, elements):
    """Write p, ``z[first:]``, and the modes of a state; paths begin anew."""
    others = modes.mode.shape[0] - z.shape[0] + first
    for e in range(modes.mode.shape[0]):
        mode = modes.mode[e] = elements.first[e]
        modes.path[e], modes.taken[e] = 0.0, 0
        if e < others:
            continue
        p = modes.state[e] = z[first + e - others]
        y, speed = difference(e, 0, elements, z), difference(e, first // 2, elements, z)
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            guard = elements.guard[g]
            level, slips = guard[LEVEL], -elements.load[elements.ways[g, AFTER], 0]
            sign, near = guard[SIGN], ROUNDING * max(abs(level), abs(y))
            beyond = sign * (guard[SPRING] * y - guard[SHARE] * p)
            at = abs(beyond - sign * slips) <= near
            if beyond - sign * level > near or (at and sign * guard[SPRING] * speed > 0.0):
                modes.mode[e] = elements.ways[g, AFTER]


@inlined
def end_period(z, first, modes, elements, slid):
    """Write p into ``z[first:]``, add what sliders have done; return whether one has slipped."""
    others, moved = modes.mode.shape[0] - z.shape[0] + first, False
    for e in range(others, modes.mode.shape[0]):
        mode, p = modes.mode[e], modes.state[e]
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            if elements.guard[g, TAKES] > 0.0:
                load = elements.load[mode]
                p = load[0] + load[1] * modes.state[e] + difference(e, 0, elements, z)
        change = abs(p - modes.state[e])
        slid[PATH, e - others] += modes.path[e] + change
        slid[EXCURSIONS, e - others] += modes.taken[e]
        slid[SLIPPING, e - others] += change > 0.0
        moved |= modes.path[e] + change > 0.0
        z[first + e - others] = p
    return moved


@entry_point(
    (INT, INT, INT, INT),
    BYTES,
    BYTES,
    VECTOR,
    FLOAT,
    INT,
    INT,
    MATRIX,
    MATRIX,
    MATRIX,
    type_of((1, 0.0, 0.0, 0.0)),
    specialises=True,
)
def march_yielding(shared, watch, z, amplitude, n_periods, wanted, points, slid, place, closing):
    """Advance z over `n_periods` forcing periods, in place, or until its orbit has closed.

    Parameters
    ----------
    shared, watch : ndarray of bytes
        A packed `Shared`, and of states in their units a packed `Watch`.
    z : ndarray, shape (2R + L,)
        On failure the last state reached, with the p where that period began.
    wanted : int
        See `tally`.
    points : ndarray, shape (n_periods, 2R + L) or (0, 2R + L)
        Receives z(T), z(2T), ...; not written if empty.
    slid : ndarray, shape (3, L)
        See `PATH`; added to.
    place : ndarray, shape (2n + L, 2R + L) or (0, 2R + L)
        If not empty what takes z to the state, in its units, that closes.
    closing : tuple
        The values of a `transient.Closing`, none near.

    Returns
    -------
    n_done : int
    period : int
        Of the orbit, 0 if it is not known.
    still : int
        For how many periods, at the end, no slider has slipped.
    outcome : int
    """
    common, kept = read_shared(shared), read_watch(watch)
    model, modes, still = common.model, common.modes, 0
    first = z.shape[0] - slid.shape[1]
    motion = as_long_as(z[:first], common.work.step.z_end)
    nothing, point = local_matrix(first, 0), local_vector(place.shape[0])
    if place.shape[0] > 0 and kept.since[0] == 0:
        _write_place(place, z, point)
        begin_watch(kept, point)
    for period in range(n_periods):
        begin_period(z, first, modes, model.elements)
        _, outcome = march(shared, motion, amplitude, 1, nothing[:0], wanted, nothing, nothing[0])
        if outcome != COMPLETE:
            return period, 0, still, outcome
        still = 0 if end_period(z, first, modes, model.elements, slid) else still + 1
        if points.shape[0] > 0:
            copy_state(z, points[period])
        if place.shape[0] > 0:
            _write_place(place, z, point)
            closed = period_of(kept, point, closing)
            if closed != 0:
                return period + 1, closed, still, COMPLETE
    return n_periods, 0, still, COMPLETE


@inlined
def _write_place(place, z, point):
    """Write what closes."""
    for i in range(place.shape[0]):
        value = 0.0
        for k in range(z.shape[0]):
            value += place[i, k] * z[k]
        point[i] = value
