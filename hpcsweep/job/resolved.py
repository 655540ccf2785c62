"""The text of a job with all defaults, for files that outlive these defaults."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from hpcsweep.job.forcing import HARMONIC
from hpcsweep.job.job import Job
from hpcsweep.job.keys import STRUCTURE, keys_of
from hpcsweep.job.reading import read_values
from hpcsweep.job.tree import parse_toml, with_value, write
from hpcsweep.job.values import Values
from hpcsweep.job.vary import Parts
from hpcsweep.model.buildings import Building
from hpcsweep.model.matrices import Contact
from hpcsweep.studies.study import as_kind
from hpcsweep.studies.vary import Varied


def resolved(job: Job) -> str:
    """Return the same job as TOML in which every key that has a value is given.

    Where keys vary, those are added whose defaults do not depend on one of them.
    """
    tree, study = parse_toml(job.text, job.name), job.study
    firsts: list[dict] = [tree]
    if isinstance(study, Varied):
        parts, study = as_kind(study.make, Parts), study.base
        firsts = [parts.tree_at(place) for place in parts.table.telling(study) or _along(parts)]
    defaults, *others = map(_defaults, firsts)
    for other in others:
        defaults = {key: value for key, value in defaults.items() if other.get(key) == value}
    if study.settings.classify_cycles is None:  # of a study that classifies in its own way
        defaults.pop("sweep.classify_cycles", None)
    keys = keys_of(study)
    if keys["forcing"] and set(tree.get("forcing", {})) <= {"harmonics"}:
        terms = [dict(zip(HARMONIC, harmonic, strict=True)) for harmonic in job.structure.harmonics]
        for term in terms:
            if not term["order"]:
                del term["phase"]
        defaults["forcing.harmonics"] = terms
    whole: dict[str, Any] = {"name": job.name} | tree
    for key, value in defaults.items():
        table, name = key.split(".", 1)
        if name in keys.get(table, (name,)):
            whole = with_value(whole, key, _plain(value), job.name)
    return write(whole, keys)


def _along(parts: Parts) -> Iterator[tuple[int, ...]]:
    """Iterate over the first part, and those in which one key has another value."""
    first = (0,) * len(parts.axes)
    yield first
    for i, axis in enumerate(parts.axes):
        for at in range(1, len(axis.values)):
            yield (*first[:i], at, *first[i + 1 :])


def _defaults(tree: Mapping[str, Any]) -> dict[str, object]:
    """Return the defaults of a job without ``vary``, by their keys."""
    values = Values("", tree)
    read_values(values)
    structure = tree.get("structure", {})
    buildings = tree.get("building", [])
    places: list[tuple[str, Mapping, Mapping]] = []
    usual: Mapping
    if not buildings and not {"matrices", "model"} & set(structure):
        usual = {key.name: key.default for key in STRUCTURE["structure"]}
        places.append(("structure", structure, usual))
    elif not buildings:
        places.append(("structure", structure, {"sharpness": np.inf}))
    for name, tables, kind in (
        ("building", buildings, Building),
        ("structure.contact", structure.get("contact", []), Contact),
    ):
        usual = {field.name: field.default for field in fields(kind)}
        places += [(f"{name}[{k}]", table, usual) for k, table in enumerate(tables)]
    if len(buildings) > 1:
        usual, each = {"sharpness": np.inf, "tension": False}, tree["pounding"]
        places += [("pounding", each, usual)] if isinstance(each, Mapping) else []
    for place, table, usual in places:
        without = (*table, *(("damping_ratio",) if "rayleigh" in table else ()))
        for name, default in usual.items():
            if isinstance(default, int | float) and name not in without:
                values.defaults[f"{place}.{name}"] = default
    return values.defaults


def _plain(value: Any) -> Any:
    """Return a value as a TOML parser would."""
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    return value.item() if isinstance(value, np.generic) else value
