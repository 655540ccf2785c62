"""Read the records of a job once: from then on the job holds their facts.

The files that ``records.files`` names are searched for and read, the suite of ``records.synthetic``
is made; of each record ``records.found`` then has a name, a checksum and the intensity measures.
A results file is read with the facts in its job, without the records.
"""

import glob
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from hpcsweep.earthquakes.intensity import Facts, Files, Measure, facts_of, rounded
from hpcsweep.earthquakes.spectrum import spectrum
from hpcsweep.job.job import JobError
from hpcsweep.job.keys import keys_of
from hpcsweep.job.structures import read_structure
from hpcsweep.job.values import Values
from hpcsweep.job.vary import parts_of
from hpcsweep.model.arguments import InputError
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion import keys
from hpcsweep.studies.ground_motion.records import Records
from hpcsweep.studies.study import Study, as_kind


def with_found(values: Values, tree: dict, folder: Path | None, file: str = "") -> dict:
    """Return a job with the facts of its records, unchanged where it has them or has no records.

    Parameters
    ----------
    values : Values
        Of the job.
    tree : dict
    folder : Path, optional
        To which paths are relative: records are looked for again, and must be those that the job
        was made with. Without it they are believed where they are there.
    file : str
        Of the rows of its table ``vary``, named in errors.

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
    periods: list[float] = []
    n_records = len(paths) if isinstance(source, Files) else source.count
    if measure.own_period:
        periods = _periods(values, tree, file, gravity)
        if len(periods) * n_records > keys.MAX_MEASURES:
            limit = f"needs {n_records} x {len(periods)} measures, {keys.MAX_MEASURES} at most"
            raise values.error("records.scale.period", measure.own_period, limit)
    suite: dict[str, Facts] = {}
    measures: dict[str, list[float]] = {}
    for i in counted(range(n_records), n_records, "reading record"):
        try:
            record = source.record(i)
        except (ValueError, OSError) as error:
            said = f"{paths[i]}: {error.strerror}" if isinstance(error, OSError) else str(error)
            raise JobError(f"{values.source}: records: {said}") from None
        if record.name in suite:
            raise JobError(f"{values.source}: records.files: two records are named {record.name}")
        try:
            if periods:
                spectral = spectrum(record, periods, measure.damping_ratio).acceleration
                measures[record.name] = [rounded(ordinate) for ordinate in spectral.tolist()]
            facts = facts_of(record, Measure() if periods else measure, gravity)
        except InputError as error:
            key = next(iter(keys.SCALED_BY[measure.by])) if error.key == "periods" else error.key
            limit = f"{error.limit} ({record.name})"
            raise JobError(limit, f"records.scale.{key}", values.source) from None
        if not min(measures.get(record.name, [facts.measure])) > 0:
            shown = f"{values.source}: records: the {measure} of {record.name}"
            raise JobError(f"{shown} is {facts.measure:g}, must be above 0")
        suite[record.name] = facts
    if "found" in table:
        _compare(values, suite)
    facts_found: Any = [facts._asdict() for facts in suite.values()]
    if periods:
        records = [{**record, "measure": measures[record["name"]]} for record in facts_found]
        facts_found = {"periods": periods, "records": records}
    stored = {**table, "found": facts_found}
    return {**tree, "records": {**stored, "files": list(paths)} if paths else stored}


def _periods(values: Values, tree: dict, file: str, gravity: float) -> list[float]:
    """Return the periods that all structures of a job have of their own, each once, ascending."""
    parts = parts_of(values, tree, _period, file)
    first, periods = (0,) * len(parts.axes), list[float]()
    parts.visit(lambda place: periods.append(parts(place)), [first])
    is_isolated = keys.read_scale(values)[0].own_period == keys.ISOLATED_PERIOD
    known_periods = None if is_isolated else parts.table.longest_periods(gravity)
    if known_periods is None:
        parts.visit(lambda place: periods.append(parts(place)))
    else:
        periods += known_periods.tolist()
    # what is given beside the table vary is read, too
    periods.append(_period(values.source, parts.tree_as_given()))
    return sorted(set(map(rounded, periods)))


def with_own_period(tree: dict, study: Study) -> dict:
    """Return the job of a part with the measures of records at its own period alone."""
    if "part" in tree or not isinstance(tree["records"].get("found"), Mapping):
        return tree
    ours = as_kind(study, Records)
    records = [{**facts._asdict(), "measure": [facts.measure]} for facts in ours.suite]
    stored = {"periods": [keys.own_period(ours.structure, ours.measure)], "records": records}
    return {**tree, "records": {**tree["records"], "found": stored}}


def _period(source: str, tree: Mapping) -> float:
    values = Values(source, tree)
    values.check_tables(keys_of(Records), dict)
    measure, _ = keys.read_scale(values)
    period = keys.own_period(read_structure(values), measure)
    if period == math.inf:
        isolated = measure.own_period == keys.ISOLATED_PERIOD
        limit = f"needs {'a building on bearings, building.isolation' if isolated else 'springs'}"
        raise values.error("records.scale.period", measure.own_period, limit)
    return period


def _compare(values: Values, suite: dict[str, Facts]) -> None:
    """Refuse records that differ from those the job was written with."""
    before, _ = keys.read_found(values)
    for old in before:
        if old.name not in suite or suite[old.name].digest != old.digest:
            limit = f": {old.name} is missing or has changed since this job was written"
            limit += "; delete records.found to use the records that are there"
            raise JobError(limit, "records.found", values.source)


def _paths(values: Values, folder: Path) -> tuple[str, ...]:
    """Return the files that names, folders and patterns match, each once, in order."""
    patterns = values.get("records.files")
    what = 'names of files or folders, or patterns: ["*.AT2"]'
    paths: dict[str, None] = {}
    for pattern in values.names("records.files", patterns, what):
        place = (folder / pattern).absolute()
        if place.is_dir():
            names = [str(p) for p in place.iterdir() if p.is_file() and p.name[0] != "."]
        elif place.exists():
            names = [str(place)]
        else:
            names = [name for name in glob.glob(str(place)) if Path(name).is_file()]  # noqa: PTH207
        if not names:
            raise values.error("records.files", pattern, f"there is no such file in {folder}")
        for name in names:
            if not name.isprintable():  # as one of bytes that are not UTF-8
                limit = "names of files and folders must be printable, in UTF-8"
                raise values.error("records.files", name, limit)
        paths |= dict.fromkeys(sorted(names))
    if len(paths) > keys.MAX_FILES:
        limit = f"gives {len(paths)} records, the most are {keys.MAX_FILES}"
        raise values.error("records.files", patterns, limit)
    return tuple(paths)
