"""Invariants of the results of a study of basins."""

from typing import Any

import numpy as np

from hpcsweep.dynamics.attractor import FAILED, UNDECIDED
from hpcsweep.dynamics.basins import ELSEWHERE
from hpcsweep.dynamics.classify import MotionClass
from hpcsweep.solvers.outcome import Outcome

KINDS = (MotionClass.PERIODIC, MotionClass.QUASI_PERIODIC, MotionClass.CHAOTIC)


def broken_invariants(study, rows: dict[str, np.ndarray]) -> list[tuple[int, str]]:
    """Check k rows of starts against what `hpcsweep.studies.basins` says of its results.

    Parameters
    ----------
    study : Basins
    rows : dict of str to ndarray
        The file's variables, first axis the k rows.

    Returns
    -------
    list of (int, str)
        Row and what is wrong there.
    """
    broken = {**_of_labels(study, rows), **_of_attractors(study, rows)}
    return sorted(
        (int(row), f"not so: {invariant}")
        for invariant, where in broken.items()
        for row in np.flatnonzero(where)
    )


def _of_labels(study, rows: dict) -> dict[str, Any]:
    labels, ids = rows["label"], rows["attractor_id"]
    counts = {
        name: (labels == value).sum(axis=1) != rows[name]
        for name, value in (
            ("n_undecided", UNDECIDED),
            ("n_failed", FAILED),
            ("n_elsewhere", ELSEWHERE),
        )
    }
    hits = (labels[:, None, :] == np.where(ids > 0, ids, 127)[:, :, None]).sum(axis=2)
    others = UNDECIDED, FAILED, ELSEWHERE
    known = np.array(
        [np.isin(own, (*low[low > 0], *others)).all() for own, low in zip(labels, ids, strict=True)]
    )
    return {
        "each start is labelled by an attractor of the list, -1, -2 or -3": ~known,
        "hits are those of the labels": (np.where(ids > 0, rows["hits"], 0) != hits).any(axis=1),
        **{f"{name} is that of the labels": where for name, where in counts.items()},
    }


def _of_attractors(study, rows: dict) -> dict[str, Any]:
    ids, kind, period = rows["attractor_id"], rows["motion_class"], rows["orbit_period"]
    held = ids > 0
    orbit = held & (kind == MotionClass.PERIODIC)
    number = np.arange(1, ids.shape[1] + 1)
    outcomes = [Outcome.COMPLETE, Outcome.NON_FINITE, Outcome.STEP_LIMIT, Outcome.SOLVER_FAILED]
    with np.errstate(invalid="ignore"):
        broken: dict[str, Any] = {
            "attractors are numbered from 1": (held & (ids != number)).any(axis=1),
            "attractors come first": (held[:, 1:] & ~held[:, :-1]).any(axis=1),
            "motion_class is 2, 4 or 5": (held & ~np.isin(kind, KINDS)).any(axis=1),
            "orbits, and nothing else, have a period": (held & (orbit != (period > 0))).any(axis=1),
            "orbits attract": (orbit & ~(rows["multiplier"] < 1)).any(axis=1),
            "point is finite": (held & ~np.isfinite(rows["point"]).all(axis=2)).any(axis=1),
            "outcome is one of 1 to 4": ~np.isin(rows["outcome"], outcomes),
            "cycles is at least 0": rows["cycles"] < 0,
        }
    if "contact" in rows:
        bits = np.uint64(sum(1 << (k - 1) for k in study.structure.contact_numbers))
        broken["contact has bits of existing contacts only"] = (
            held & ((rows["contact"] & ~bits) != 0)
        ).any(axis=1)
    return broken
