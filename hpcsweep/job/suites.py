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

import numpy as np

from hpcsweep.earthquakes.intensity import ISOLATED_PERIOD, Facts, facts_of, rounded
from hpcsweep.job.job import JobError
from hpcsweep.job.keys import keys_of
from hpcsweep.job.rows import read_rows
from hpcsweep.job.structures import read_structure
from hpcsweep.job.values import Values
from hpcsweep.job.vary import parts_of
from hpcsweep.model.arguments import InputError
from hpcsweep.parallel.counted import counted
from hpcsweep.studies.ground_motion import keys, scales
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
    tree, table = _with_tables(values, tree, folder)
    values = Values(values.source, tree)
    keys.read_source(values)
    paths = _paths(values, folder or Path()) if "files" in table else ()
    source = keys.read_source(values, paths)
    measure, _ = scales.read_scale(values)
    gravity = scales.read_gravity(values)
    periods: list[float] = []
    n_records = source.count
    if measure.own_period:
        periods = _periods(values, tree, file, gravity)
        if len(periods) * n_records > keys.MAX_MEASURES:
            limit = f"needs {n_records} x {len(periods)} measures, {keys.MAX_MEASURES} at most"
            raise values.error("records.scale.period", measure.own_period, limit)
        measure = replace(measure, periods=tuple(periods))
    suite: dict[str, Facts] = {}
    ordinates: list[np.ndarray] = []
    for i in counted(range(n_records), n_records, "reading record"):
        try:
            record = source.record(i)
        except (ValueError, OSError) as error:
            raise values.unread("records", error) from None
        if record.name in suite:
            raise JobError(f"{values.source}: records.files: two records are named {record.name}")
        try:
            suite[record.name] = facts_of(record, gravity)
            ordinates.append(measure.ordinates(record))
        except InputError as error:
            key = next(iter(scales.SCALED_BY[measure.by])) if error.key == "periods" else error.key
            limit = f"{error.limit} ({record.name})"
            raise JobError(limit, f"records.scale.{key}", values.source) from None
        if not ordinates[-1].min() > 0:
            shown = f"{values.source}: records: the {measure} of {record.name}"
            raise JobError(f"{shown} is 0, must be above 0")
    if "found" in table:
        _compare(values, suite)
    names = [*suite]
    if measure.components:
        pairs = _pairs(values, names)
        for i, k in counted(pairs, len(pairs), "measuring pair"):
            try:
                ordinates[i] = ordinates[k] = measure.ordinates(source.record(i), source.record(k))
            except InputError as error:
                limit = f"{names[k]} beside {names[i]}: {error.limit}"
                raise JobError(f": {limit}", "records.pairs", values.source) from None
    every = np.array(ordinates)
    measures = every.tolist() if periods else measure.of(every).tolist()
    facts_found: Any = [facts._asdict() for facts in suite.values()]
    for found, numbers in zip(facts_found, measures, strict=True):
        found["measure"] = [*map(rounded, numbers)] if periods else rounded(numbers)
    if "factors" in values.table("records").get("scale", {}):
        for found, factor in zip(facts_found, scales.read_factors(values, names), strict=True):
            found["measure"] = 1.0 / factor
    if periods:
        facts_found = {"periods": periods, "records": facts_found}
    stored = {**table, "found": facts_found}
    return {**tree, "records": {**stored, "files": list(paths)} if paths else stored}


def _with_tables(values: Values, tree: dict, folder: Path | None) -> tuple[dict, dict]:
    """Return a job, and its table of records, with what the files hold that these name."""
    table = dict(tree["records"])
    if isinstance(table.get("columns"), str):
        table["columns"], _ = read_rows(values, "records.columns", table["columns"], folder)
    scale = table.get("scale")
    if isinstance(scale, dict) and isinstance(scale.get("target"), str):
        rows, _ = read_rows(values, "records.scale.target", scale["target"], folder)
        table["scale"] = {**scale, "target": [[*row.values()] for row in rows]}
    return {**tree, "records": table}, table


def _pairs(values: Values, names: list[str]) -> list[list[int]]:
    """Return the places of records that are components of one motion."""
    pairs = values.get("records.pairs")
    known = {name: i for i, name in enumerate(names)}
    try:
        places = [[known[name] for name in pair] for pair in pairs]  # type: ignore[attr-defined]
    except (TypeError, KeyError):
        places = []
    listed = sorted(place for pair in places for place in pair)
    if any(len(pair) != 2 for pair in places) or listed != [*range(len(names))]:
        limit = f'must have each record once, [["a-EW", "a-NS"]], of {", ".join(names)}'
        raise values.error("records.pairs", pairs, limit)
    return places


def _periods(values: Values, tree: dict, file: str, gravity: float) -> list[float]:
    """Return the periods that all structures of a job have of their own, each once, ascending."""
    parts = parts_of(values, tree, _period, file)
    first, periods = (0,) * len(parts.axes), list[float]()
    parts.visit(lambda place: periods.append(parts(place)), [first])
    is_isolated = scales.read_scale(values)[0].own_period == ISOLATED_PERIOD
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
    measure, _ = scales.read_scale(values)
    period = keys.own_period(read_structure(values), measure)
    if period == math.inf:
        isolated = measure.own_period == ISOLATED_PERIOD
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
