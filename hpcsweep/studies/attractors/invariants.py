"""Invariants of the results of a study of attractors."""

import numpy as np

from hpcsweep.dynamics.attractors import RECORD
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.studies.attractors.attractors import Attractors
from hpcsweep.studies.attractors.variables import SLOTS
from hpcsweep.studies.invariants import Rows, listed, of_each

KINDS = (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)
ROUNDING = 1e-12


def broken_invariants(study: Attractors, rows: Rows) -> list[tuple[int, str]]:
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
        **of_each(study.variables, rows, study.structure, SLOTS),
        **_of_counts(study, rows, held),
        **_of_shares(study, rows, held),
        **of_motions(rows, held),
        **_of_points(rows, held),
    }
    return listed(broken)


def _of_counts(study: Attractors, rows: Rows, held: np.ndarray) -> dict[str, np.ndarray]:
    ids, number = rows["attractor_id"], rows["n_attractors"]
    hits = np.where(held, rows["hits"], 0).sum(axis=1)
    starts = hits + rows["n_undecided"] + rows["n_failed"] + rows["n_elsewhere"]
    twice: np.ndarray = np.array([np.unique(row[row > 0]).size < (row > 0).sum() for row in ids])
    return {
        "each start is counted once": starts != study.starts,
        "attractors are stored as far as there is room": held.sum(axis=1)
        != np.minimum(number, study.max_attractors),
        "stored attractors come first": (held[:, 1:] & ~held[:, :-1]).any(axis=1),
        "identities are given once": twice,
        "identities are at most last_id": (ids > rows["last_id"][:, None]).any(axis=1),
    }


def _of_shares(study: Attractors, rows: Rows, held: np.ndarray) -> dict[str, np.ndarray]:
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


def of_motions(rows: Rows, held: np.ndarray) -> dict[str, np.ndarray]:
    """Check kind, period and multiplier of attractors."""
    kind, period, multiplier = rows["motion_class"], rows["orbit_period"], rows["multiplier"]
    orbit: np.ndarray = held & (kind == MotionClass.PERIODIC)
    unlike: np.ndarray = orbit ^ (held & (period > 0))
    with np.errstate(invalid="ignore"):
        attracts = multiplier < 1
    return {
        "motion_class is 2, 4 or 5": (held & ~np.isin(kind, KINDS)).any(axis=1),
        "orbits, and nothing else, have a period": unlike.any(axis=1),
        "orbits attract": (orbit & ~attracts).any(axis=1),
    }


def _of_points(rows: Rows, held: np.ndarray) -> dict[str, np.ndarray]:
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
