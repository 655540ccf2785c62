"""Invariants of the results of a study of basins."""

import numpy as np

from hpcsweep.dynamics.attractor import ELSEWHERE, FAILED, UNDECIDED
from hpcsweep.studies.attractors.invariants import of_motions
from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.invariants import Broken


def broken_relations(rows: Rows) -> Broken:
    """Check k rows of starts against the relations of `hpcsweep.studies.basins.basins`."""
    return _of_labels(rows) | _of_attractors(rows)


def _of_labels(rows: Rows) -> Broken:
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


def _of_attractors(rows: Rows) -> Broken:
    ids = rows["attractor_id"]
    held = ids > 0
    number = np.arange(1, ids.shape[1] + 1)
    return {
        "attractors are numbered from 1": (held & (ids != number)).any(axis=1),
        "attractors come first": (held[:, 1:] & ~held[:, :-1]).any(axis=1),
        **of_motions(rows, held),
    }
