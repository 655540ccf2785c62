r"""The modes of elements along a motion, and the guard that is passed first.

A guard (`hpcsweep.model.elements`) is a polynomial along a step, as displacements and velocities
are. It holds if it is proved not to rise through 0: one on y by the Hermite bound of `search` with
the bound of y'''' at hand, one on y' where y is proved to be monotonic. One that may be passed is
searched as a distance is, with the bound |g''''| <= sum_p |c_p| p (p - 1) (p - 2) (p - 3) (2 / h)^4
of its own coefficients, and in units that grow with its offset: what rounding hides is a part of
the size of a motion.
"""

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.elements import LEVEL, SHARE, SHIFT, SIGN, SPEED, SPRING, TAKES
from hpcsweep.solvers.flow.linear.polynomials import (
    evaluate_rows,
    expand_row,
    expand_rows,
    value_and_slope,
)
from hpcsweep.solvers.flow.search.search import (
    SAME_INSTANT,
    UNDECIDED,
    Bracket,
    Curve,
    Level,
    Part,
    first_passage,
    leaves,
    may_reach,
    rises_throughout,
    rising_root,
)
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.measures import ROUNDING


@inlined
def sets_of(modes, elements):
    """Return the contacts past their stops, and the key of the table."""
    past = key = np.uint64(0)
    for mode in modes.mode:
        past |= elements.sets[mode, 0]
        key |= elements.sets[mode, 1]
    return past, key


@inlined
def write_loads(modes, elements, pairs):
    """Write the loads of the sliders behind the pairs of the forcing."""
    n_loads = elements.stiffness.shape[0]
    first = pairs.shape[0] - n_loads
    e = modes.mode.shape[0] - n_loads
    for j in range(n_loads):
        load = elements.load[modes.mode[e + j]]
        pairs[first + j] = load[0] + load[1] * modes.state[e + j]


@inlined
def difference(e, first, elements, z):
    """Return the entry of an element's row in z[first:], displacements or velocities."""
    i, below = elements.rows[e]
    value = z[first + i]
    return value - z[first + below] if below >= 0 else value


@kernel
def holds(g, d, x, modes, elements, work):
    """Return whether guard g is not passed within d of a step from x to ``work.z_end``.

    True is proved.
    """
    e = elements.owner[g]
    sign, spring, speed = (
        elements.guard[g, SIGN],
        elements.guard[g, SPRING],
        elements.guard[g, SPEED],
    )
    if spring != 0.0 and speed != 0.0:
        return False
    half = work.z_end.shape[0] // 2
    i, below = elements.rows[e]
    bound4 = work.bounds[i] + (work.bounds[below] if below >= 0 else 0.0)
    sign = -sign if spring == 0.0 else sign
    level = elements.guard[g, LEVEL] + elements.guard[g, SHARE] * modes.state[e]
    g0 = sign * (difference(e, 0, elements, x) - level)
    g1 = sign * (difference(e, 0, elements, work.z_end) - level)
    slope0 = sign * difference(e, half, elements, x)
    slope1 = sign * difference(e, half, elements, work.z_end)
    if spring == 0.0:
        return rises_throughout(d, g0, slope0, g1, slope1, bound4)
    return not may_reach(d, g0, slope0, g1, slope1, bound4) or leaves(
        d, g0, slope0, g1, slope1, bound4
    )


@inlined
def all_hold(d, modes, elements, work):
    """Return whether no guard is passed within d of a step; True is proved."""
    for mode in modes.mode:
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            if not holds(g, d, work.x, modes, elements, work):
                return False
    return True


@kernel
def write_row(row, law, index, tables, work):
    """Write spring y + dashpot y' - level along a step into ``work.drift_rows``.

    Parameters
    ----------
    row : (int, int)
        Of `Elements.rows`.
    law : (float, float, float)

    Returns
    -------
    float
        Bound of its fourth derivative.
    """
    rows, out, half = work.rows, work.drift_rows, work.expanded.shape[0] // 2
    spring, dashpot, level = law
    for p in range(N_COEFFICIENTS):
        out[0, p] = 0.0
    for end in range(2):
        if row[end] < 0:
            continue
        for part in range(2):
            factor = dashpot if part else spring
            i = row[end] + part * half
            if factor == 0.0:
                continue
            if not work.expanded[i]:
                expand_row(tables.poly, index, i, work.x, rows)
                work.expanded[i] = True
            factor = -factor if end else factor
            for p in range(N_COEFFICIENTS):
                out[0, p] += factor * rows[i, p]
    bound4 = 0.0
    for p in range(4, N_COEFFICIENTS):
        bound4 += abs(out[0, p]) * (p * (p - 1.0) * (p - 2.0) * (p - 3.0))
    out[0, 0] -= level
    return bound4 * (2.0 / tables.h[index]) ** 4


@kernel
def _passage(g, segment, end, modes, tables, elements, work):
    """Return when guard g is first passed up to `end`.

    -1 if it is not (proved), `UNDECIDED` if rounding forbids to tell.
    """
    e, h = elements.owner[g], segment.h
    i, below = elements.rows[e]
    guard = elements.guard[g]
    offset = guard[LEVEL] + guard[SHARE] * modes.state[e]
    size = max(abs(work.x[i]), abs(work.x[below]) if below >= 0 else 0.0)
    unit = 1.0 / max(1.0, abs(offset), size)
    law = (guard[SPRING] * unit, guard[SPEED] * unit, offset * unit)
    bound4 = write_row((i, below), law, segment.index, tables, work)
    curve, level = Curve(work.drift_rows, 0, h), Level(guard[SIGN], 0.0)
    g0, slope0 = value_and_slope(curve.rows, 0, h, 0.0)
    g1, slope1 = value_and_slope(curve.rows, 0, h, end)
    part = Part(
        0.0, level.sign * g0, level.sign * slope0, end, level.sign * g1, level.sign * slope1
    )
    _, g0, slope0, _, g1, slope1 = part
    if guard[SHARE] != 0.0 and abs(g0) < ROUNDING and abs(slope0) * h < ROUNDING:
        # a slider that has just stuck, at its guard and at rest to rounding, moves on, if at all,
        # by its acceleration
        part = Part(0.0, min(g0, 0.0), min(slope0, 0.0), end, g1, slope1)
    if not may_reach(end, g0, slope0, g1, slope1, bound4) or leaves(
        end, g0, slope0, g1, slope1, bound4
    ):
        return -1.0
    a, ga, b, gb = first_passage(curve, part, level, bound4, work.stack)
    if a < 0.0:
        return a
    return rising_root(curve, Bracket(a, ga, b, gb), level)


@inlined
def first_change(segment, span, modes, tables, elements, work):
    """Find the first guard that is passed along a step, from ``work.x`` to ``work.z_end``.

    Returns
    -------
    g : int
        -1 if none is (proved), `UNDECIDED` if rounding forbids to tell.
    time : float
        When, or `span`. ``work.z_end`` is the state then.
    """
    first, time = -1, span
    for mode in modes.mode:
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            if first == UNDECIDED or holds(g, span, work.x, modes, elements, work):
                continue
            found = _passage(g, segment, time, modes, tables, elements, work)
            if found == UNDECIDED:
                first = UNDECIDED
            elif found >= 0.0:
                first, time = g, found
    if first >= 0:
        index, n = segment.index, work.z_end.shape[0]
        expand_rows(tables.poly, index, work.x, work.rows, work.expanded, n)
        evaluate_rows(work.rows, segment.h, time, work.z_end)
    return first, time


@kernel
def pass_guard(g, z, modes, elements):
    """Let an element pass a guard in a state z, in which the guard is put where it is."""
    e = elements.owner[g]
    i, below = elements.rows[e]
    half = z.shape[0] // 2
    guard = elements.guard[g]
    modes.mode[e] = elements.after[g]
    if guard[SPEED] == 0.0:
        level = guard[LEVEL] + guard[SHARE] * modes.state[e]
        z[i] = level + z[below] if below >= 0 else level
    elif guard[SPRING] == 0.0:
        z[half + i] = z[half + below] if below >= 0 else 0.0
    if guard[TAKES] > 0.0:
        state = difference(e, 0, elements, z) + guard[SHIFT]
        change = abs(state - modes.state[e])
        modes.path[e] += change
        modes.taken[e] += change > ROUNDING * max(abs(state), abs(guard[SHIFT]))
        modes.state[e] = state


@kernel
def change(first, segment, time, z, modes, elements, work):
    """Let elements pass their guards in a state z at that time of a step.

    With `first` all that are passed at the same instant: separately, each would need a segment
    without length and a table of its own.
    """
    passed = elements.owner[first]
    pass_guard(first, z, modes, elements)
    half = z.shape[0] // 2
    for e in range(modes.mode.shape[0]):
        mode = modes.mode[e]
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            guard = elements.guard[g]
            if e == passed or modes.mode[e] != mode:
                continue
            y, w = difference(e, 0, elements, z), difference(e, half, elements, z)
            level = guard[LEVEL] + guard[SHARE] * modes.state[e]
            value = guard[SIGN] * (guard[SPRING] * y + guard[SPEED] * w - level)
            rate = guard[SPRING] * w
            if guard[SPEED] != 0.0:
                i, below = elements.rows[e]
                _, a = value_and_slope(work.rows, half + i, segment.h, time)
                if below >= 0:
                    a -= value_and_slope(work.rows, half + below, segment.h, time)[1]
                rate += guard[SPEED] * a
            rate *= guard[SIGN]
            if rate > 0.0 and abs(value) <= SAME_INSTANT * segment.h * rate:
                pass_guard(g, z, modes, elements)
