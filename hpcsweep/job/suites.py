"""Establish the facts about a job's records once: a loaded job holds them from then on.

The files that ``records.files`` names are searched for and read, the suite of ``records.synthetic``
is made; of each record ``records.found`` then has a name, a checksum and the intensity measures.
A results file is read with the facts in its job, without the records.
"""

import glob
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from hpcsweep.earthquakes.suite import Facts, Files, facts_of
from hpcsweep.job.job import JobError
from hpcsweep.job.values import Values
from hpcsweep.studies.ground_motion import keys
from hpcsweep.studies.ground_motion.records import Records


def with_found(values: Values, tree: dict, folder: Path | None) -> dict:
    """Return a job with what its records are, the same where that is there or it has none.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
    folder : Path, optional
        To which paths are relative: records are looked for again, and must be those that the job
        was made with. Without it they are believed where they are there.

    Raises
    ------
    JobError
        If a record cannot be read; one line names file and limit.
    """
    study, table = tree.get("study"), tree.get("records")
    is_ours = isinstance(study, Mapping) and study.get("kind") == Records.kind
    if not is_ours or not isinstance(table, dict) or (folder is None and "found" in table):
        return tree
    source = keys.read_source(values)
    paths: tuple[str, ...] = ()
    if isinstance(source, Files):
        paths = _paths(values, folder or Path())
        source = replace(source, paths=paths)
    measure, _ = keys.read_scale(values)
    gravity = keys.read_gravity(values)
    found: dict[str, Facts] = {}
    for i in range(len(paths) if isinstance(source, Files) else source.count):
        try:
            record = source.record(i)
        except (ValueError, OSError) as error:
            said = f"{paths[i]}: {error.strerror}" if isinstance(error, OSError) else str(error)
            raise JobError(f"{values.source}: records: {said}") from None
        if record.name in found:
            raise JobError(f"{values.source}: records.files: two records are named {record.name}")
        try:
            facts = facts_of(record, measure, gravity)
        except ValueError as error:
            raise JobError(f"{values.source}: records.scale: {error} ({record.name})") from None
        if not facts.measure > 0:
            shown = f"{values.source}: records: the {measure} of {record.name}"
            raise JobError(f"{shown} is {facts.measure:g}, must be above 0")
        found[record.name] = facts
    if "found" in table:
        _compare(values, found)
    own = {**table, "found": [facts._asdict() for facts in found.values()]}
    return {**tree, "records": {**own, "files": list(paths)} if paths else own}


def _compare(values: Values, found: dict[str, Facts]) -> None:
    """Refuse records that are not those the job was made with."""
    before, _ = keys.read_found(values)
    for old in before:
        if old.name not in found or found[old.name].digest != old.digest:
            said = f"{values.source}: records.found: {old.name} is not there any more as it was"
            raise JobError(f"{said}; take records.found away to use what is there")


def _paths(values: Values, folder: Path) -> tuple[str, ...]:
    """Return the files that names, folders and patterns stand for, each once, in their order."""
    given = values.get("records.files")
    patterns = [given] if isinstance(given, str) else given
    if not isinstance(patterns, list) or not patterns or not all(map(_is_name, patterns)):
        limit = 'must be names of files or folders, or patterns: ["*.AT2"]'
        raise values.error("records.files", given, limit)
    paths: dict[str, None] = {}
    for pattern in patterns:
        place = (folder / pattern).absolute()
        if place.is_dir():
            found = [str(p) for p in place.iterdir() if p.is_file() and p.name[0] != "."]
        elif place.exists():
            found = [str(place)]
        else:
            found = [name for name in glob.glob(str(place)) if Path(name).is_file()]  # noqa: PTH207
        if not found:
            raise values.error("records.files", pattern, f"there is no such file in {folder}")
        for name in found:
            if not name.isprintable():  # as one of bytes that are not UTF-8
                limit = "names of files and folders must be printable, in UTF-8"
                raise values.error("records.files", name, limit)
        paths |= dict.fromkeys(sorted(found))
    if len(paths) > keys.MAX_FILES:
        limit = f"gives {len(paths)} records, the most are {keys.MAX_FILES}"
        raise values.error("records.files", given, limit)
    return tuple(paths)


def _is_name(pattern: object) -> bool:
    return isinstance(pattern, str) and bool(pattern) and pattern.isprintable()
