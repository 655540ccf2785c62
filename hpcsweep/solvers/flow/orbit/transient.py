"""End of a transient: the orbit that a motion has reached, or is verified to approach.

`watch_motion` watches a motion until its orbit has closed on itself, or is approached.
`newton.newton_orbit` then jumps to the orbit: F(z) = z with F the period map over p forcing periods
and M its tangent map. The orbit z* is accepted if

- it is a fixed point to `NEWTON_RESIDUAL`, measured or predicted from the fall of the residual,
  and corrected once more;
- it attracts: the spectral radius of M(z*) is at most `skip_rule.STABLE`;
- F is linear between the last points and it: F(z) - z* differs from M(z*) (z - z*) by no more
  than `LINEAR_DEFECT` of itself. The present state is then attracted as the linear map says, to
  z* and to nothing else.

`end_of_transient` does both, until the orbit is known or the transient is over.
"""

import math
from typing import NamedTuple

from hpcsweep.kernels.arena import as_long_as
from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, VECTOR, entry_point, type_of
from hpcsweep.solvers.flow.march.march import advance
from hpcsweep.solvers.flow.orbit.newton import newton_orbit
from hpcsweep.solvers.flow.state.shared import (
    LAYER_STEPS,
    LINEAR_STEPS,
    TABLES,
    read_shared,
    read_watch,
)
from hpcsweep.solvers.flow.state.state import copy_state
from hpcsweep.solvers.outcome import COMPLETE

ROUNDING = 2e-14
"""Points closer than this (relative) are equal to rounding."""
MAX_WORK = 2e7
"""Steps times (2R)^2 after which a call returns, for polling; a table counts as 2R steps.

These are operations of half a second at most, which the number of periods alone cannot bound: where
hardly any two of 52 stops are hit together twice, a period took 0.2 s after periods of 10 us.
"""
NEARER = 0.03
"""Factor on the distance below which a jump is tried, after one that was not verified."""


class Closing(NamedTuple):
    """When an orbit counts as closed, and when as approached."""

    max_period: int
    """Longest orbit period to look for, in forcing periods."""
    settled: float
    """Distance from the orbit (gaps, gaps omega_0)."""
    same: float
    """Distance between points that count as one."""
    near: float
    """Distance between points a period apart below which a jump is tried; 0: never."""


@inlined
def _to_go(e, before, rounding):
    """Return the distance that remains to an orbit, by e_k and e_(k-p), -inf if there is none."""
    if before >= 0.0 and e <= rounding:
        return 0.0
    return e * e / (before - e) if e < before else math.inf


@inlined
def _smallest_period(p, distance, same):
    """Return the smallest divisor of a period for which the last two points are the same."""
    for divisor in range(1, p):
        if p % divisor == 0 and distance[divisor] <= same:
            return divisor
    return p


@inlined
def begin_watch(watch, z):
    """Begin to watch a motion in a state z."""
    copy_state(z, watch.history[0])
    for p in range(watch.close.shape[0]):
        watch.close[p] = watch.falling[p] = 0


@inlined
def period_of(watch, z, closing):
    """Add the next point of a motion; return the period that it tells, see `watch_motion`."""
    max_period, settled, same, near = closing
    size, history, distance = z.shape[0], watch.history, watch.distance
    ring, long = max_period + 1, watch.history.shape[0]
    period = watch.since[0] = watch.since[0] + 1
    slot = past = period % ring
    place = period % long
    largest = 0.0
    for k in range(size):
        history[place, k] = z[k]
        largest = max(largest, abs(z[k]))
    for p in range(1, min(max_period, period) + 1):
        # slots of p periods ago, without a division
        past += ring - 1 if past == 0 else -1
        place += long - 1 if place == 0 else -1
        e = 0.0
        for k in range(size):
            e = max(e, abs(z[k] - history[place, k]))
        before = distance[past, p] if period >= 2 * p else -math.inf
        rounding = ROUNDING * (1.0 + largest)
        distance[slot, p] = e
        watch.close[p] = watch.close[p] + 1 if _to_go(e, before, rounding) <= settled else 0
        if watch.close[p] >= 2 * p + 1:
            return _smallest_period(p, distance[slot], same)
        watch.falling[p] = watch.falling[p] + 1 if e <= near and e < before else 0
        if watch.falling[p] >= 2 * p + 1:
            return -p
    return 0


@kernel
def watch_motion(shared, common, watch, z, amplitude, n_periods, closing):
    """Advance z until its orbit has closed on itself, for at most `n_periods`.

    Let e_k(p) be the largest difference of z(kT) and z((k - p)T). The orbit has period p, and the
    remaining distance is e r / (1 - r) with r = e_k / e_(k-p), once that is at most `settled` at
    every point of two consecutive orbits. An orbit that closes after p also closes after multiples
    of p, which may be detected earlier: the result is the smallest divisor of p for which the last
    two points are the `same`.

    Before that, once e_k(p) is at most `near` and has fallen at every point of two consecutive
    orbits, the orbit is approached: the period is returned with a minus sign.

    Returns
    -------
    n_done, period, outcome : int
        `period` is 0 if the orbit has not closed, negative if it is only approached. With 0 fewer
        than `n_periods` may be done, see `MAX_WORK`.
    """
    size = z.shape[0]
    first = watch.since[0]
    most = _steps(common.counts, size) + int(MAX_WORK / size**2)
    if first == 0:
        begin_watch(watch, z)
    for period in range(first + 1, first + n_periods + 1):
        _, outcome = advance(shared, z, amplitude, 1, None)
        if outcome != COMPLETE:
            return period - 1 - first, 0, outcome
        closed = period_of(watch, z, closing)
        if closed != 0:
            return period - first, closed, COMPLETE
        if _steps(common.counts, size) > most:
            return period - first, 0, COMPLETE
    return n_periods, 0, COMPLETE


@kernel
def _steps(counts, size):
    """Return the steps taken so far, and those that tables are worth."""
    return counts[LINEAR_STEPS] + counts[LAYER_STEPS] + size * counts[TABLES]


@entry_point(
    (INT, INT, INT, FLOAT, FLOAT, INT),
    BYTES,
    BYTES,
    VECTOR,
    FLOAT,
    INT,
    type_of((1, 0.0, 0.0, 0.0)),
    specialises=True,
)
def end_of_transient(shared, watch, z, amplitude, n_periods, closing):
    """Advance z to the end of its transient: until its orbit is known, for at most `n_periods`.

    Parameters
    ----------
    shared, watch : ndarray of bytes
        A packed `Shared` and a packed `Watch`.
    z : ndarray, shape (2R,)
        Changed in place; after a jump the point of the orbit.
    closing : tuple
        The values of a `Closing`, as a plain tuple: numba takes 0.2 us to unpack that, 1 us for a
        named one.

    Returns
    -------
    n_done : int
        Forcing periods of the motion until then; fewer than `n_periods` also where the work of one
        call is done (`MAX_WORK`).
    n_newton : int
        Forcing periods that Newton's method has integrated.
    period : int
        Of the orbit, 0 if it is not known.
    multiplier : float
        Modulus of the largest Floquet multiplier if a jump was made, else NaN.
    near : float
        Distance below which to try next.
    outcome : int
    """
    common = read_shared(shared)
    z = as_long_as(z, common.work.step.z_end)
    kept = read_watch(watch)
    max_period, settled, same, near = closing
    rules = Closing(max_period, settled, same, near)
    n_done = 0
    n_newton = 0
    while True:
        more, period, outcome = watch_motion(
            shared, common, kept, z, amplitude, n_periods - n_done, rules
        )
        n_done += more
        if outcome != COMPLETE or period >= 0:
            return n_done, n_newton, period, math.nan, near, outcome
        # a multiple of the period of an approached orbit may be detected first
        slot = kept.since[0] % (max_period + 1)
        for divisor in range(1, 1 - period):
            if period % divisor != 0 or kept.distance[slot, divisor] > near:
                continue
            accepted, more, multiplier = newton_orbit(shared, kept, divisor, amplitude)
            n_newton += more
            if accepted:
                copy_state(kept.point, z)
                return n_done, n_newton, divisor, multiplier, near, outcome
        near *= NEARER
        rules = Closing(max_period, settled, same, near)
        kept.since[0] = 0
