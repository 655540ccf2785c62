"""Write the files that every later version must read: python tests/data/keep.py [NAME...]

A small results file of each kind of study, and the jobs of the guides and of jobs/ with what they
mean. From release 1.0 on nothing here is written anew: a change of the layout adds files of its own
number, and goes on reading these (docs/releasing.md). Until then whoever changes what is in the
files of a job runs this, which takes a minute, and compiling before it.
"""

import contextlib
import json
import os
import re
import sys
import tomllib
from pathlib import Path

import h5py

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / folder) for folder in ("tests/support", "tests/docs", "docs")]
RUNS = """
[structure]
n_floors = 2
stiffness_ratio = 300.0
sharpness = 4e3
damping_ratio = 0.05
[sweep]
omega = {from = 0.5, to = 0.8, count = 2}
amplitude = {from = 0.02, to = 0.3, count = 6}
transient_cycles = 30
sampling_cycles = 8
max_orbit_period = 4
[output]
block = 2
"""
POINTS = '[study]\nkind = "points"\n' + RUNS.replace("block = 2", "lyapunov_spectrum = true")
STOPS = """
[structure]
n_floors = 1
gap = 0.5
gap_left = 0.5
stiffness_ratio = 50.0
sharpness = inf
"""
BASINS = f"""
[study]
kind = "basins"
horizontal = {{from = -0.9, to = 1.0, count = 5}}
vertical = {{from = -1.0, to = 1.0, count = 4}}
starts = 16
max_cycles = 600
{STOPS}
[sweep]
omega = 1.0
amplitude = 0.7
[output]
max_points = 32
"""
RECORDS = """
[study]
kind = "records"
[[building]]
name = "A"
mass = [2.5e5, 2.5e5]
storey_stiffness = 3e8
storey_height = 3.2
[[building]]
name = "B"
mass = [2.5e5, 2.5e5]
storey_stiffness = 1e8
storey_height = 3.2
[pounding]
gap = 0.02
stiffness = 2e9
[records]
synthetic = {count = 2, seed = 3, dt = 0.02, duration = 4.0}
tail = 0.5
scale = {by = "pga", from = 0.5, to = 5.0, count = 3}
[output]
block = 2
history = 0.1
floor_spectra = {periods = [0.1, 0.5]}
"""
BACKBONE = 'backbone = {theta_p = 0.02, theta_pc = 0.02, Lambda = 0.2, rule = "peak-oriented"}'
KEPT = {
    "sweep": RUNS + "lyapunov = true\nstorey_drift = true\nfloor_acceleration = true\n",
    "along": RUNS.replace("[sweep]", '[sweep]\nalong = "omega"'),
    "vary": RUNS + "[vary]\nstructure.gap = [0.5, 1.5]\nstructure.stiffness_ratio = [100, 300]\n",
    "points": POINTS,
    "refined": POINTS.replace('"points"', '"points"\nrefine = {levels = 2, wrong = 0.2}')
    .replace("count = 2", "count = 9")
    .replace("count = 6", "count = 9")
    .replace("lyapunov_spectrum = true", "poincare = false"),
    "seeds": STOPS
    + "[sweep]\nomega = [0.9, 1.0]\namplitude = {from = 0.3, to = 0.7, count = 5}\n"
    + "transient_cycles = 100\nsampling_cycles = 8\n",
    "attractors": '[study]\nkind = "attractors"\nstarts = 8\nmax_attractors = 4\nmax_cycles = 600\n'
    + f"{STOPS}[sweep]\nomega = [0.9, 1.0]\namplitude = [0.6, 0.7]\n[output]\nmax_points = 32\n",
    "basins": BASINS,
    "refined-basins": BASINS.replace('"basins"', '"basins"\nrefine = {levels = 2, wrong = 0.2}')
    .replace("count = 5", "count = 9")
    .replace("count = 4", "count = 9"),
    "branches": '[study]\nkind = "branches"\n[branches]\nseeds = "seeds.h5"\nsteps = 300\n'
    + f"max_points = 2000\n{STOPS}[sweep]\nomega = 1.0\namplitude = [0.3, 0.5, 0.7]\n",
    "yielding": RUNS.replace(
        "damping_ratio = 0.05", "yield_drift = 0.3\nhardening = 0.05\ngap = 1.5"
    ).replace("sharpness = 4e3", "sharpness = inf"),
    "records": RECORDS,
    "yielding-records": RECORDS.replace(
        "storey_height", "yield_drift = 0.01\nhardening = 0.02\nstorey_height"
    ).replace("history = 0.1", "energy = true"),
    "degrading-records": RECORDS.replace(
        "storey_height", f"yield_drift = 0.01\ncollapse_drift = 0.25\n{BACKBONE}\nstorey_height"
    ),
}
"""Jobs by the names of their files; `branches` reads `seeds`."""


def keep(name: str) -> None:
    """Write a results file, packed but for one, unless it would have the same in it."""
    from tools import made

    from hpcsweep.store import pack

    path, new = Path(f"{name}.h5"), Path(f"{name}.h5.new")
    made(KEPT[name], new)
    Path(f"{new}.journal").unlink()
    if name != "seeds":
        pack(new)
    differs = contents(path) != contents(new)
    new.replace(path) if differs else new.unlink()
    print(f"{path}: {path.stat().st_size} bytes{'' if differs else ', as before'}", flush=True)


def contents(path: Path) -> dict[str, object]:
    """Return what does not depend on when, where and with which libraries a file was written."""
    if not path.exists():
        return {}
    with h5py.File(path) as file:
        said = ("fingerprint", "layout_version", "resolved_job", "variables", "derived")
        held: dict[str, object] = {key: str(file.attrs.get(key)) for key in said}
        for name, data in file.items():
            notes = {k: str(v) for k, v in data.attrs.items() if not k.isupper()}
            held[name] = data[...].tobytes() if data.dtype != object else [*data.asstr()[...].flat]
            held[f"{name}:"] = [data.dtype, data.shape, notes]
    return held


def shown() -> dict[str, str]:
    """Return the texts of the jobs of guides and gallery, which are whole, and of jobs/."""
    from test_blocks import PAGES, blocks, completed, merge, write

    from hpcsweep.job import load_job

    texts = {}
    for page in PAGES:
        whole: dict = {}
        for number, block in enumerate(blocks(page.read_text(), "toml")):
            tree = tomllib.loads(block)
            is_more = set(tree) == {"vary"} and "pounding" in whole
            whole = merge(whole, tree) if is_more else completed(tree)
            if "extends" not in tree:
                texts[f"{page.stem}-{number}"] = write(whole, {})
    for path in sorted((ROOT / "docs" / "gallery").glob("*.py")):
        for number, text in enumerate(re.findall(r'\("""\\\n(.*?)"""', path.read_text(), re.S)):
            if "extends" not in tomllib.loads(text):
                texts[f"{path.stem}-{number}"] = text
    for path in sorted((ROOT / "jobs").rglob("*.toml")):
        texts[str(path.relative_to(ROOT))] = load_job(path).text
    return texts


def keep_jobs() -> None:
    """Write the jobs with their fingerprints."""
    from hpcsweep.job import JobError, parse_job

    jobs = {}
    for name, text in shown().items():
        with contextlib.suppress(JobError):  # of files that are not kept
            job = parse_job(text, name, "job")
            jobs[name] = {"fingerprint": job.fingerprint, "text": text}
    Path("jobs.json").write_text(json.dumps(jobs, indent=1) + "\n")
    print(f"jobs.json: {len(jobs)} jobs")


if __name__ == "__main__":
    os.chdir(HERE)
    for each in sys.argv[1:] or [*KEPT, "jobs"]:
        keep_jobs() if each == "jobs" else keep(each)
