"""Names of the variables of a refined map, and its last look."""

from enum import IntEnum

import numpy as np

from hpcsweep.studies.refine.audit import Look

SOURCE, CELL, CROSSED = "source", "cell", "crossed"
AUDIT, INFERRED = "audit", "inferred"
"""Variable of the looks, and of the checksums."""


class Crossed(IntEnum):
    """Whether a known curve crosses a box of the grid."""

    FREE = 0
    CROSSED = 1


def inferred_name(variable: str) -> str:
    """Return the name of the variable with the inferred values of another."""
    return f"inferred_{variable}"


def last_look(audit: np.ndarray) -> Look | None:
    """Return the last look of the variable; None if there is none yet."""
    looks = audit[np.isfinite(audit[:, 0])]
    if not len(looks):
        return None
    return Look(*(int(v) for v in looks[-1][:4]), *map(float, looks[-1][4:]))
