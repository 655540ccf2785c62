"""Estimate the error that a reduced model makes under the records of its job.

The estimate of `hpcsweep.model.reduction` is that of one collision. Records excite more modes, and
contacts close again and again. So some records of the job are run, at its largest scale, with the
modes that are kept and with three times as many and more. Errors are the largest difference of the
displacement of a contact or an output, at any sample, over its largest, and of the largest force of
each contact; both `SAFETY` times, since more modes are not all.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hpcsweep.job.job import JobError
from hpcsweep.job.values import Values
from hpcsweep.job.vary import parts_of
from hpcsweep.studies.ground_motion.records import Records

SAFETY = 2.0
MAX_RUN = 5
"""Records that are run."""
MAX_INSTANTS = 20_000
"""Samples of a record up to which it is run."""
STEP = 1.5
"""Times as many modes, where there are too few."""


def with_record_error(
    values: Values,
    tree: dict,
    reduced: Callable[..., dict],
    read: Callable[[str, Mapping], Any],
) -> dict:
    """Return a job whose model states its errors under records; unchanged without records.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
        Its model is reduced, and its records are known.
    reduced : callable
        Of `hpcsweep.job.models.with_model`.
    read : callable
        Return the study of a job: (source, tree).

    Raises
    ------
    JobError
        If no number of modes has the error that the job asks for.
    """
    job = parts_of(values, tree, read).tree_as_given()
    study = read(values.source, job)
    if not isinstance(study, Records):
        return tree
    wanted = tree["structure"]["model"]["reduce"]
    limit = wanted.get("error", math.inf)
    model = tree["structure"]["model"]["found"]
    while True:
        k = model["facts"]["modes"]
        kept, more = (
            read(values.source, _with(job, reduction))
            for reduction in (model, reduced({"modes": k}, True))
        )
        error, force_error = _errors(kept, more)
        facts = {**model["facts"], "error": error, "force_error": force_error}
        if error <= limit:
            return _with(tree, {**model, "facts": facts})
        try:
            model = reduced({"modes": math.ceil(STEP * k)})
        except JobError:
            limit = f"at least {error:.2g} under its records, that of {k} modes"
            said = f"structure.model.reduce.error must be {limit}, is {wanted['error']:g}"
            raise JobError(f"{values.source}: {said}") from None


def _with(tree: Mapping, reduction: Mapping) -> dict:
    """Return a job with a reduction of its model; further modes are damped as the last given."""
    model = {**tree["structure"]["model"], "found": reduction}
    ratios = model.get("damping_ratio")
    if isinstance(ratios, list):
        model["damping_ratio"] = ratios + ratios[-1:] * (reduction["facts"]["modes"] - len(ratios))
    return {**tree, "structure": {**tree["structure"], "model": model}}


def _errors(kept: Records, more: Records) -> tuple[float, float]:
    """Return the errors of displacements and of contact forces under some records."""
    errors = np.zeros(2)
    for i in np.unique(np.linspace(0, kept.n_frames - 1, MAX_RUN).astype(int)):
        try:
            moved, pushed = _motion(kept, int(i))
            exact, force = _motion(more, int(i))
        except ArithmeticError:  # the run itself will tell
            continue
        n = min(len(moved), len(exact))
        for at, (estimate, true) in enumerate(((moved[:n], exact[:n]), (pushed, force))):
            most = np.abs(true).max(axis=0)
            off = np.abs(estimate - true).max(axis=0)
            errors[at] = max(errors[at], (off[most > 0] / most[most > 0]).max(initial=0.0))
            if np.any(off[most == 0] > 0):
                errors[at] = max(errors[at], 1.0)
    error, force_error = (SAFETY * errors).tolist()
    return error, force_error


def _motion(study: Records, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements of rows, (p, rows), and largest forces, (1, contacts), of a record."""
    from hpcsweep.solvers.history import history

    structure, record = study.structure, study.record(i)
    last = record.dt * min(record.n_samples - 1, MAX_INSTANTS)
    seen = history(structure, record, float(study.factor[i, -1]), end=last)
    rows = np.hstack((seen.approach, seen.displacement @ structure.drift_rows.T))
    return rows, seen.peak_force.max(axis=0, keepdims=True)
