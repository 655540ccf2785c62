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

from hpcsweep.kernels.arena import Arena
from hpcsweep.kernels.compile import kernel
from hpcsweep.kernels.compile.entry_points import BYTES, INT, entry_point, type_of
from hpcsweep.kernels.compile.places import allocate, zeros
from hpcsweep.kernels.simd.vectors import local_matrix
from hpcsweep.model.observed import ANY_PEAK, IMPACT
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.flow.march.march import march
from hpcsweep.solvers.flow.orbit.transient import end_of_transient
from hpcsweep.solvers.flow.state.shared import (
    MAXIMA,
    Tally,
    clear,
    read_shared,
    read_watch,
    wants_norms,
)
from hpcsweep.solvers.flow.state.state import copy_matrix, copy_state, renew_rows
from hpcsweep.solvers.free import DECAYS, is_free
from hpcsweep.solvers.outcome import COMPLETE
from hpcsweep.solvers.records import Orbits
from hpcsweep.solvers.skip_rule import SkipRule

DONE, MORE, OPEN = 0, 1, 2
"""Why `follow_orbits` returns: no run is left; to be called again; a run is open."""
FREE_RUNS = 2000
LINEAR, CONVERGED, NEWTON = (int(rule) for rule in list(SkipRule)[1:])


class Rules(NamedTuple):
    """Conditions under which skip rules finish a run."""

    max_period: int = 1
    settled: float = 0.0
    same: float = 0.0
    near: float = 0.0
    """As in `transient.Closing`."""
    transient: int = 1
    sampling: int = 1
    """Forcing periods discarded, and of the window after them."""
    follow: bool = True
    """Whether a run starts from the end of the previous one, or each from the same state."""


class Run(NamedTuple):
    """The runs to compute, and the state of the current one."""

    rules: Rules
    wanted: int
    """See `tally`."""
    amplitude_unit: float
    """Of amplitudes, in kernel units."""
    amplitudes: np.ndarray = zeros("k")
    units: np.ndarray = zeros("2n")
    """Of states, in kernel units."""
    state: np.ndarray = zeros("2n")
    """From which the current run starts."""
    number: np.ndarray = zeros(1, dtype=int)
    """Of the current run."""
    begun: np.ndarray = zeros(1, dtype=int)
    """Whether its transient has begun: 1 or 0."""
    near: np.ndarray = zeros(1)
    """Distance below which to jump."""
    transient: np.ndarray = zeros(1, dtype=int)
    """Forcing periods of its transient; `newton`, those of Newton's method."""
    newton: np.ndarray = zeros(1, dtype=int)
    period: np.ndarray = zeros(1, dtype=int)
    """Of its orbit, 0 until that is known."""
    multiplier: np.ndarray = zeros(1)
    """Floquet multiplier after a jump, else NaN."""
    turned: np.ndarray = zeros(1, dtype=int)
    """Forcing periods integrated round the orbit."""
    z: np.ndarray = zeros("2R")
    """In kernel units; `reached`, at the end of the transient."""
    reached: np.ndarray = zeros("2R")
    points: np.ndarray = zeros("max period", "2n")
    end: np.ndarray = zeros("2n")
    """Workspace, and `points`."""


def new_run(
    rules: Rules, n_runs: int, size: int, units: np.ndarray, wanted: int, amplitude_unit: float
) -> Run:
    """Allocate the state of runs for kernel states of a size."""
    sizes = {"k": n_runs, "2n": len(units), "2R": size, "max period": rules.max_period}
    numbers = {"rules": rules, "wanted": wanted, "amplitude_unit": amplitude_unit}
    return allocate(Run, sizes, units=units, **numbers)


def new_orbits(n_runs: int, n: int, max_period: int, tally: Tally | None = None) -> Orbits:
    """Allocate the results of runs, of measures if a tally of them is given."""
    peaks, impacts = ((0,), (0, 0)) if tally is None else (tally.peaks.shape, tally.impacts.shape)
    whole = np.zeros(n_runs, np.int64)
    return Orbits(
        *(whole, whole.copy(), whole.copy(), whole.copy()),
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


RUN = Arena(new_run(Rules(), 1, 2, np.ones(2), MAXIMA, 1.0))
read_run = RUN.read
ORBITS = type_of(new_orbits(1, 1, 1))


@entry_point((INT, INT, INT), BYTES, BYTES, BYTES, BYTES, INT, ORBITS, specialises=True)
def follow_orbits(shared, watch, free, packed, n_periods, rows):
    """Compute runs, until one is left open or about `n_periods` have been integrated.

    Parameters
    ----------
    shared, watch, free, packed : ndarray of bytes
        A packed `Shared`, `Watch`, `hpcsweep.solvers.free.Free` and `Run`.
    n_periods : int
        Forcing periods after which to return, for polling; also after `FREE_RUNS` runs without
        contact. Newton's method is not interrupted.
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
    common, run = read_shared(shared), read_run(packed)
    rules = run.rules
    n_done = 0
    n_free = 0
    while run.number[0] < run.amplitudes.shape[0]:
        if n_done >= n_periods or n_free == FREE_RUNS:
            return MORE, n_done, COMPLETE
        amplitude = run.amplitudes[run.number[0]]
        if run.begun[0] == 0:
            if is_free(free, run.state, amplitude, run.end) == DECAYS:
                n_free += 1
                _end_free(run, rows)
                continue
            _begin(run, watch, common.tally, common.model)
        amplitude /= run.amplitude_unit
        if run.period[0] == 0:
            closing = (rules.max_period, rules.settled, rules.same, run.near[0])
            wanted = min(n_periods - n_done, rules.transient - run.transient[0])
            done, by_newton, run.period[0], run.multiplier[0], run.near[0], outcome = (
                end_of_transient(shared, watch, run.z, amplitude, wanted, closing)
            )
            run.transient[0] += done
            run.newton[0] += by_newton
            n_done += done + by_newton
            settled = run.period[0] > 0
            if outcome != COMPLETE or not (settled or run.transient[0] < rules.transient):
                return OPEN, n_done, outcome
            if not settled:
                return MORE, n_done, COMPLETE
            copy_state(run.z, run.reached)
        wanted = min(max(n_periods - n_done, 1), run.period[0] - run.turned[0])
        n_done += wanted
        if not _go_round(shared, amplitude, wanted, run, rows):
            copy_state(run.reached, run.z)
            return OPEN, n_done, COMPLETE
        if run.turned[0] == run.period[0]:
            _finish(common.tally, run, rows)
    return DONE, n_done, COMPLETE


@kernel
def _end_free(run, rows):
    """Write the results of a run without contact, and advance to the next."""
    k = run.number[0]
    rows.rule[k] = LINEAR
    rows.length[k] = 1
    rows.period[k] = 1
    copy_state(run.end, rows.points[k, 0])
    if run.rules.follow:
        copy_state(run.end, run.state)
    run.number[0] += 1


@kernel
def _begin(run, watch, tally, model):
    """Begin the transient of a run."""
    n = run.state.shape[0] // 2
    half = run.z.shape[0] // 2
    for i in range(n):
        run.z[i] = run.state[i] / run.units[i]
        run.z[half + i] = run.state[n + i] / run.units[n + i]
    if half > n:
        renew_rows(run.z, None, model)
    read_watch(watch).since[0] = 0
    run.begun[0] = 1
    run.transient[0] = run.newton[0] = run.period[0] = run.turned[0] = 0
    run.near[0] = run.rules.near
    clear(tally)


@kernel
def _go_round(shared, amplitude, n_periods, run, rows):
    """Continue round the orbit; return whether the solver succeeded."""
    units = run.units
    n = units.shape[0] // 2
    half = run.z.shape[0] // 2
    empty = local_matrix(run.z.shape[0], 0)
    for _ in range(n_periods):
        _, outcome = march(shared, run.z, amplitude, 1, empty[:0], run.wanted, empty, empty[0])
        if outcome != COMPLETE:
            return False
        point = rows.points[run.number[0], run.turned[0]]
        for i in range(n):
            point[i] = run.z[i] * units[i]
            point[n + i] = run.z[half + i] * units[n + i]
        run.turned[0] += 1
    return True


@kernel
def _finish(tally, run, rows):
    """Write the results of a run after one turn round its orbit, and advance to the next.

    Its points are in the order of the last ones of the window procedure: the point from which the
    next amplitude starts can decide which attractor it reaches, so that a shortened run must end at
    the same one.
    """
    k, length = run.number[0], run.period[0]
    rows.rule[k] = CONVERGED if math.isnan(run.multiplier[0]) else NEWTON
    rows.length[k] = rows.period[k] = length
    rows.cycles[k] = run.transient[0] + run.newton[0] + length
    rows.multiplier[k] = run.multiplier[0]
    rows.contact[k] = tally.contact[0]
    rows.peak_drift[k] = tally.peak_drift[0]
    if run.wanted & ANY_PEAK:
        copy_state(tally.peaks, rows.peaks[k])
    if run.wanted & IMPACT:
        copy_matrix(tally.impacts, rows.impacts[k])
    if wants_norms(run.wanted) and tally.free_time[0] > 0.0:
        for j in range(tally.modal.shape[0]):
            rows.modal_norm[k, j] = tally.modal[j] / tally.free_time[0]
    points = rows.points[k]
    whole_run = run.rules.transient + run.rules.sampling
    shift = (whole_run - run.transient[0] - length) % length
    for i in range(length):
        copy_state(points[i], run.points[i])
    for i in range(length):
        copy_state(run.points[(i + shift) % length], points[i])
    if run.rules.follow:
        copy_state(points[length - 1], run.state)
    run.number[0] += 1
    run.begun[0] = run.period[0] = 0
