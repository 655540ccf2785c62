"""Invariants of the results of a study of attractors."""

import math
from typing import Any

import numpy as np

from hpcsweep.dynamics.attractors import RECORD
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.studies.invariants import listed, of_outcome

KINDS = (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
ROUNDING = 1e-12


def broken_invariants(study, rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
    """Check k points against the invariants of `hpcsweep.studies.attractors.attractors`.

    Parameters
    ----------
    study : Attractors
    rows : dict of str to ndarray
        The file's variables, first axis the k points.

    Returns
    -------
    list of (int, str)
        Row and message.
    """
    held = rows["attractor_id"] > 0
    broken = {
        **_of_counts(study, rows, held),
        **_of_shares(study, rows, held),
        **_of_motions(study, rows, held),
        **_of_points(rows, held),
    }
    return listed(broken)


def _of_counts(study, rows: dict, held: np.ndarray) -> dict[str, np.ndarray]:
    ids, number = rows["attractor_id"], rows["n_attractors"]
    hits = np.where(held, rows["hits"], 0).sum(axis=1)
    starts = hits + rows["n_undecided"] + rows["n_failed"] + rows["n_elsewhere"]
    twice: np.ndarray = np.array([np.unique(row[row > 0]).size < (row > 0).sum() for row in ids])
    return {
        **of_outcome(rows["outcome"]),
        "each start is counted once": starts != study.starts,
        "attractors are stored as far as there is room": held.sum(axis=1)
        != np.minimum(number, study.max_attractors),
        "stored attractors come first": (held[:, 1:] & ~held[:, :-1]).any(axis=1),
        "identities are given once": twice,
        "identities are at most last_id": (ids > rows["last_id"][:, None]).any(axis=1),
        "cycles is at least 0": rows["cycles"] < 0,
    }


def _of_shares(study, rows: dict, held: np.ndarray) -> dict[str, Any]:
    hits, wrong = rows["hits"], np.zeros(len(held), bool)
    for row, slot in np.argwhere(held).tolist():
        count = int(hits[row, slot])
        if not 0 <= count <= study.starts:
            wrong[row] = True
            continue
        low, high = share_interval(count, study.starts, study.confidence)
        stored = [rows[name][row, slot] for name in ("share", "share_low", "share_high")]
        expected = [count / study.starts, low, high]
        wrong[row] |= not np.allclose(stored, expected, rtol=0, atol=ROUNDING)
    falls = np.where(held, hits, -1)
    return {
        "share and its interval are those of the hits": wrong,
        "shares fall": (np.diff(falls, axis=1) > 0).any(axis=1),
    }


def _of_motions(study, rows: dict, held: np.ndarray) -> dict[str, Any]:
    broken = of_motions(study, rows, held)
    with np.errstate(invalid="ignore"):
        broken["lyapunov is not +inf"] = (held & (rows["lyapunov"] == math.inf)).any(axis=1)
        if "drift" in rows:
            drift = rows["drift"]
            broken["drift is finite and not negative"] = (
                held & ~(np.isnan(drift) | (np.isfinite(drift) & (drift >= 0)))
            ).any(axis=1)
    return broken


def of_motions(study, rows: dict, held: np.ndarray) -> dict[str, Any]:
    """Check empty slots, kind, period, multiplier and contact set of attractors."""
    kind, period, multiplier = rows["motion_class"], rows["orbit_period"], rows["multiplier"]
    orbit = held & (kind == MotionClass.PERIODIC)
    with np.errstate(invalid="ignore"):
        broken: dict[str, Any] = {
            "motion_class is 2, 4 or 5": (held & ~np.isin(kind, KINDS)).any(axis=1),
            "orbits, and nothing else, have a period": (held & (orbit != (period > 0))).any(axis=1),
            "orbits attract": (orbit & ~(multiplier < 1)).any(axis=1),
        }
    if "contact" in rows:
        known = np.uint64(sum(1 << (k - 1) for k in study.structure.contact_numbers))
        broken["contact has bits of existing contacts only"] = (
            held & ((rows["contact"] & ~known) != 0)
        ).any(axis=1)
    return broken


def _of_points(rows: dict, held: np.ndarray) -> dict[str, Any]:
    points, count, period = rows["poincare"], rows["n_points"], rows["orbit_period"]
    room = points.shape[2]
    stored = np.arange(room) < np.where(held, count, 0)[..., None]
    finite, missing = np.isfinite(points).all(axis=3), np.isnan(points).all(axis=3)
    expected = np.minimum(np.where(period > 0, period, RECORD), room)
    last = np.take_along_axis(points, np.clip(count, 1, room)[..., None, None] - 1, axis=2)[:, :, 0]
    return {
        "n_points is the orbit_period, or all that are stored": (held & (count != expected)).any(
            axis=1
        ),
        "poincare is finite in n_points points and NaN after": (
            np.where(stored, finite, missing) == 0
        ).any(axis=(1, 2)),
        "point is the last one of poincare": (held & (last != rows["point"]).any(axis=2)).any(
            axis=1
        ),
    }
