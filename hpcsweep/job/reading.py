"""Read job files: TOML in, a validated `Job` out. The only place that checks user input.

Every error is one line that names the file, the key, the value and the limit. Keys of only one kind
of study are read by that study, with the same `Values`.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hpcsweep.job import structures
from hpcsweep.job.forcing import forcing_notes
from hpcsweep.job.job import ABOUT, Job, JobError
from hpcsweep.job.keys import every_key, keys_of
from hpcsweep.job.paths import path_of
from hpcsweep.job.rows import with_rows
from hpcsweep.job.tree import parse_toml, resolve, write
from hpcsweep.job.values import Values
from hpcsweep.job.vary import Parts, read_followed, read_varied, unused
from hpcsweep.model import arguments
from hpcsweep.model.confinement import unconfined
from hpcsweep.model.coordinates import coordinate_of
from hpcsweep.model.structure import Structure
from hpcsweep.model.unit_names import is_in_gaps
from hpcsweep.solvers.arguments import AT_STRENGTH, MAX_PERIOD
from hpcsweep.solvers.offers import BDF, FORCES, HARMONIC, TANGENTS
from hpcsweep.solvers.solver import SOLVERS
from hpcsweep.studies import settings as sweep
from hpcsweep.studies.blocks import Place
from hpcsweep.studies.keys import BLOCK, Key
from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS
from hpcsweep.studies.path_grid import ALONG
from hpcsweep.studies.quantities import METRIC_KEYS, ROW_KEYS
from hpcsweep.studies.run_names import count
from hpcsweep.studies.study import Study, as_kind
from hpcsweep.studies.vary import Varied

MAX_NAME = 200
"""Bytes of a job's name; endings are added to it."""
MAX_BLOCKS = 20_000_000
"""Blocks of a job: each takes some 100 bytes of rank 0's memory."""
MAX_RUNS = 2**40
MAX_STATE = 1e200
TOLERANCES = 1e-300, math.nextafter(1.0, 0.0)


def load_job(path: str | Path, settings: Sequence[str] = ()) -> Job:
    """Read and validate a job file.

    Parameters
    ----------
    path : str or Path
        The file; the files that it extends are read too.
    settings : sequence of str
        ``TABLE.KEY=VALUE`` each, the value in TOML: replace the values of the files.

    Returns
    -------
    Job
        Its `study` has the structure, the settings of the runs and their grid.

    Raises
    ------
    JobError
        If a file cannot be read, or all together is not a valid job.

    Examples
    --------
    ``study.toml`` is a job, ``study.h5`` its results:

    >>> job = hpcsweep.load_job("study.toml", ["structure.n_floors=2"])
    >>> job.study.structure.n_floors
    2
    """
    path = path_of("path", path)
    settings = arguments.words("settings", settings)
    text, source, notes = resolve(path, settings, every_key, _drop_inherited)
    job = parse_job(text, source, path.stem, path.parent)
    return replace(job, notes=(*notes, *job.notes))


INSTEAD = {
    "sweep.frequency": ("sweep.omega",),
    "sweep.omega": ("sweep.frequency",),
    "study.points": ("sweep.omega", "sweep.frequency", "sweep.amplitude"),
    "structure.rayleigh": ("structure.damping_ratio",),
}
"""By a key, those in whose place it is given."""


def _drop_inherited(whole: dict, keys_of_job: set[str]) -> list[str]:
    """Remove inherited keys that the job's own keys make useless; return messages.

    These are keys that another key replaces, and keys of other kinds of study only.
    """
    kind = whole.get("study", {}).get("kind", DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in KINDS:
        return []
    elsewhere = {key: f"goes with {kinds}" for key, kinds in _keys_of_others(KINDS[kind]).items()}
    for key in keys_of_job:
        elsewhere |= {other: f"{key} is given" for other in INSTEAD.get(key, ())}
    notes = []
    for full, why in elsewhere.items():
        table, key = full.split(".")
        if full not in keys_of_job and key in whole.get(table, {}):
            del whole[table][key]
            notes.append(f"not inherited: {full} ({why})")
    return notes


def parse_job(
    text: str, source: str, default_name: str, folder: Path | None = None, is_stored: bool = False
) -> Job:
    """Validate the text of a job; `source` is named in errors.

    Records, and the files of a model, are looked for in the folder, if one is given, or if the job
    does not say what they are: then it says so afterwards (`hpcsweep.job.suites`, `models`). Of a
    stored job the first part is validated, as all were before it was stored.

    Raises
    ------
    JobError
        If it is not a valid job.
    """
    tree = parse_toml(text, source)
    whole, file = with_rows(Values(source, tree), tree, folder)
    structure, reduced = whole.get("structure"), None
    if isinstance(structure, Mapping) and "model" in structure:
        from hpcsweep.job.models import with_model, with_record_error

        whole, reduced = with_model(Values(source, whole), whole, folder)
    if "records" in tree:
        from hpcsweep.job.suites import with_found

        whole = with_found(Values(source, whole), whole, folder, file)
    if reduced is not None:
        whole = with_record_error(Values(source, whole), whole, reduced, read_study)
    if whole is not tree:
        tree, text = whole, write(whole, every_key())
    values = Values(source, tree)
    study = read_varied(values, tree, read_study, file, is_stored)
    _check_extent(values, study)
    job = Job(
        name=_name(values, default_name),
        text=text,
        study=study,
        notes=(*unused(study.axes, tree), *forcing_notes(values)),
        about=_about(values),
    )
    if job.growth is not None and (reason := job.growth.problem()):
        raise JobError(f"{source}: {reason}")
    return job


def read_study(source: str, tree: Mapping):
    """Read the study of a job that varies no key; `source` is named in errors."""
    return read_values(Values(source, tree))


def read_values(values: Values):
    """Read the study of a job that varies no key."""
    study = _kind(values)
    values.check_tables(keys_of(study), partial(_keys_of_others, study))

    def structure_of(job: Mapping) -> Structure:
        step_values = Values(values.source, job)
        step_values.check_tables(keys_of(study), partial(_keys_of_others, study))
        return structures.read_structure(step_values)

    followed = None
    if ALONG in study.keys.get("sweep", ()):
        followed = read_followed(values, values.tree, structure_of)
    each = followed.structures if followed else (structures.read_structure(values),)
    along = {"followed": followed} if followed else {}
    # lengths are in gaps, say, only where they are all along
    structure = min(each, key=lambda step: (step.is_uniform, is_in_gaps(step)))
    if told := next(filter(None, map(unconfined, each)), "") if study.recurs else "":
        raise JobError(told, "structure", values.source)
    if study.kind != "records" and not all(map(HARMONIC.of, each)):
        limit = f"must be without {HARMONIC.without}: {HARMONIC.why}"
        raise JobError(limit, "structure", values.source)
    settings = _settings(values, study.skip_rules)
    if settings.solver == "bdf" and not all(map(BDF.of, each)):
        raise values.error("solver.method", settings.solver, f"must be 'flow' {BDF.lacks}")
    if "contact_force" in settings.metrics and not all(map(FORCES.of, each)):
        limit = f"must be false {FORCES.lacks}, output.impulse tells by how much"
        raise values.error("output.contact_force", True, limit)
    if settings.rows and settings.solver == "bdf":
        raise values.error("output.rows", [*settings.rows], "must be empty with solver.method bdf")
    for word, one in product(settings.rows, each):
        try:
            coordinate_of(one, word)
        except ValueError as error:
            raise values.error("output.rows", word, str(error)) from None
    if "lyapunov_spectrum" in settings.metrics and not TANGENTS.of(structure):
        raise values.error("output.lyapunov_spectrum", True, f"must be false {TANGENTS.lacks}")
    usual = study.default_block if SOLVERS[settings.solver].follows_orbits else 1
    block = values.get("output.block", usual)
    whole = study.read(
        values,
        structure=structure,
        initial_state=_initial_state(values, each[0], study.starts_at_rest),
        settings=settings,
        block_size=values.whole("output.block", block, *BLOCK.limits),
        **along,
    )
    return _portion(values, whole)


def _portion(values: Values, study):
    """Return the part of a study that its job computes."""
    part: Any = values.top("part", None)
    if part is None:
        return study
    if not study.cut(slice(None)):
        raise values.error("part", part, "is not allowed: this study cannot be split")
    is_pair = isinstance(part, list) and len(part) == 2 and all(type(x) is int for x in part)
    if not is_pair or not 1 <= part[0] <= part[1]:
        raise values.error("part", part, "must be [k, n], part k of n, from 1 to n")
    if part[1] > study.n_frames:
        frames = count(study.n_frames, study.run_dims[-2])
        raise values.error("part", part, f"n must not exceed the {frames}")
    return replace(study, **study.cut(slice(part[0] - 1, None, part[1])))


def part_of(job: Job, place: Place) -> Job:
    """Return the job of one part; a job that varies no keys is its only part."""
    if not isinstance(job.study, Varied):
        return job
    tree, study = as_kind(job.study.make, Parts).tree_at(place), job.study.part(place)
    if "records" in tree:
        from hpcsweep.job.suites import with_own_period

        tree = with_own_period(tree, study)
    return Job(name=job.name, text=write(tree, every_key()), study=study)


def _check_extent(values: Values, study: Study) -> None:
    """Refuse a study with too many runs or blocks for memory."""
    if study.n_runs > MAX_RUNS:
        raise JobError(f"{values.source}: gives {study.n_runs} runs, the most are {MAX_RUNS}")
    n_blocks = math.prod(study.dimensions[dim] for dim in study.commit.dims)
    if n_blocks > MAX_BLOCKS:
        limit = f"gives {n_blocks} blocks, the most are {MAX_BLOCKS}: make it larger"
        raise values.error("output.block", study.block_size, limit)


def _keys_of_others(study) -> dict[str, str]:
    """Return the keys that only other kinds of study have, with these kinds."""
    keys_here = keys_of(study)
    homes: dict[str, list[str]] = {}
    for other in KINDS.values():
        for table, keys in keys_of(other).items():
            for key in keys:
                if key not in keys_here[table]:
                    homes.setdefault(f"{table}.{key}", []).append(f'"{other.kind}"')
    return {key: f"study.kind = {' or '.join(kinds)}" for key, kinds in homes.items()}


def _kind(values: Values):
    """Read the kind of study."""
    kind = values.table("study").get("kind", DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in KINDS:
        near = [name for name in KINDS if isinstance(kind, str) and kind and kind in name]
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise values.error("study.kind", kind, f"must be one of {', '.join(KINDS)}{hint}")
    return KINDS[kind]


def _name(values: Values, default: str) -> str:
    name = values.top("name", default)
    if not isinstance(name, str) or not name or "/" in name or name != name.strip():
        raise values.error("name", name, "must be a file name without folder")
    if not name.isprintable() and name is not default:
        raise values.error("name", name, "must be of characters that can be printed")
    if len(os.fsencode(name)) > MAX_NAME:
        raise values.error("name", name, f"must have {MAX_NAME} bytes at most")
    part = values.top("part", None)
    if isinstance(part, list) and name is not default:
        name += "-{}of{}".format(*part)
    return name.encode(errors="replace").decode()


def _about(values: Values) -> dict[str, str]:
    texts = {key: values.top(key, "") for key in ABOUT}
    for key, text in texts.items():
        if not isinstance(text, str) or not text.isprintable():
            raise values.error(key, text, "must be a text of one line")
    return {key: str(text) for key, text in texts.items() if text}


def _initial_state(values: Values, structure: Structure, at_rest: bool) -> np.ndarray:
    start = values.get("sweep.initial_state", "rest")
    sliders = structure.sliders if not at_rest else ()
    size = 2 * structure.n_floors + len(sliders)
    if start == "rest":
        return np.zeros(size)
    if not isinstance(start, list) or len(start) != size:
        form = f"2 n + L = {size} numbers, u, v and p" if sliders else f"2 n = {size} numbers"
        raise values.error("sweep.initial_state", start, f'must be "rest" or a list of {form}')
    state = np.array([values.number("sweep.initial_state", value) for value in start])
    if not np.all(np.abs(state) <= MAX_STATE):
        limit = f"must be finite, and at most {MAX_STATE:g}"
        raise values.error("sweep.initial_state", start, limit)
    moved, lasting = state[: structure.n_floors], state[size - len(sliders) :]
    stretched = structure.slider_directions[: len(sliders)] @ moved - lasting
    for name, slider, d in zip(structure.slider_names, sliders, np.abs(stretched), strict=False):
        if d > slider.limit * (1.0 + AT_STRENGTH):
            limit = f"must have |b . u - p| of slider {name} at most {slider.limit:.6g}, is {d:.6g}"
            raise values.error("sweep.initial_state", start, limit)
    return state


def _settings(values: Values, skip_rules: tuple[str, ...]) -> sweep.SweepSettings:
    def read(key: str, default: Any, *limits: Any) -> Any:
        table, name = key.split(".")
        return values.read(table, Key(name, "", default, limits))

    usual, sampling = sweep.SweepSettings(), values.read("sweep", sweep.SAMPLING)
    method = read("solver.method", usual.solver, *SOLVERS)
    longest = max(min(sampling // 2, MAX_PERIOD), 1)
    longest = read("sweep.max_orbit_period", min(usual.max_orbit_period, longest), 1, longest)
    least = min(2 * longest, sampling)
    n_points = values.get("output.max_points", sampling)
    if type(n_points) is not int or not least <= n_points <= sweep.MAX_CYCLES:
        limit = f"must be a whole number from 2 max_orbit_period = {least} to {sweep.MAX_CYCLES}"
        raise values.error("output.max_points", n_points, limit)
    cycles, rows = SOLVERS[method].classify_cycles, values.get("output.rows", [])
    if not isinstance(rows, list) or not all(type(row) in (int, str) for row in rows):
        raise values.error("output.rows", rows, 'must be a list such as ["1", "2-1"]')
    return sweep.SweepSettings(
        transient_cycles=values.read("sweep", sweep.TRANSIENT),
        sampling_cycles=sampling,
        max_orbit_period=longest,
        period_tolerance=read("sweep.period_tolerance", usual.period_tolerance, *TOLERANCES),
        solver=method,
        rtol=read("solver.rtol", SOLVERS[method].rtol, 1e-13, 1e-2),
        skip=_skip(values, skip_rules),
        metrics=frozenset(key.name for key in METRIC_KEYS if values.read("output", key)),
        max_points=n_points if n_points < sampling else None,
        classify_cycles=read("sweep.classify_cycles", cycles, 0, sweep.MAX_CYCLES),
        spectrum_error=values.read("sweep", sweep.SPECTRUM_ERROR),
        spectrum_cycles=values.read("sweep", sweep.SPECTRUM_CYCLES),
        rows=tuple(dict.fromkeys(map(str, rows))),
        n_harmonics=values.read("output", ROW_KEYS[1]),
    )


def _skip(values: Values, rules: tuple[str, ...]) -> frozenset[str]:
    value = values.get("solver.skip", "all")
    if value == "all":
        return frozenset(rules)
    if value == "none":
        return frozenset()
    if not isinstance(value, list) or not all(name in rules for name in value):
        limit = f'must be "all", "none" or a list of {", ".join(rules)}'
        raise values.error("solver.skip", value, limit)
    return frozenset(value)
