"""Check that the inferred points of a refined map follow from its computed points."""

import numpy as np

from hpcsweep.store.commit import Blocks
from hpcsweep.store.inferred import Inferred
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.refine.cells import Labels
from hpcsweep.studies.refine.refinement import refinement_of
from hpcsweep.studies.refine.variables import AUDIT, CROSSED, INFERRED, replay


def inferred_problems(blocks: Blocks) -> list[tuple[Place, str]]:
    """Walk the rounds of a map again, from its committed points, and compare what is inferred.

    Parameters
    ----------
    blocks : Blocks
        Of a refined map.

    Returns
    -------
    list of (tuple of int, str)
        Place of a frame and what is wrong there. Nothing of a map that is not complete yet.
    """
    inferred, labels = Inferred(blocks), Labels(blocks.study.n_runs)
    stored = np.array([blocks.read_rows(INFERRED, place, 1)[0] for place in inferred.places])
    if not stored.any():
        return []
    unknown = inferred.unknown()
    if unknown:
        return [(place, "what is inferred: its checksum does not hold") for place in unknown]
    for place in inferred.places:
        labels.store(*inferred.labels(place))
    stored_boxes = None
    refinement = refinement_of(blocks.study)
    assert refinement is not None
    if refinement.curves:
        frames = [inferred.frame(place) or {} for place in inferred.places]
        stored_boxes = np.array([rows[CROSSED] for rows in frames])
    values = replay(blocks.study, refinement, labels, stored_boxes)
    if values is None:
        return [(inferred.places[0], "points that the map was refined by are not committed")]
    audit = inferred.audit()
    if not np.array_equal(values[AUDIT], audit, equal_nan=True):
        return [(inferred.places[0], "the audit is not that of the computed points")]
    problems = []
    for k, place in enumerate(inferred.places):
        rows = inferred.frame(place, audit) or {}
        for name, row in rows.items():
            own = values[name].reshape(-1, *row.shape)[k]
            if own.astype(row.dtype).tobytes() != row.tobytes():
                problems.append((place, f"{name} does not follow from the computed points"))
    return problems
