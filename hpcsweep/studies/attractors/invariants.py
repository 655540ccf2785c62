"""Invariants of the results of studies of attractors and of basins."""

import numpy as np

from hpcsweep.dynamics.attractors import RECORD
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.dynamics.shares import share_interval
from hpcsweep.studies.attractors.search import KINDS, UNSTORED, SearchLimits
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.invariants import Broken, misnumbered, of_points

ROUNDING = 1e-12


def broken_relations(limits: SearchLimits, rows: Rows) -> Broken:
    """Check k points against the relations of `hpcsweep.studies.attractors.attractors`."""
    held, period = rows["attractor_id"] > 0, rows["orbit_period"]
    room = rows["poincare"].shape[-2]
    return {
        **_of_counts(limits, rows, held),
        **_of_shares(limits, rows, held),
        **_of_motions(rows, held),
        **of_points(rows, held, np.minimum(np.where(period > 0, period, RECORD), room), "point"),
    }


def _of_counts(limits: SearchLimits, rows: Rows, held: np.ndarray) -> Broken:
    ids, number = rows["attractor_id"], rows["n_attractors"]
    hits = np.where(held, rows["hits"], 0).sum(axis=1)
    starts = hits + rows["n_undecided"] + rows["n_failed"] + rows["n_elsewhere"]
    twice: np.ndarray = np.array([np.unique(row[row > 0]).size < (row > 0).sum() for row in ids])
    return {
        "each start is counted once": starts != limits.starts,
        "attractors are stored as far as there is room": held.sum(axis=1)
        != np.minimum(number, limits.max_attractors),
        "stored attractors come first": _with_gaps(held),
        "identities are given once": twice,
        "identities are at most last_id": (ids > rows["last_id"][:, None]).any(axis=1),
    }


def _of_shares(limits: SearchLimits, rows: Rows, held: np.ndarray) -> Broken:
    hits, wrong = rows["hits"], np.zeros(len(held), bool)
    for row, slot in np.argwhere(held).tolist():
        count = int(hits[row, slot])
        if not 0 <= count <= limits.starts:
            wrong[row] = True
            continue
        low, high = share_interval(count, limits.starts, limits.confidence)
        stored = [rows[name][row, slot] for name in ("share", "share_low", "share_high")]
        expected = [count / limits.starts, low, high]
        wrong[row] |= not np.allclose(stored, expected, rtol=0, atol=ROUNDING)
    falls = np.where(held, hits, -1)
    return {
        "share and its interval are those of the hits": wrong,
        "shares fall": np.any(np.diff(falls, axis=1) > 0, axis=1),
    }


def _of_motions(rows: Rows, held: np.ndarray) -> Broken:
    """Check kind, period and multiplier of attractors."""
    kind, period, multiplier = rows["motion"], rows["orbit_period"], rows["multiplier"]
    orbit = held & (kind == MotionClass.PERIODIC)
    with np.errstate(invalid="ignore"):
        return {
            "motion is 2, 4 or 5": (held & ~np.isin(kind, KINDS)).any(axis=1),
            "orbits, and nothing else, have a period": (held & (orbit != (period > 0))).any(axis=1),
            "orbits attract": (orbit & ~(multiplier < 1)).any(axis=1),
        }


def _with_gaps(held: np.ndarray) -> np.ndarray:
    """Return where an attractor comes after none."""
    return (held[:, 1:] & ~held[:, :-1]).any(axis=1)


def broken_rows(rows: Rows) -> Broken:
    """Check k rows of starts against the relations of `hpcsweep.studies.basins.basins`."""
    return _of_labels(rows) | _of_listed(rows)


def _of_labels(rows: Rows) -> Broken:
    labels, ids = rows["label"], rows["attractor_id"]
    counts = {
        f"n_{name} is that of the labels": (labels == value).sum(axis=1) != rows[f"n_{name}"]
        for name, value in UNSTORED.items()
    }
    hits = (labels[:, None, :] == np.where(ids > 0, ids, 127)[:, :, None]).sum(axis=2)
    others = [*UNSTORED.values()]
    listed = np.array(
        [np.isin(row, (*low[low > 0], *others)).all() for row, low in zip(labels, ids, strict=True)]
    )
    return {
        "each start is labelled by an attractor of the list, -1, -2 or -3": ~listed,
        "hits are those of the labels": (np.where(ids > 0, rows["hits"], 0) != hits).any(axis=1),
        **counts,
    }


def _of_listed(rows: Rows) -> Broken:
    ids = rows["attractor_id"]
    held = ids > 0
    return {
        "attractors are numbered from 1": misnumbered(ids),
        "attractors come first": _with_gaps(held),
        **_of_motions(rows, held),
    }
