"""Check the invariants that the numbers of every committed run satisfy."""

from collections.abc import Mapping

import numpy as np

from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.orbit import closed_period, orbit_period
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.solvers.skip_rule import SkipRule
from hpcsweep.studies.settings import MEASURES

ENDED = [outcome for outcome in Outcome if outcome is not Outcome.NOT_COMPUTED]
"""How a committed run may have ended."""
ROUNDING = 1e-9
"""Allowed excess over 1 of a mean modal norm."""


def broken_invariants(
    structure,
    settings,
    amplitude: np.ndarray,
    rows: dict[str, np.ndarray],
    units: np.ndarray,
) -> list[tuple[int, str]]:
    """Check k runs against the invariants of `hpcsweep.studies.sweep.runs`.

    Parameters
    ----------
    structure : Structure
    settings : SweepSettings
    amplitude : ndarray, shape (k,)
    rows : dict of str to ndarray
        The file's variables, first axis the k runs.
    units : ndarray, shape (k, 2n)
        Units of the states of each run, `Structure.units_at`.

    Returns
    -------
    list of (int, str)
        Row and message.
    """
    broken = {**_of_the_run(settings, rows), **_of_failures(rows)}
    if "poincare" in rows:
        broken.update(_of_points(settings, rows, units))
    if "contact" in rows:
        broken.update(_of_contact(structure, rows))
    complete = rows["outcome"] == Outcome.COMPLETE
    if "drift" in rows:
        drift = rows["drift"]
        good = np.where(amplitude == 0, np.isnan(drift), np.isfinite(drift) & (drift >= 0))
        broken["drift is finite and not negative"] = complete & ~good
    for name in rows.keys() & set(MEASURES):
        # a contact with a layer also pulls as it closes
        least = -np.inf if name == "impulse" else 0.0
        most = 1 + ROUNDING if name == "contact_time" else np.finfo(float).max
        with np.errstate(invalid="ignore"):
            good = ((rows[name] >= least) & (rows[name] <= most)).all(axis=1)
        broken[f"{name} is finite, and a size or a share"] = complete & ~good
    if "modal_norm" in rows:
        norm = rows["modal_norm"]
        with np.errstate(invalid="ignore"):
            good = ((norm >= 0) & (norm <= 1 + ROUNDING)).all(axis=1)
        broken["modal_norm lies between 0 and 1"] = complete & ~(good | np.isnan(norm).all(axis=1))
    if "motion" in rows:
        broken.update(_of_motion(rows))
    if "lyapunov" in rows:
        broken["lyapunov is not +inf"] = rows["lyapunov"] == np.inf
    return listed(broken)


def listed(broken: Mapping[str, np.ndarray]) -> list[tuple[int, str]]:
    """Return the rows and names of broken invariants, given where each is broken."""
    return sorted(
        (int(row), f"not so: {invariant}")
        for invariant, where in broken.items()
        for row in np.flatnonzero(where)
    )


def of_outcome(outcome: np.ndarray) -> dict[str, np.ndarray]:
    """Check that a run ended in a way that is known."""
    return {"outcome is one of 1 to 4": ~np.isin(outcome, ENDED)}


def _of_the_run(settings, rows: dict) -> dict[str, np.ndarray]:
    outcome, skip_rule = rows["outcome"], rows["skip_rule"]
    period, cycles = rows["orbit_period"], rows["cycles"]
    complete = outcome == Outcome.COMPLETE
    # a motion classified off the path differs from the end of the path
    off = (
        rows["classification_cycles"] > 0
        if "classification_cycles" in rows
        else np.zeros(len(period), bool)
    )
    used = [SkipRule.NONE, *(SkipRule[rule.upper()] for rule in settings.skip)]
    whole_run = settings.transient_cycles + settings.sampling_cycles
    linear = complete & (skip_rule == SkipRule.LINEAR)
    return {
        **of_outcome(outcome),
        "skip_rule is a rule the job allows": ~np.isin(skip_rule, used),
        "orbit_period is at most max_orbit_period": (period < 0)
        | (period > settings.max_orbit_period),
        "a run that was cut short has an orbit_period": complete
        & ~off
        & (skip_rule != SkipRule.NONE)
        & (period == 0),
        "a linear run has orbit_period 1 and no cycles": linear & ((period != 1) | (cycles != 0)),
        "cycles is at least that of transient and window": (cycles < 0)
        | (complete & (skip_rule == SkipRule.NONE) & (cycles < whole_run)),
        "final_state is finite": ~np.isfinite(rows["final_state"]).all(axis=1),
    }


def _of_motion(rows: dict) -> dict[str, np.ndarray]:
    motion, period, cycles = rows["motion"], rows["orbit_period"], rows["classification_cycles"]
    complete = rows["outcome"] == Outcome.COMPLETE
    failed = motion == MotionClass.FAILED
    orbit = (motion == MotionClass.PERIODIC) | (motion == MotionClass.NO_CONTACT)
    broken = {
        "motion is one of 1 to 7": (motion < 1) | (motion > max(MotionClass)),
        "motion of a failed run is failed, of no other": complete == failed,
        "motion with an orbit_period is periodic or free of contact": complete
        & (period > 0)
        & ~orbit,
        "motion is periodic only with an orbit_period": (motion == MotionClass.PERIODIC)
        & (period == 0),
        "classification_cycles is not negative": cycles < 0,
    }
    if "contact" in rows:
        free = (rows["contact"] == 0) & complete
        broken["motion is free of contact where contact is empty"] = free != (
            motion == MotionClass.NO_CONTACT
        )
    return broken


def _of_failures(rows: dict) -> dict[str, np.ndarray]:
    """Check that a failed run has no results but the state that it reached."""
    failed = rows["outcome"] != Outcome.COMPLETE
    broken = {}
    for name in ("orbit_period", "n_points", "contact"):
        if name in rows:
            broken[f"{name} of a failed run is 0"] = failed & (rows[name] != 0)
    numbers = ("poincare", "drift", "modal_norm", "lyapunov", "lyapunov_low", "lyapunov_high")
    for name in (*numbers, *MEASURES):
        if name in rows:
            kept = ~np.isnan(rows[name]).reshape(failed.size, -1).all(axis=1)
            broken[f"{name} of a failed run is NaN"] = failed & kept
    return broken


def _of_points(settings, rows: dict, units: np.ndarray) -> dict[str, np.ndarray]:
    points, n_points, period = rows["poincare"], rows["n_points"], rows["orbit_period"]
    complete = rows["outcome"] == Outcome.COMPLETE
    window = points.shape[1]
    expected = np.where(period > 0, period, window)
    stored = np.arange(window)[None, :] < np.clip(n_points, 0, window)[:, None]
    finite, missing = np.isfinite(points).all(axis=2), np.isnan(points).all(axis=2)
    on_path = rows["classification_cycles"] == 0 if "classification_cycles" in rows else complete
    closes = orbit_period if settings.classify_cycles is None else closed_period
    judged_so = complete & (period == 0) & (n_points == window) & ("motion" not in rows)
    last = points[np.arange(len(points)), np.clip(n_points, 1, window) - 1]
    hidden = np.zeros(complete.size, bool)
    for row in np.flatnonzero(judged_so):
        hidden[row] = (
            closes(
                points[row] / units[row],
                settings.max_orbit_period,
                settings.period_tolerance,
            )
            > 0
        )
    return {
        "n_points is the orbit_period, or all that are stored without one": complete
        & (n_points != expected),
        "poincare is finite in n_points points and NaN after": complete
        & (np.where(stored, finite, missing) == 0).any(axis=1),
        "final_state is the last point of poincare": complete
        & on_path
        & (last != rows["final_state"]).any(axis=1),
        "orbit_period is 0 only where the points do not repeat": hidden,
    }


def _of_contact(structure, rows: dict) -> dict[str, np.ndarray]:
    contact = rows["contact"]
    known = np.uint64(sum(1 << (k - 1) for k in structure.contact_numbers))
    return {
        "contact has bits of existing contacts only": (contact & ~known) != 0,
        "contact of a linear run is empty": (rows["skip_rule"] == SkipRule.LINEAR) & (contact != 0),
    }
