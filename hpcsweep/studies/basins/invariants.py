"""Invariants of the results of a study of basins."""

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.solvers.outcome import Outcome
from hpcsweep.studies.attractors.invariants import of_motions
from hpcsweep.studies.attractors.variables import SLOTS
from hpcsweep.studies.basins.basins import Basins
from hpcsweep.studies.basins.refined import RefinedBasins
from hpcsweep.studies.invariants import Rows, listed, of_each


def broken_invariants(study: Basins, rows: Rows) -> list[tuple[int, str]]:
    """Check k rows of starts against the invariants of `hpcsweep.studies.basins.basins`.

    Parameters
    ----------
    study : Basins
    rows : dict of str to ndarray
        The file's variables, first axis the k rows.

    Returns
    -------
    list of (int, str)
        Row and message.
    """
    each = of_each(study.variables, rows, study.structure, SLOTS)
    return listed({**each, **_of_labels(rows), **_of_attractors(rows)})


def broken_invariants_of_starts(study: RefinedBasins, rows: Rows) -> list[tuple[int, str]]:
    """Check k starts against the invariants of `hpcsweep.studies.basins.refined`.

    Parameters and result as of `broken_invariants`.
    """
    label, outcome = rows["label"], rows["outcome"]
    listed_or_not = (UNDECIDED, FAILED, ELSEWHERE, *range(1, study.max_attractors + 1))
    return listed(
        {
            "label is of an attractor of the list, -1, -2 or -3": ~np.isin(label, listed_or_not),
            "a start that failed, and no other, is labelled so": (label == FAILED)
            != (outcome != Outcome.COMPLETE),
            **of_each(study.variables, rows, study.structure, {}),
        }
    )


def _of_labels(rows: Rows) -> dict[str, np.ndarray]:
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


def _of_attractors(rows: Rows) -> dict[str, np.ndarray]:
    ids = rows["attractor_id"]
    held = ids > 0
    number = np.arange(1, ids.shape[1] + 1)
    return {
        "attractors are numbered from 1": (held & (ids != number)).any(axis=1),
        "attractors come first": (held[:, 1:] & ~held[:, :-1]).any(axis=1),
        **of_motions(rows, held),
    }
