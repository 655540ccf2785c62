r"""The modes of elements along a motion, and the guard that is passed first.

A guard (`hpcsweep.model.elements`) is a polynomial along a step, as displacements and velocities
are. It holds if it is proved not to rise through 0, those of `LANES` elements at once: y stays
within a window by the Hermite bound of `search` with the bound of y'''' at hand, and y' by that of
the slope. One that may be passed is searched as a distance is, with the bound of the fourth
derivative by its own coefficients, and in units that grow with its offset: what rounding hides is a
part of the size of a motion.

A slider that sticks does so at its strength, with y' = 0. Its force goes on at the same rate, 0, as
do those of all others, whatever their modes: u, u' and u'' are continuous, and if y'' is not 0 it
alone tells where y goes, slider by slider. So the guard at which it is starts from 0 with the slope
0, which the state tells; the slope of a polynomial of degree 15 at its end hides it in rounding.
"""

import math

import numpy as np

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.simd.vectors import LANES, fma, load, local_matrix, modulus, negative
from hpcsweep.model.backbone import SIZE
from hpcsweep.model.degrading import LOST, NO_FORCE, SLOPE, turn
from hpcsweep.model.elements import (
    AFTER,
    HELD,
    LEVEL,
    OWNER,
    SHARE,
    SHIFT,
    SIGN,
    SPEED,
    SPRING,
    TAKES,
)
from hpcsweep.model.observed import ROUNDING
from hpcsweep.solvers.flow.guard.extremum import SAME_PEAK, row_at_ends
from hpcsweep.solvers.flow.guard.rigid import (
    divide_by_time,
    hops,
    is_reaction,
    write_reaction,
)
from hpcsweep.solvers.flow.guard.search import (
    HERMITE_MIDDLE,
    HERMITE_SLOPE,
    SAME_INSTANT,
    UNDECIDED,
    Bracket,
    Level,
    Stretch,
    Trace,
    first_passage,
    leaves,
    may_reach,
    rising_root,
)
from hpcsweep.solvers.flow.state.state import degrade, time_of
from hpcsweep.solvers.flow.state.tables import N_COEFFICIENTS
from hpcsweep.solvers.flow.step.constraint import is_rigid
from hpcsweep.solvers.flow.step.polynomials import value_and_slope
from hpcsweep.solvers.flow.step.series import ONLY_FREE
from hpcsweep.solvers.flow.step.step import expand, state_at, write_row

ALL_LANES = (1 << LANES) - 1
NEAR = 2.0**-20
"""Part of the speed in a step within which the one of a guard may be passed at the same instant."""


@inlined
def sets_of(modes, elements):
    """Return the contacts past their stops, and the key of the table."""
    past = key = np.uint64(0)
    for mode in modes.mode:
        past |= elements.sets[mode, 0]
        key |= elements.sets[mode, 1]
    return past, key


@inlined
def write_loads(modes, elements, pairs, series):
    """Write the loads of the sliders behind the pairs of the forcing, and slopes that differ."""
    n_loads = elements.stiffness.shape[0]
    first = pairs.shape[0] - n_loads
    e = modes.mode.shape[0] - n_loads
    for j in range(n_loads):
        load = elements.load[modes.mode[e + j]]
        pairs[first + j] = load[0] + load[1] * modes.state[e + j]
        if degrade(modes):
            slope = modes.state[modes.mode.shape[0] + SIZE * j + SLOPE]
            if slope != series.slope[j]:
                series.slope[j] = slope
                series.key[1] = min(series.key[1], ONLY_FREE)


@inlined
def difference(e, first, elements, z):
    """Return the entry of an element's row in z[first:], displacements or velocities."""
    i, below = elements.rows[e]
    value = z[first + i]
    return value - z[first + below] if below >= 0 else value


@inlined
def offset_of(g, modes, elements):
    """Return c + r p of a guard."""
    held = elements.ways[g, HELD]
    return elements.guard[g, LEVEL] + elements.guard[g, SHARE] * modes.state[held]


@kernel
def write_windows(modes, elements, proof):
    """Write within which elongations and speeds the guards of each element are not passed.

    That of a guard on both, or on neither, is empty. Elements that are as they were are left alone.
    """
    windows = proof.windows
    for e in range(windows.shape[1]):
        if e >= modes.mode.shape[0]:
            windows[1, e] = windows[3, e] = math.inf
            windows[0, e] = windows[2, e] = -math.inf
            continue
        mode = modes.mode[e]
        same = windows[4, e] == mode + 1.0 and windows[5, e] == modes.state[e]
        if same and not degrade(modes):
            continue
        windows[4, e], windows[5, e] = mode + 1.0, modes.state[e]
        windows[1, e] = windows[3, e] = math.inf
        windows[0, e] = windows[2, e] = -math.inf
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            guard = elements.guard[g]
            first, slope = 0 if guard[SPEED] == 0.0 else 2, guard[SPRING] + guard[SPEED]
            end = offset_of(g, modes, elements) / slope
            if (guard[SPRING] != 0.0) == (guard[SPEED] != 0.0):
                windows[0, e] = math.inf
            elif guard[SIGN] * slope > 0.0:
                windows[first + 1, e] = min(windows[first + 1, e], end)
            else:
                windows[first, e] = max(windows[first, e], end)


@kernel
def write_ends(elements, proof, step):
    """Write elongations and speeds at both ends of a step from ``step.x`` to ``step.z_end``."""
    ends = proof.ends
    for e in range(elements.rows.shape[0]):
        row = (elements.rows[e, 0], elements.rows[e, 1], 0, 0.0)
        values, ends[4, e] = row_at_ends(row, step.x, step.z_end, step.bounds)
        ends[0, e], ends[1, e], ends[2, e], ends[3, e] = values


@inlined
def _within(value, error, row, first, windows):
    """Return which of `LANES` values are proved to be within their windows, see `negative`."""
    width = windows.shape[1]
    below = negative(value + error - load(windows, (row + 1) * width + first))
    return below & negative(load(windows, row * width + first) - value + error)


@kernel
def modes_kept(first, d, proof):
    """Return which of `LANES` elements keep their modes within d of a step, see `negative`.

    That is proved, by the bounds of `search`; `write_ends` has told of the step.
    """
    ends, windows = proof.ends, proof.windows
    width = ends.shape[1]
    y0, w0 = load(ends, first), load(ends, width + first)
    y1, w1 = load(ends, 2 * width + first), load(ends, 3 * width + first)
    cube = load(ends, 4 * width + first) * (d * d * d)
    more, error, none = cube * (d * HERMITE_MIDDLE), cube * HERMITE_SLOPE, cube * 0.0
    middle = fma(w0 - w1, d * (1.0 / 6.0), 0.5 * (y0 + y1))
    kept = _within(y0, none, 0, first, windows) & _within(y1, none, 0, first, windows)
    kept &= _within(fma(w0, 0.25 * d, y0), none, 0, first, windows)
    kept &= _within(middle, more, 0, first, windows)
    kept &= _within(fma(w1, -0.25 * d, y1), none, 0, first, windows)
    kept &= _within(w0, error, 2, first, windows) & _within(w1, error, 2, first, windows)
    return kept & _within((y1 - y0) * (3.0 / d) - w0 - w1, error, 2, first, windows)


@inlined
def all_keep_modes(d, elements, proof, step):
    """Return whether no guard is passed within d of a step; True is proved."""
    write_ends(elements, proof, step)
    for first in range(0, proof.ends.shape[1], LANES):
        if modes_kept(first, d, proof) != ALL_LANES:
            return False
    return True


@inlined
def drifts_stay(d, elements, peaks, ends):
    """Return whether no drift exceeds its peak within d of a step; True is proved.

    Sliders have to be all drifts; `ends` are those of a `Proof`. See `peaks` of `observe`.
    """
    first, width = elements.drifts, ends.shape[1]
    if first < 0:
        return False
    fourth = HERMITE_MIDDLE * (d * d) * (d * d)
    for p in range(0, elements.stiffness.shape[0], LANES):
        at = first + p
        y0, w0 = load(ends, at), load(ends, width + at)
        y1, w1 = load(ends, 2 * width + at), load(ends, 3 * width + at)
        peak = load(peaks, p)
        limit = peak * (1.0 + SAME_PEAK)
        middle = modulus(fma(w0 - w1, d * (1.0 / 6.0), 0.5 * (y0 + y1)))
        higher = negative(peak - modulus(y0)) | negative(peak - modulus(y1))
        higher |= negative(limit - modulus(fma(w0, 0.25 * d, y0)))
        higher |= negative(limit - modulus(fma(w1, -0.25 * d, y1)))
        higher |= negative(limit - fma(load(ends, 4 * width + at), fourth, middle))
        if higher & ((1 << min(LANES, elements.stiffness.shape[0] - p)) - 1):
            return False
    return True


@kernel
def _passage(g, segment, end, modes, tables, model, ends, step):
    """Return when guard g is first passed up to `end`.

    -1 if it is not (proved), `UNDECIDED` if rounding forbids to tell.
    """
    elements, e, h = model.elements, model.elements.ways[g, OWNER], segment.h
    i, below = elements.rows[e]
    guard = elements.guard[g]
    offset = offset_of(g, modes, elements)
    size = max(abs(step.x[i]), abs(step.x[below]) if below >= 0 else 0.0)
    unit = guard[SIGN] / max(1.0, abs(offset), size)
    law = (guard[SPRING] * unit, guard[SPEED] * unit, offset * unit)
    rows = local_matrix(1, N_COEFFICIENTS)
    if is_reaction(guard):
        bound4 = write_reaction(e, True, segment, model, tables, step, rows)
    else:
        bound4 = write_row((i, below), law, segment, tables, step, rows)
        if hops(e, step.x, model.contacts):
            bound4 = divide_by_time(law[0] * ends[1, e], h, rows)
    curve, level = Trace(rows, 0, h), Level(1.0, 0.0)
    g0, slope0 = value_and_slope(curve.rows, 0, h, 0.0)
    g1, slope1 = value_and_slope(curve.rows, 0, h, end)
    y, w = ends[0, e], ends[1, e]
    if guard[SHARE] != 0.0 and max(abs(law[0] * y - law[2]), abs(law[0] * w) * h) < ROUNDING:
        # it has just stuck; the polynomial is at its guard and at rest but for its own rounding
        g0, slope0 = min(g0, 0.0), min(slope0, 0.0)
    if is_rigid(e, model.contacts) and max(abs(g0), abs(slope0) * h) < ROUNDING:
        g0, slope0 = min(g0, 0.0), min(slope0, 0.0)  # likewise, at its stop or without a reaction
    if not may_reach(end, g0, slope0, g1, slope1, bound4) or leaves(
        end, g0, slope0, g1, slope1, bound4
    ):
        return -1.0
    part = Stretch(0.0, g0, slope0, end, g1, slope1)
    a, ga, b, gb = first_passage(curve, part, level, bound4)
    if a < 0.0:
        return a
    return rising_root(curve, Bracket(a, ga, b, gb), level)


@inlined
def _out_of_reach(g, d, modes, model, ends):
    """Return whether a guard on y alone is not passed within d of a step; True is proved."""
    guard, e = model.elements.guard[g], model.elements.ways[g, OWNER]
    way, end = guard[SIGN] * guard[SPRING], guard[SIGN] * offset_of(g, modes, model.elements)
    g0, slope0 = way * ends[0, e] - end, way * ends[1, e]
    g1, slope1 = way * ends[2, e] - end, way * ends[3, e]
    if guard[SPEED] != 0.0 or is_reaction(guard):
        return False
    if g0 == 0.0 and is_rigid(e, model.contacts):  # it has just bounced
        return leaves(d, g0, slope0, g1, slope1, ends[4, e])
    return not may_reach(d, g0, slope0, g1, slope1, ends[4, e])


@inlined
def first_change(segment, span, modes, tables, model, proof, step):
    """Find the first guard that is passed along a step, from ``step.x`` to ``step.z_end``.

    Returns
    -------
    g : int
        -1 if none is (proved), `UNDECIDED` if rounding forbids to tell.
    time : float
        When, or `span`. ``step.z_end`` is the state then, but inside a layer.
    """
    first, time, elements = -1, span, model.elements
    write_ends(elements, proof, step)
    for block in range(0, proof.ends.shape[1], LANES):
        kept = modes_kept(block, span, proof)
        for e in range(block, min(block + LANES, modes.mode.shape[0])):
            proof.kept[e] = kept >> (e - block) & 1
            if proof.kept[e]:
                continue
            mode = modes.mode[e]
            for g in range(elements.guards[mode], elements.guards[mode + 1]):
                if _out_of_reach(g, span, modes, model, proof.ends):
                    continue
                s = _passage(g, segment, time, modes, tables, model, proof.ends, step)
                if s == UNDECIDED:
                    return UNDECIDED, time
                if s >= 0.0:
                    first, time = g, s
    if first >= 0:
        state_at(segment, time, tables, step, step.z_end)
    return first, time


@kernel
def pass_guard(g, time, z, modes, elements):
    """Let an element pass a guard in a state z, in which the guard is put where it is."""
    e, guard, half = elements.ways[g, OWNER], elements.guard[g], z.shape[0] // 2
    i, below = elements.rows[e]
    modes.mode[e] = elements.ways[g, AFTER]
    if guard[SPEED] == 0.0:
        level = offset_of(g, modes, elements)
        z[i] = level + z[below] if below >= 0 else level
    if guard[SPRING] == 0.0:
        z[half + i] = z[half + below] if below >= 0 else 0.0
    if guard[TAKES] > 0.0:
        state = difference(e, 0, elements, z) + guard[SHIFT]
        change, size = abs(state - modes.state[e]), max(abs(state), abs(guard[SHIFT]))
        modes.path[e] += change
        modes.taken[e] += change > ROUNDING * max(size, _size_of(e, elements, z))
        modes.state[e] = state
    if guard[TAKES] < 0.0:
        y = difference(e, 0, elements, z) if guard[SPRING] == 0.0 else offset_of(g, modes, elements)
        _turn(e, guard[SIGN] * guard[SPRING], y, time, modes, elements)


@kernel
def _turn(e, way, y, time, modes, elements):
    """Let a slider that degrades pass an event of `degrading.turn`."""
    count = modes.mode.shape[0]
    at = count + SIZE * (e - count + elements.stiffness.shape[0])
    memory = modes.state[at : at + SIZE]
    mode, modes.state[e] = turn(way, y, modes.state[e], memory)
    modes.mode[e] = elements.first[e] + mode
    if mode == NO_FORCE:
        memory[LOST] = time


@inlined
def _size_of(e, elements, z):
    """Return what the elongation of a slider is known to the rounding of: sum |b_i u_i|."""
    j, size = e - elements.rows.shape[0] + elements.reach.shape[0], 0.0
    for i in range(elements.reach.shape[1]):
        size += abs(elements.reach[j, i] * z[i])
    return size


@kernel
def change(first, segment, time, z, modes, model, tables, proof, step):
    """Let elements pass their guards in a state z at that time of a step.

    With `first` all that are passed at the same instant: separately, each would need a segment
    without length. Those that keep their modes on the whole step are not.
    """
    elements, now = model.elements, time_of(segment.tau + time, model)
    passed = elements.ways[first, OWNER]
    pass_guard(first, now, z, modes, elements)
    for e in range(modes.mode.shape[0]):
        if proof.kept[e]:
            continue
        mode = modes.mode[e]
        for g in range(elements.guards[mode], elements.guards[mode + 1]):
            if e == passed or modes.mode[e] != mode:
                continue
            value, rate = _guard_and_rate(
                g, segment, time, z, modes, elements, tables, proof.ends, step
            )
            if rate > 0.0 and abs(value) <= SAME_INSTANT * segment.h * rate:
                pass_guard(g, now, z, modes, elements)


@inlined
def _guard_and_rate(g, segment, time, z, modes, elements, tables, ends, step):
    """Return a guard in a state z and its rate; 0 where it is far from being passed."""
    guard, e, half = elements.guard[g], elements.ways[g, OWNER], z.shape[0] // 2
    y, w = difference(e, 0, elements, z), difference(e, half, elements, z)
    value = guard[SPRING] * y + guard[SPEED] * w - offset_of(g, modes, elements)
    rate = guard[SPRING] * w
    fastest = max(abs(ends[1, e]), abs(ends[3, e]))
    if guard[SPEED] != 0.0 and (guard[SPRING] != 0.0 or abs(value) <= NEAR * fastest):
        for end in range(2):
            i = elements.rows[e, end]
            if i >= 0:
                expand(half + i, segment, tables, step)
                _, a = value_and_slope(step.rows, half + i, segment.h, time)
                rate += guard[SPEED] * (-a if end else a)
    return guard[SIGN] * value, guard[SIGN] * rate
