"""Reduce the finite element model of a job once: from then on the job holds the result.

``structure.model.found`` then has matrices, rows and names (`hpcsweep.model.reduced`), with the
hash of the files and of all keys that they depend on. That hash is what the model means; the
matrices are rounded as the machine rounds. A results file is read without the files of the model.
"""

import hashlib
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hpcsweep.job.job import JobError
from hpcsweep.job.structures import MODEL, element_tables, model_settings
from hpcsweep.job.values import Values
from hpcsweep.job.vary import varied_values
from hpcsweep.model.arguments import InputError

LISTS = ("names", "outputs", "fixed")
ARGUMENTS = ("influence", "outputs", "reduce", "fixed")
"""Of a reduction, keys of the table."""
SHAPES_MODES = re.compile(r"\.direction(\[\d+\])?$|slider\[\d+\]\.stiffness$")
"""Keys beside a model that its reduction depends on."""


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
    table_as_given = table
    if isinstance(table, Mapping):
        table_as_given = {key: value for key, value in table.items() if key != "found"}
    values.check_table("structure.model", table_as_given, MODEL, ("file",))
    contacts, sliders = element_tables(values, structure)
    varied = varied_values(values, tree)
    for key in filter(SHAPES_MODES.search, varied):
        limit = "is not offered: a model is reduced once, for its contacts and sliders"
        raise values.error(f"vary.{key}", [*varied[key]], limit)
    contacts = _stiffest(contacts, varied)
    for key in LISTS:
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
        said = str(error)
        if isinstance(error, OSError) and error.filename:
            said = f"{error.filename}: {error.strerror}"
        raise JobError(f"{values.source}: {place}: {said}") from None
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
