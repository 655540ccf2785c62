"""Give every key of every kind of job odd values: odd_values.py [--kind K] [--accepted].

Each case is a sound job with one value in the place of another, read as `run --dry-run` reads it,
and described. A refusal is one line that begins with the file and names the key. What is not so is
listed, and with `--accepted` every value that is taken, for somebody to judge.
"""

import argparse
import copy
import datetime
import re
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from hpcsweep.campaign.describe import describe
from hpcsweep.job import JobError, load_job
from hpcsweep.job.keys import every_key, keys_of
from hpcsweep.job.tree import parse_toml, write
from hpcsweep.studies.kinds import KINDS

NAN, INF = float("nan"), float("inf")
ODD: tuple[Any, ...] = (
    *(NAN, INF, -INF, 1e300, 5e-324, -1, 0, 0.0, 10**30, -(10**30), 10**400, 10**12, 1.5),
    *("", "x", "a\nb", [], {}, [[]], [{}], True, False, datetime.date(1979, 5, 27)),
    *([1.0], [NAN], [10**30], ["x"], [0.5, 1.5], [[0.5, 1.5]], [-1.0, 1.0, 2.0], {"x": 1}),
    {"from": 0.0, "to": 1.0, "count": 10**9},
    {"from": 0.0, "to": 1.0, "step": 1e-9},
    {"from": 1e-300, "to": 1e300, "count": 3},
)
MATRICES = """
[structure]
sharpness = inf
damping_ratio = 0.05
[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[2.0, -1.0], [-1.0, 1.0]]
forcing = [-1.0, -2.0]
drift = [[1.0, 0.0]]
[[structure.contact]]
direction = [0.0, 1.0]
gap = 1.0
stiffness = 100.0
damping = 0.5
tension = true
"""
BUILDINGS = """
[[building]]
mass = [1.0, 1.0]
storey_stiffness = [900.0, 800.0]
storey_height = 3.0
damping_ratio = 0.05
name = "A"
[[building]]
mass = [1.0, 1.0]
period = 0.5
storey_height = 3.0
rayleigh = [0.1, 0.01]
[pounding]
gap = 0.01
stiffness = 1e4
restitution = 0.7
tension = false
[units]
length = "m"
mass = "kg"
time = "s"
"""
STOREYS = """
[structure]
n_floors = 2
stiffness_ratio = [100.0, 200.0]
sharpness = inf
damping_ratio = 0.05
gap = [1.0, 1.0]
gap_left = 1.0
restitution = 0.8
tension = true
"""
SLIDERS = """
[structure]
damping_ratio = 0.02
collapse_drift = 5.0
[structure.matrices]
mass = [1.0, 2.0]
stiffness = [[2.0, -1.0], [-1.0, 1.0]]
[[structure.slider]]
direction = [-1.0, 1.0]
stiffness = 3.0
strength = 0.5
name = "brace"
"""
ISOLATED = """
[[building]]
mass = [1.0, 1.0]
storey_stiffness = [900.0, 800.0]
yield_drift = 0.02
hardening = 0.05
[building.isolation]
slab_mass = 1.0
radius = 2.0
friction = 0.05
damping_ratio = 0.02
gap = 0.1
wall_stiffness = 1e4
[units]
length = "m"
"""
SYNTHETIC = "[records.synthetic]\ncount = 1\nduration = 2.0\n"
HARMONIC = """
[forcing]
harmonics = [{order = 1, amplitude = 1.0, phase = 0.5}]
[sweep]
omega = {from = 0.5, to = 0.8, count = 4}
amplitude = [0.1, 0.2, 0.3]
"""
POINT = "[sweep]\nomega = 0.6\namplitude = 0.2\n"
REFINE = '[study.refine]\nlevels = 2\non = ["contact"]\nwrong = 0.01\nseed = 1\n'
JOBS = {
    "amplitude_sweep": STOREYS + HARMONIC,
    "points": '[study]\nkind = "points"\n' + REFINE + MATRICES + HARMONIC,
    "attractors": '[study]\nkind = "attractors"\n' + STOREYS + HARMONIC,
    "basins": '[study]\nkind = "basins"\n' + STOREYS + POINT,
    "branches": '[study]\nkind = "branches"\n[branches]\nseeds = "a.h5"\n' + MATRICES + HARMONIC,
    "records": '[study]\nkind = "records"\n'
    + BUILDINGS
    + SYNTHETIC
    + '[records.scale]\nby = "sa"\nperiod = 0.5\nfrom = 0.5\nto = 1.0\ncount = 3\n',
    "records of a building on bearings": '[study]\nkind = "records"\n' + ISOLATED + SYNTHETIC,
    "a sweep of sliders": SLIDERS + HARMONIC,
    "records of files": '[study]\nkind = "records"\n'
    + STOREYS
    + '[records]\nfiles = "a.txt"\ndt = 0.01\nunit = "structure"\n',
}
"""Sound jobs, at least one of each kind of study, with all that has keys of its own."""
INNER = {
    "structure.matrices": ("mass", "stiffness", "damping", "forcing", "drift"),
    "structure.contact[0]": ("direction", "gap", "stiffness", "damping", "tension"),
    "structure.slider[0]": ("direction", "stiffness", "strength", "name"),
    "building[0]": (
        *("mass", "storey_stiffness", "storey_height", "damping_ratio", "rayleigh", "name"),
        *("period", "yield_force", "yield_drift", "hardening", "isolation"),
    ),
    "building[0].isolation": (
        *("slab_mass", "period", "stiffness", "radius", "strength", "yield_drift", "friction"),
        *("initial_stiffness", "damping_ratio", "gap", "wall_stiffness"),
    ),
    "forcing.harmonics[0]": ("order", "amplitude", "phase"),
    "records.synthetic": ("count", "seed", "dt", "duration", "rms", "soil"),
    "records.scale": (
        *("by", "period", "periods", "damping_ratio", "values", "from", "to", "count", "step"),
    ),
    "study.refine": ("levels", "on", "wrong", "seed", "curves"),
    "sweep.omega": ("from", "to", "count", "step"),
}
"""Keys of tables within tables."""


VARIED = ("study", "structure", "pounding", "sweep", "solver")
"""Tables whose keys are tried under ``[vary]``, too."""
FINE = {"refused", "accepted"}
MAX_SECONDS = 1.0


class Case(NamedTuple):
    """A value of a key of a job."""

    job: str
    key: str
    value: Any


def cases(job: str) -> Iterator[Case]:
    """Iterate over the cases of a job."""
    tree = parse_toml(JOBS[job], job)
    study = KINDS[tree.get("study", {}).get("kind", "amplitude_sweep")]
    keys = [
        f"{table}.{key}" if table else key for table, own in keys_of(study).items() for key in own
    ]
    keys += [f"{place}.{key}" for place, own in INNER.items() for key in own if _at(tree, place)]
    keys += [f"vary.{key}" for key in keys if key.split(".")[0] in VARIED]
    for key in keys:
        for value in ODD:
            yield Case(job, key, value)
            if key.startswith("vary."):
                yield Case(job, key, [value])


def judge(case: Case, folder: Path) -> str:
    """Return what became of a case: ``accepted``, ``refused``, or what is wrong with it."""
    path = folder / "job.toml"
    tree = with_value(parse_toml(JOBS[case.job], case.job), case.key, case.value)
    path.write_text(write(tree, every_key()))
    try:
        list(describe(load_job(path)))
    except JobError as error:
        said = str(error)
        if not said.startswith(f"{path}: "):
            return f"no file: {said}"
        if "\n" in said or len(said) > 500:
            return f"no line: {said}"
        return "refused" if names(said, case.key) else f"no key: {said}"
    except Exception as error:
        return f"traceback: {type(error).__name__}: {error}"
    return "accepted"


def with_record(folder: Path) -> Path:
    """Write the record of a job into a folder, and return it."""
    (folder / "a.txt").write_text("\n".join(str((-1) ** j * 0.1 * j) for j in range(20)))
    return folder


def names(said: str, key: str) -> bool:
    """Return whether a message names a key, or another with which it is at odds."""
    plain = re.sub(r"\[\d+\]", "", key.removeprefix("vary."))
    said = re.sub(r"\[\d+\]", "", said)
    if plain in said or re.search(rf"(?<![\w.]){plain.rpartition('.')[2]}\b", said):
        return True
    table, _, name = plain.rpartition(".")
    in_range = name in ("from", "to", "count", "step") and table in said
    return in_range or " is missing" in said


def with_value(tree: dict, key: str, value: Any) -> dict:
    """Return a tree with one value changed."""
    tree = copy.deepcopy(tree)
    if key.startswith("vary."):
        tree["vary"] = {key.removeprefix("vary."): value}
        return tree
    *places, last = key.split(".")
    below: Any = tree
    for place in places:
        name, _, number = place.rstrip("]").partition("[")
        below = below.setdefault(name, {}) if not number else below[name][int(number)]
    below[last] = value
    return tree


def _at(tree: dict, place: str) -> Any:
    """Return the table at a place of a tree, if it is there."""
    below: Any = tree
    for part in place.split("."):
        name, _, number = part.rstrip("]").partition("[")
        below = below.get(name)
        if number and below:
            below = below[int(number)]
        if not isinstance(below, dict):
            return None
    return below


def main() -> int:
    """List what is wrong, and on request what is accepted."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", action="append", choices=tuple(JOBS))
    parser.add_argument("--accepted", action="store_true")
    options = parser.parse_args()
    counts: dict[str, int] = {}
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as name:
        folder = with_record(Path(name))
        for job in options.kind or JOBS:
            for case in cases(job):
                begun = time.process_time()
                found = judge(case, folder)
                if (taken := time.process_time() - begun) > MAX_SECONDS:
                    found = f"slow: {taken:.3g} s: {found}"
                kind = found.partition(":")[0]
                counts[kind] = counts.get(kind, 0) + 1
                if kind not in FINE or (options.accepted and kind == "accepted"):
                    print(f"{case.job}: {case.key} = {str(case.value)[:60]!r}: {found}", flush=True)
    print(counts)
    return 0 if counts.keys() <= FINE else 1


if __name__ == "__main__":
    sys.exit(main())
