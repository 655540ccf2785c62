"""Reduce the finite element model of a job once: from then on the job holds the result.

``structure.model.found`` then has matrices, rows and names (`hpcsweep.model.reduced`), with the
hash of the files and of all keys that they depend on. That hash is what the model means; the
matrices are rounded as the machine rounds. A results file is read without the files of the model.

The error of `hpcsweep.model.reduction` is that of one collision. Records excite more modes, and
contacts close again and again. So some records of the job are run, at its largest scale, with the
modes that are kept and with three times as many and more. Errors are the largest difference of the
displacement of a contact or an output, at any sample, over its largest, and of the largest force of
each contact; both `SAFETY` times, since more modes are not all.
"""

import hashlib
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.job.job import JobError
from hpcsweep.job.structures import MODEL, element_tables, model_settings
from hpcsweep.job.values import Values
from hpcsweep.job.vary import Read, parts_of, varied_values
from hpcsweep.model.arguments import InputError
from hpcsweep.studies.ground_motion.records import Records

ARGUMENTS = ("influence", "outputs", "reduce", "fixed")
"""Of a reduction, keys of the table."""
SHAPES_MODES = re.compile(r"\.direction(\[\d+\])?$|slider\[\d+\]\.stiffness$")
"""Keys beside a model that its reduction depends on."""
SAFETY = 2.0
MAX_RUN = 5
"""Records that are run."""
MAX_INSTANTS = 20_000
"""Samples of a record up to which it is run."""
STEP = 1.5
"""Times as many modes, where there are too few."""


def with_model(
    values: Values, tree: dict, folder: Path | None
) -> tuple[dict, Callable[..., dict] | None]:
    """Return a job with its model reduced, unchanged where it has been reduced.

    Where it is not, and modes are left out, also a function that reduces it otherwise: it takes
    ``reduce``, and whether there shall be the modes that errors are estimated from, and returns
    what is found.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
    folder : Path, optional
        To which paths are relative: the files are read again, and must be those that the job was
        made with. Without it what was found is believed where it is there.

    Raises
    ------
    JobError
        If a file cannot be read or reduced; one line names file, key and limit.
    """
    structure = values.table("structure")
    table = structure["model"]
    if isinstance(table, Mapping) and folder is None and "found" in table:
        return tree, None
    values.check_table("structure.model", table, (*MODEL, "found"), ("file",))
    contacts, sliders, _ = element_tables(values, structure)
    varied = varied_values(values, tree)
    for key in filter(SHAPES_MODES.search, varied):
        limit = "is not offered: a model is reduced once, for its contacts and sliders"
        raise values.error(f"vary.{key}", [*varied[key]], limit)
    contacts = _stiffest(contacts, varied)
    for key in ("names", "outputs", "fixed"):
        if not isinstance(table.get(key, []), list):
            raise values.error(f"structure.model.{key}", table[key], "must be a list")
    names: Any = table["file"]
    place = "structure.model.file"
    paths = [(folder or Path()) / file for file in values.names(place, names, "names of files")]
    from hpcsweep.job.model_files import load_model

    try:
        model = load_model(paths, table.get("names"))
        files = [
            file for path in paths for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        ]
        content = [hashlib.sha256(f.read_bytes()).hexdigest() for f in files if f.is_file()]
    except (OSError, ValueError) as error:
        raise values.unread(place, error) from None
    settings = model_settings(structure)
    origin = hashlib.sha256(repr((content, settings)).encode()).hexdigest()
    before = table.get("found")
    if before is not None:
        if not isinstance(before, Mapping) or before.get("origin") != origin:
            limit = ": the model's files have changed since this job was written"
            limit += "; delete structure.model.found to reduce them again"
            raise JobError(limit, "structure.model.found", values.source)
        return tree, None
    influence, outputs, reduce, fixed = (table.get(key) for key in ARGUMENTS)

    def reduced(wanted: Any, more: bool = False) -> dict:
        arguments = influence, outputs or (), wanted, fixed or (), more
        try:
            made = model.reduced(contacts, sliders, *arguments)
        except InputError as error:
            of_model = error.table not in ("contact", "slider")
            error.within("structure.model" if of_model else "structure")
            raise JobError(error.limit, error.key, values.source) from None
        reduced_model = {key: value for key, value in made._asdict().items() if value is not None}
        return {"origin": origin, "settings": settings, **reduced_model}

    reduction = reduced(reduce)
    places = [str(path.absolute()) for path in paths]
    table = {**table, "file": places if isinstance(names, list) else places[0], "found": reduction}
    return {**tree, "structure": {**structure, "model": table}}, reduced if reduce else None


def _stiffest(contacts: list[dict], varied: Mapping[str, tuple[Any, ...]]) -> list[dict]:
    """Return the tables of contacts, each with its largest stiffness of all parts.

    A wrong value is left to the part that has it.
    """
    made = []
    for k, contact in enumerate(contacts):
        stiffnesses = varied.get(f"structure.contact[{k}].stiffness", ())
        valid = [value for value in stiffnesses if isinstance(value, int | float) and value > 0]
        made.append({**contact, "stiffness": max(valid)} if valid else contact)
    return made


def with_record_error(values: Values, tree: dict, reduced: Callable[..., dict], read: Read) -> dict:
    """Return a job whose model states its errors under records; unchanged without records.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
        Its model is reduced, and its records are known.
    reduced : callable
        Of `with_model`.
    read : callable
        Return the study of a job: (source, tree).

    Raises
    ------
    JobError
        If no number of modes has the error that the job asks for.
    """
    job = parts_of(values, tree, read).tree_as_given()
    if not isinstance(read(values.source, job), Records):
        return tree
    wanted = tree["structure"]["model"]["reduce"]
    limit = wanted.get("error", math.inf)
    model = tree["structure"]["model"]["found"]
    while True:
        k = model["facts"]["modes"]
        finer = reduced({"modes": k}, True)
        kept, more = (read(values.source, _with(job, each)) for each in (model, finer))
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
        n = np.count_nonzero(reduction["facts"]["frequencies"])
        model["damping_ratio"] = ratios + ratios[-1:] * (n - len(ratios))
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
            still = float(np.any(off[most == 0] > 0))
            errors[at] = max(errors[at], (off[most > 0] / most[most > 0]).max(initial=still))
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
