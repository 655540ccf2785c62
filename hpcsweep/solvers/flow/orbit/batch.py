"""Compute consecutive runs of a path that skip rules finish, in one compiled call.

Most runs of a study are without contact, or go to a periodic orbit that is known after a few
forcing periods; interpreting such a run took longer than its motion. `follow_orbits` computes them
all: the rule ``linear``, the transient (`transient`), one turn round the orbit with all that is
gathered along it, and its points in the order of the window procedure. It returns with a run that
the rules leave open, whose window the caller integrates, and for polling, to be called again: `Run`
keeps the state of the current run.
"""

import math
from typing import NamedTuple

import numpy as np

from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import BYTES, FLOAT, INT, VECTOR, entry_point, type_of
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.orbit.transient import end_of_transient
from hpcsweep.solvers.flow.period.march import march
from hpcsweep.solvers.flow.state.shared import (
    IMPACTS,
    MAXIMA,
    PEAKS,
    Tally,
    clear,
    read_shared,
    read_watch,
    wants_norms,
)
from hpcsweep.solvers.flow.state.state import copy_state, renew_rows
from hpcsweep.solvers.free import is_free
from hpcsweep.solvers.outcome import COMPLETE
from hpcsweep.solvers.records import Orbits
from hpcsweep.solvers.skip_rule import SkipRule

BEGIN, TRANSIENT, ORBIT = 0, 1, 2
"""Stages of a run."""
NUMBER, STAGE, TRANSIENT_PERIODS, NEWTON_PERIODS, ORBIT_PERIOD, PERIODS_ROUND = range(6)
"""Entries of `Run.place`: number and stage of the run, periods of its transient and of Newton's
method, orbit period, and periods integrated round the orbit."""
NEAR, MULTIPLIER = 0, 1
"""Entries of `Run.number`: distance below which to jump, Floquet multiplier after a jump."""
DONE, MORE, OPEN = 0, 1, 2
"""Why `follow_orbits` returns: no run is left; to be called again; a run is open."""
FREE_RUNS = 2000
LINEAR, CONVERGED, NEWTON = (int(rule) for rule in list(SkipRule)[1:])


class Rules(NamedTuple):
    """Conditions under which skip rules finish a run; passed as a plain tuple."""

    max_period: int
    settled: float
    same: float
    near: float
    """As in `transient.Closing`."""
    transient: int
    sampling: int
    """Forcing periods discarded, and of the window after them."""
    follow: bool
    """Whether a run starts from the end of the previous one, or each from the same state."""


class Run(NamedTuple):
    """The current run."""

    place: np.ndarray
    """(6,) int: see `NUMBER`."""
    number: np.ndarray
    """(2,): see `NEAR`."""
    z: np.ndarray
    """(2R,): state in kernel units."""
    reached: np.ndarray
    """(2R,): state at the end of the transient."""
    wanted: int
    """See `tally`."""
    points: np.ndarray
    """(max_period, 2n): workspace."""
    end: np.ndarray
    """(2n,): workspace."""


def new_run(n: int, size: int, max_period: int, wanted: int) -> Run:
    """Allocate the current run for n coordinates and kernel states of a size."""
    return Run(
        place=np.zeros(6, np.int64),
        number=np.zeros(2),
        z=np.empty(size),
        reached=np.empty(size),
        wanted=wanted,
        points=np.empty((max_period, 2 * n)),
        end=np.empty(2 * n),
    )


def new_orbits(n_runs: int, n: int, max_period: int, tally: Tally | None = None) -> Orbits:
    """Allocate the results of runs, of measures if a tally of them is given."""
    peaks, impacts = ((0,), (0, 0)) if tally is None else (tally.peaks.shape, tally.impacts.shape)
    whole = [np.zeros(n_runs, np.int64) for _ in range(4)]
    return Orbits(
        *whole,
        multiplier=np.full(n_runs, math.nan),
        points=np.full((n_runs, max_period, 2 * n), math.nan),
        contact=np.zeros(n_runs, np.uint64),
        peak_drift=np.full(n_runs, math.nan),
        modal_norm=np.full((n_runs, n), math.nan),
        peaks=np.full((n_runs, *peaks), math.nan),
        impacts=np.full((n_runs, *impacts), math.nan),
    )


def in_units(orbits: Orbits, n_runs: int, structure: Structure) -> Orbits:
    """Return the first `n_runs` results in the units of a structure."""
    done = Orbits(*(array[:n_runs] for array in orbits))
    keys = done.contact.tolist()
    bits = {key: structure.contact_bits(key) for key in set(keys)}
    contact = np.array([bits[key] for key in keys], np.uint64)
    return done._replace(contact=contact, peak_drift=done.peak_drift * structure.length_unit)


RULES = type_of((1, 0.0, 0.0, 0.0, 1, 1, True))
RUN = type_of(new_run(1, 2, 1, MAXIMA))
ORBITS = type_of(new_orbits(1, 1, 1))


@entry_point(
    (INT, INT, INT),
    *(BYTES, BYTES, BYTES, VECTOR, VECTOR, VECTOR, FLOAT, INT, RULES, RUN, ORBITS),
    specialises=True,
)
def follow_orbits(
    shared, watch, free, amplitudes, state, units, amplitude_unit, n_periods, rules, run, rows
):
    """Compute runs from `run` on, until one is left open or about `n_periods` have been integrated.

    Parameters
    ----------
    shared, watch, free : ndarray of bytes
        A packed `Shared`, `Watch` and `hpcsweep.solvers.free.Free`.
    amplitudes : ndarray, shape (k,)
    state : ndarray, shape (2n,)
        Of the run's start; changed in place.
    units : ndarray, shape (2n,)
        Units of states, and `amplitude_unit` of amplitudes, in kernel units.
    n_periods : int
        Forcing periods after which to return, for polling; also after `FREE_RUNS` runs without
        contact. Newton's method is not interrupted.
    rules : tuple
        The values of a `Rules`.
    run : Run
    rows : Orbits
        Receives the results, in the units of the kernels but for the points.

    Returns
    -------
    why : int
        DONE, MORE or OPEN.
    n_done : int
        Forcing periods integrated.
    outcome : int
        Of the open run's transient.
    """
    common = read_shared(shared)
    max_period, settled, same, near, transient, sampling, follow = rules
    place = run.place
    n_done = 0
    n_free = 0
    while place[NUMBER] < amplitudes.shape[0]:
        if n_done >= n_periods or n_free == FREE_RUNS:
            return MORE, n_done, COMPLETE
        k = place[NUMBER]
        amplitude = amplitudes[k]
        if place[STAGE] == BEGIN:
            if is_free(free, state, amplitude, run.end) != 0:
                n_free += 1
                _end_free(state, follow, run, rows)
                continue
            _begin(common, watch, state, units, near, run)
        if place[STAGE] == TRANSIENT:
            closing = (max_period, settled, same, run.number[NEAR])
            wanted = min(n_periods - n_done, transient - place[TRANSIENT_PERIODS])
            done, by_newton, period, run.number[MULTIPLIER], run.number[NEAR], outcome = (
                end_of_transient(shared, watch, run.z, amplitude / amplitude_unit, wanted, closing)
            )
            place[TRANSIENT_PERIODS] += done
            place[NEWTON_PERIODS] += by_newton
            n_done += done + by_newton
            if outcome != COMPLETE or (period == 0 and place[TRANSIENT_PERIODS] >= transient):
                return OPEN, n_done, outcome
            if period == 0:
                return MORE, n_done, COMPLETE
            place[STAGE] = ORBIT
            place[ORBIT_PERIOD] = period
            copy_state(run.z, run.reached)
        wanted = min(max(n_periods - n_done, 1), place[ORBIT_PERIOD] - place[PERIODS_ROUND])
        n_done += wanted
        if not _go_round(shared, common, amplitude / amplitude_unit, wanted, units, run, rows):
            copy_state(run.reached, run.z)
            return OPEN, n_done, COMPLETE
        if place[PERIODS_ROUND] == place[ORBIT_PERIOD]:
            _finish(transient + sampling, same, units, common.tally, run, rows)
            if follow:
                copy_state(rows.points[k, place[ORBIT_PERIOD] - 1], state)
            place[NUMBER] = k + 1
            place[STAGE] = BEGIN
    return DONE, n_done, COMPLETE


@kernel
def _end_free(state, follow, run, rows):
    """Write the results of a run without contact, and advance to the next."""
    k = run.place[NUMBER]
    rows.rule[k] = LINEAR
    rows.length[k] = 1
    rows.period[k] = 1
    for i in range(state.shape[0]):
        rows.points[k, 0, i] = run.end[i]
        if follow:
            state[i] = run.end[i]
    run.place[NUMBER] = k + 1


@kernel
def _begin(common, watch, state, units, near, run):
    """Begin the transient of a run."""
    n = state.shape[0] // 2
    half = run.z.shape[0] // 2
    for i in range(n):
        run.z[i] = state[i] / units[i]
        run.z[half + i] = state[n + i] / units[n + i]
    if half > n:
        renew_rows(run.z, common.no_tangent, common.model)
    read_watch(watch).since[0] = 0
    place = run.place
    place[STAGE] = TRANSIENT
    for i in range(TRANSIENT_PERIODS, len(place)):
        place[i] = 0
    run.number[NEAR] = near
    clear(common.tally)


@kernel
def _go_round(shared, common, amplitude, n_periods, units, run, rows):
    """Continue round the orbit; return whether the solver succeeded."""
    place = run.place
    n = units.shape[0] // 2
    half = run.z.shape[0] // 2
    for _ in range(n_periods):
        _, outcome = march(
            shared,
            run.z,
            amplitude,
            1,
            common.no_points,
            run.wanted,
            common.no_tangent,
            common.no_growth,
        )
        if outcome != COMPLETE:
            return False
        for i in range(n):
            rows.points[place[NUMBER], place[PERIODS_ROUND], i] = run.z[i] * units[i]
            rows.points[place[NUMBER], place[PERIODS_ROUND], n + i] = run.z[half + i] * units[n + i]
        place[PERIODS_ROUND] += 1
    return True


@kernel
def _finish(whole_run, same, units, tally, run, rows):
    """Write the results of a run after one turn round its orbit.

    Its points are in the order of the last ones of the window procedure, `whole_run` periods from
    the start: the point from which the next amplitude starts can decide which attractor it reaches,
    so that a shortened run must end at the same one.
    """
    place = run.place
    k, length = place[NUMBER], place[ORBIT_PERIOD]
    jumped = not math.isnan(run.number[MULTIPLIER])
    rows.rule[k] = NEWTON if jumped else CONVERGED
    rows.length[k] = length
    rows.cycles[k] = place[TRANSIENT_PERIODS] + place[NEWTON_PERIODS] + length
    rows.multiplier[k] = run.number[MULTIPLIER]
    rows.contact[k] = tally.contact[0]
    rows.peak_drift[k] = tally.peak_drift[0]
    if run.wanted & PEAKS:
        for w in range(tally.peaks.shape[0]):
            rows.peaks[k, w] = tally.peaks[w]
    if run.wanted & IMPACTS:
        for i in range(tally.impacts.shape[0]):
            for c in range(tally.impacts.shape[1]):
                rows.impacts[k, i, c] = tally.impacts[i, c]
    if wants_norms(run.wanted) and tally.free_time[0] > 0.0:
        for j in range(tally.modal.shape[0]):
            rows.modal_norm[k, j] = tally.modal[j] / tally.free_time[0]
    points = rows.points[k]
    rows.period[k] = _smallest_period(points, length, units, same)
    shift = (whole_run - place[TRANSIENT_PERIODS] - length) % length
    if shift > 0:
        for i in range(length):
            for j in range(units.shape[0]):
                run.points[i, j] = points[(i + shift) % length, j]
        for i in range(length):
            for j in range(units.shape[0]):
                points[i, j] = run.points[i, j]


@kernel
def _smallest_period(points, length, units, same):
    """Return the smallest period of an orbit's points; see `dynamics.orbit.smallest_period`."""
    for divisor in range(1, length):
        if length % divisor != 0:
            continue
        apart = 0.0
        for i in range(length):
            for j in range(units.shape[0]):
                difference = points[(i + divisor) % length, j] - points[i, j]
                apart = max(apart, abs(difference) / units[j])
        if apart <= same:
            return divisor
    return length
