"""Check the invariants that the numbers of every committed run satisfy."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.orbit import closed_period, orbit_period
from hpcsweep.model.structure import Structure
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.settings import SweepSettings
from hpcsweep.studies.variable import CONTACT_SET, MISSING, RULES, VALID, Variable

Broken = dict[str, np.ndarray]
"""Where each invariant is broken, shape (k,), by what should be so."""


def broken_relations(
    settings: SweepSettings, amplitude: np.ndarray, rows: Rows, units: np.ndarray
) -> dict[str, np.ndarray]:
    """Check k runs against the relations of `hpcsweep.studies.sweep.runs`.

    Parameters
    ----------
    settings : SweepSettings
    amplitude : ndarray, shape (k,)
    rows : dict of str to ndarray
        The file's variables, first axis the k runs.
    units : ndarray, shape (k, 2n)
        Units of the states of each run, `Structure.units_at`.

    Returns
    -------
    dict of str to ndarray of bool, shape (k,)
    """
    broken = _of_the_run(settings, rows)
    if "poincare" in rows:
        broken |= _of_points(settings, rows, units)
    if "contact" in rows:
        linear = rows["skip_rule"] == SkipRule.LINEAR
        broken["contact of a linear run is empty"] = linear & (rows["contact"] != 0)
    if "drift" in rows:
        unknown = (rows["outcome"] == Outcome.COMPLETE) & np.isnan(rows["drift"])
        broken["drift is NaN only without forcing"] = unknown & (amplitude != 0)
    if "motion" in rows:
        broken |= _of_motion(rows)
    return broken


def of_each(
    variables: Sequence[Variable], rows: Rows, structure: Structure, slots: Mapping[str, str]
) -> Broken:
    """Check what each variable declares: limits or codes, and what it is where there is nothing.

    Parameters
    ----------
    variables : sequence of Variable
    rows : dict of str to ndarray
        First axis k runs.
    structure : Structure
    slots : mapping of str to str
        By each dimension with room for several things the variable that is above 0 where there is
        one. Elsewhere, and without such a dimension in runs that are not complete, there is none.

    Returns
    -------
    dict of str to ndarray of bool, shape (k,)
        Where each invariant is broken.
    """
    complete = rows["outcome"] == Outcome.COMPLETE
    unknown = ~np.uint64(sum(1 << (k - 1) for k in structure.contact_numbers))
    broken: Broken = {}
    for v in (v for v in variables if v.name in rows):  # not all in a file of an earlier version
        values, slot = rows[v.name], next((dim for dim in v.dims if dim in slots), "")
        held = rows[slots[slot]] > 0 if slot else complete
        inner, outer = tuple(range(held.ndim, values.ndim)), tuple(range(1, held.ndim))
        # of floats only NaN is not itself
        nothing = values != values if values.dtype.kind == "f" else values == 0
        missing = _over(np.all, nothing, inner)
        rule, least, most = _rule(v)
        if rule:
            is_set = v.flags == CONTACT_SET
            right = (values & unknown) == 0 if is_set else (values >= least) & (values <= most)
            wrong = ~_over(np.all, right | nothing if v.optional else right, inner)
            if v.failed != VALID:
                wrong &= held
            broken[f"{v.name} {rule}"] = _over(np.any, wrong, outer)
        if v.failed == MISSING:
            where = f"where there is no {slot}" if slot else "of a failed run"
            broken[f"{v.name} {where} is {v.missing}"] = _over(np.any, ~(held | missing), outer)
    return broken


def _over(function: Callable, values: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    # without axes it would cost as much
    return function(values, axis=axes) if axes else values


@cache
def _rule(v: Variable) -> tuple[str, float, float]:
    """Return what a variable declares of its values in words, and their limits."""
    if v.flags == CONTACT_SET:
        return "has bits of existing contacts only", 0, np.inf
    if v.flags is not None and not isinstance(v.flags, str):
        # the numbers of an enumeration follow one another
        codes = [int(code) for code in v.flags if code or v.limits]
        return f"is one of {min(codes)} to {max(codes)}", min(codes), max(codes)
    return (RULES[v.limits], *v.limits) if v.limits else ("", 0, 0)


def listed(broken: Mapping[str, np.ndarray]) -> list[tuple[int, str]]:
    """Return the rows and names of broken invariants, given where each is broken."""
    return sorted(
        (int(row), f"not so: {invariant}")
        for invariant, where in broken.items()
        for row in np.flatnonzero(where)
    )


def _of_the_run(settings: SweepSettings, rows: Rows) -> Broken:
    outcome, skip_rule = rows["outcome"], rows["skip_rule"]
    period, cycles = rows["orbit_period"], rows["cycles"]
    complete = outcome == Outcome.COMPLETE
    # a motion classified off the path differs from the end of the path
    on_path = rows.get("classification_cycles", np.zeros(1)) <= 0
    plain = skip_rule == SkipRule.NONE
    used = [SkipRule.NONE, *(SkipRule[rule.upper()] for rule in settings.skip)]
    whole_run = settings.transient_cycles + settings.sampling_cycles
    linear = complete & (skip_rule == SkipRule.LINEAR)
    return {
        "skip_rule is a rule the job allows": ~np.isin(skip_rule, used),
        "orbit_period is at most max_orbit_period": period > settings.max_orbit_period,
        "a run that was cut short has an orbit_period": complete & on_path & ~plain & (period == 0),
        "a linear run has orbit_period 1 and no cycles": linear & ((period != 1) | (cycles != 0)),
        "cycles is at least that of transient and window": complete & plain & (cycles < whole_run),
    }


def _of_motion(rows: Rows) -> Broken:
    motion, period = rows["motion"], rows["orbit_period"]
    complete = rows["outcome"] == Outcome.COMPLETE
    periodic, apart = motion == MotionClass.PERIODIC, motion == MotionClass.NO_CONTACT
    other = complete & ~(periodic | apart)
    broken = {
        "motion of a failed run is failed, of no other": complete == (motion == MotionClass.FAILED),
        "motion with an orbit_period is periodic or free of contact": other & (period > 0),
        "motion is periodic only with an orbit_period": periodic & (period == 0),
    }
    if "contact" in rows:
        free = (rows["contact"] == 0) & complete
        if "slider_energy" in rows:
            free &= ~rows["slider_energy"].any(axis=-1)
        broken["motion is free of contact where contact is empty"] = free != apart
    return broken


def _of_points(settings: SweepSettings, rows: Rows, units: np.ndarray) -> Broken:
    points, n_points, period = rows["poincare"], rows["n_points"], rows["orbit_period"]
    complete = rows["outcome"] == Outcome.COMPLETE
    window = points.shape[1]
    broken = of_points(rows, complete, np.where(period > 0, period, window), "final_state")
    if "classification_cycles" in rows:
        broken["final_state is the last point of poincare"] &= rows["classification_cycles"] == 0
    closes = orbit_period if settings.classify_cycles is None else closed_period
    judged_so = complete & (period == 0) & (n_points == window) & ("motion" not in rows)
    longest, same = settings.max_orbit_period, settings.period_tolerance
    hidden = np.zeros(complete.size, bool)
    for row in np.flatnonzero(judged_so):
        hidden[row] = closes(points[row] / units[row], longest, same) > 0
    return broken | {"orbit_period is 0 only where the points do not repeat": hidden}


def misnumbered(ids: np.ndarray) -> np.ndarray:
    """Return in which rows the things in their slots, (k, slots), are not numbered from 1."""
    return ((ids > 0) & (ids != np.arange(1, ids.shape[1] + 1))).any(axis=1)


def of_points(rows: Rows, held: np.ndarray, expected: np.ndarray, last: str) -> Broken:
    """Check which stroboscopic points are stored of what is `held`, in runs or in their slots.

    Parameters
    ----------
    rows : dict of str to ndarray
    held : ndarray of bool
    expected : ndarray of int
        Number of points.
    last : str
        Name of the variable that is the last of them.

    Returns
    -------
    dict of str to ndarray of bool, shape (k,)
    """
    points, count = rows["poincare"], np.where(held, rows["n_points"], 0)
    room = points.shape[-2]
    stored = np.arange(room) < count[..., None]
    finite, missing = np.isfinite(points).all(axis=-1), np.isnan(points).all(axis=-1)
    right = np.where(stored, finite, missing).all(axis=-1)
    end = np.take_along_axis(points, np.clip(count, 1, room)[..., None, None] - 1, -2)[..., 0, :]
    broken = {
        "n_points is the orbit_period, or all that are stored without one": count != expected,
        "poincare is finite in n_points points and NaN after": ~right,
        f"{last} is the last point of poincare": (end != rows[last]).any(axis=-1),
    }
    outer = tuple(range(1, held.ndim))
    return {name: np.any(held & where, axis=outer) for name, where in broken.items()}
