"""Variables of a refined map: the source of each point's value, inferred values, the audit."""

from dataclasses import replace

import numpy as np

from hpcsweep.studies.blocks import Rows
from hpcsweep.studies.refine.audit import MAX_LOOKS, Look
from hpcsweep.studies.refine.rounds import RefinementRounds
from hpcsweep.studies.refinement import Refinement, Source
from hpcsweep.studies.study import Study
from hpcsweep.studies.variable import Coordinate, Variable, code
from hpcsweep.studies.variables import numbered

SOURCE, CELL, CROSSED = "source", "cell", "crossed"
AUDIT, INFERRED = "audit", "inferred"
"""Variable of the looks, and of the checksums."""
QUANTITIES = Look._fields


def map_shape(study: Study) -> tuple[int, ...]:
    """Return the number of points of every axis of a map: varied keys, frames, runs of a frame."""
    return tuple(study.dimensions[dim] for dim in study.run_dims if dim != "direction")


def inferred_name(variable: str) -> str:
    """Return the name of the variable with the inferred values of another."""
    return f"inferred_{variable}"


def derived_variables(study: Study, refinement: Refinement) -> list[Variable]:
    """Return the variables of a refined map besides its runs, checksums last."""
    runs = study.run_dims
    told = "1 computed, 2 inferred from its cell, 3 computed for the audit, 0 not known yet"
    level = "level of the cell from which it is inferred, negative if its points differ, "
    crossed = "1 where a known curve crosses the box of the grid that begins at the point"
    own = [
        code(SOURCE, runs, Source, told),
        Variable(CELL, runs, "<i1", "1", level + "0 of computed points"),
    ]
    if refinement.curves:
        own.append(Variable(CROSSED, runs, "<i1", "1", crossed))
    known = {variable.name: variable for variable in study.variables}
    labels = [
        replace(
            known[name],
            name=inferred_name(name),
            dims=runs,
            long_name=f"{name} of inferred points, 0 of others",
        )
        for name in refinement.variables
    ]
    return [
        *own,
        *labels,
        *getattr(study, "listed_variables", []),
        Variable(AUDIT, ("look", "quantity"), "<f8", "1", "looks of the audit, the last counts"),
        Variable(INFERRED, runs[:-1], "<u8", "1", "checksum of what is inferred of a frame"),
    ]


def derived_coordinates() -> dict[str, Coordinate]:
    """Return the dimensions of refined maps alone."""
    return {
        "look": numbered(MAX_LOOKS, "look of the audit", first=1),
        "quantity": Coordinate(np.array(QUANTITIES, object), "1", "what a look tells"),
    }


def derived_values(study: Study, rounds: RefinementRounds) -> Rows:
    """Return the variables of a complete map, without the checksums.

    Returns
    -------
    dict of str to ndarray
        Of shape (n_points,), the audit as in the file; what the study lists for each frame, the
        same for all of them, of shape (n_frames, ...).
    """
    level, code = rounds.inferred()
    names, labels = rounds.refinement.variables, rounds.labels
    values = {SOURCE: np.where(level != 0, np.int8(Source.INFERRED), rounds.source), CELL: level}
    codes = np.zeros((len(labels.codes) + 1, 1 + len(names)), np.uint64)
    codes[1:] = labels.codes
    for column, name in enumerate(names, 1):
        values[inferred_name(name)] = codes[code, column]
    if rounds.crossed is not None:
        values[CROSSED] = np.pad(rounds.crossed, [(0, 1)] * rounds.crossed.ndim).ravel()
    audit = np.full((MAX_LOOKS, len(QUANTITIES)), np.nan)
    audit[: len(rounds.looks)] = rounds.looks
    listed: Rows = getattr(study, "listed_values", dict)()
    values |= {n: np.broadcast_to(v, (study.n_frames, *v.shape)) for n, v in listed.items()}
    return {**values, AUDIT: audit}


def last_look(audit: np.ndarray) -> Look | None:
    """Return the last look of the variable; None if there is none yet."""
    looks = audit[np.isfinite(audit[:, 0])]
    if not len(looks):
        return None
    return Look(*(int(v) for v in looks[-1][:4]), *map(float, looks[-1][4:]))
