"""The exercises of docs/extending.md: each is applied to a copy of the program, run and checked."""

import json
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest
from tools import RECORDS, ROOT, SMALL, assert_same_datasets, environment, mpirun

pytestmark = pytest.mark.slow
EXERCISES = ROOT / "docs" / "exercises"


@pytest.fixture
def copy(tmp_path):
    """Return what copies the program, applies an exercise to it, and runs its commands."""
    folder = tmp_path / "copy"

    def applied(name: str):
        ignored = shutil.ignore_patterns("__pycache__")
        for part in ("hpcsweep", "jobs", "tests/job", "tests/support", "benchmarks/reference"):
            shutil.copytree(ROOT / part, folder / part, ignore=ignored)
        subprocess.run(["git", "apply", EXERCISES / f"{name}.diff"], cwd=folder, check=True)

        path = [folder, folder / "tests/support", folder / "benchmarks/reference"]

        def run(*arguments, ranks=0, code=0) -> str:
            launcher = [mpirun(), "-n", str(ranks)] if ranks else []
            done = subprocess.run(
                [*launcher, sys.executable, *map(str, arguments)],
                cwd=folder,
                env=environment(PYTHONPATH=":".join(map(str, path))),
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == code, done.stdout + done.stderr
            return done.stdout

        def hpcsweep(*arguments, **options) -> str:
            return run("-m", "hpcsweep", *arguments, **options)

        assert run("-c", "import hpcsweep; print(hpcsweep.__file__)").startswith(str(folder))
        return folder, hpcsweep, run

    return applied


def test_a_figure(copy):
    folder, hpcsweep, _ = copy("figure")
    (folder / "small.toml").write_text(SMALL)
    hpcsweep("run", "small.toml")
    assert "forcing periods integrated, against the amplitude" in hpcsweep("plot", "--help")
    hpcsweep("plot", "small.h5", "--kind", "cycles", "--omega", "0.6", "-o", "cycles.png")
    assert (folder / "cycles.png").stat().st_size > 10_000


def test_a_key_of_a_job_is_one_file(copy):
    touched = (EXERCISES / "key.diff").read_text().count("--- a/")
    assert touched == 1
    folder, hpcsweep, run = copy("key")
    hpcsweep("new", "new.toml")
    assert "#every = 1\n" in (folder / "new.toml").read_text()
    for number, given in enumerate(("", "every = 2\n", "every = 0\n", "evry = 2\n")):
        job = SMALL.replace("[sweep]\n", f"[sweep]\n{given}")
        (folder / f"{number}.toml").write_text(job)
    hpcsweep("run", "0.toml")
    hpcsweep("run", "1.toml", ranks=2)
    frames = [json.loads(hpcsweep("summary", f"{k}.h5", "--json"))[0]["frames"] for k in (0, 1)]
    assert frames == [4, 2]
    refused = (
        "import sys, hpcsweep\n"
        "try: hpcsweep.load_job(sys.argv[1])\n"
        "except ValueError as error: print(error)"
    )
    said = run("-c", refused, "2.toml")
    assert said.strip().endswith("sweep.every = 0: must be a whole number from 1 to 1000")
    assert "did you mean 'every'?" in run("-c", refused, "3.toml")


FEW = SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 2")
FEW = FEW.replace("= 30", "= 3").replace("= 20", "= 12")
"""What plain Python does in seconds: kernels are compiled anew where their constants change."""


def test_a_metric_of_sweeps_and_records_is_one_file(copy, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert (EXERCISES / "metric.diff").read_text().count("--- a/") == 1
    folder, hpcsweep, _ = copy("metric")
    names = ("impact_impulse", "impulse", "impacts")
    asked = "".join(f"{name} = true\n" for name in names)
    (folder / "swept.toml").write_text(FEW.replace("[output]\n", f"[output]\n{asked}"))
    few = RECORDS.replace("count = 4", "count = 2").replace("count = 5", "count = 2")
    (folder / "shaken.toml").write_text(few)
    for name in ("swept", "shaken"):
        hpcsweep("run", f"{name}.toml", ranks=2)
        assert "sound" in hpcsweep("validate", f"{name}.h5", "--samples", "3")
        with h5py.File(folder / f"{name}.h5") as file:
            mean, whole, closings = (file[each][...] for each in names)
            assert file["impact_impulse"].attrs["units"] == file["impulse"].attrs["units"]
        closed = closings > 0
        assert closed.any()
        np.testing.assert_allclose(mean[closed], whole[closed] / closings[closed], rtol=1e-14)
        assert (mean[~closed] == 0).all()
        largest = json.loads(hpcsweep("summary", f"{name}.h5", "--json"))[0]["largest"]
        assert largest["impact_impulse"]["value"] == mean.max()
    hpcsweep("plot", "swept.h5", "--kind", "measures", "--omega", "0.6", "-o", "measures.png")


JERKS = """
import math, numpy as np, hpcsweep
from hpcsweep.model.observed import MOTIONS
from hpcsweep.solvers.linear import LinearOrbit
from hpcsweep.solvers.solver import make_solver
from scipy.integrate import solve_ivp

free = hpcsweep.Structure(1, stiffness_ratio=0.0, damping_ratio=0.0)
one = hpcsweep.response(free, hpcsweep.Record([1.0, 1.0], dt=4.0))  # u = cos t - 1
assert abs(one.floor_jerk[0] - 1.0) < 1e-12
samples = hpcsweep.response(free, hpcsweep.Record([1.0, 1.0], dt=4.0), at_samples=True)
assert math.isnan(samples.floor_jerk[0]) and samples.floor_acceleration[0] > 1.6

flag = {each.name: each.flag for each in MOTIONS}["floor_jerk"]
omega, size = 0.55, 0.6
orbit = LinearOrbit(hpcsweep.Structure(2, 0.0, damping_ratio=0.05), omega)
seen = make_solver("flow", orbit._structure, omega, 1e-10).observe(
    orbit.state(size), size, 1, measures=flag
)
np.testing.assert_allclose(
    seen.measures.floor_jerk, orbit.measures(size).floor_jerk, rtol=1e-11
)

for sharpness in (math.inf, 100.0):
    stop = hpcsweep.Structure(2, 30.0, sharpness, 0.05)
    seen = make_solver("flow", stop, omega, 1e-10).observe([0.0] * 4, size, 1, measures=flag)
    assert seen.contact

    def push(x):
        if sharpness == math.inf:
            return 30.0 * np.maximum(x, 0.0)
        return 30.0 * x / (1.0 + np.exp(-sharpness * x))

    def rate(t, z):
        own = -stop.stiffness_matrix @ z[:2] - stop.damping_matrix @ z[2:] - push(z[:2] - 1.0)
        return np.concatenate((z[2:], own - size * math.sin(omega * t)))

    period = 2.0 * math.pi / omega
    done = solve_ivp(
        rate, (0.0, period), [0.0] * 4, "DOP853", dense_output=True, rtol=1e-11, atol=1e-12,
        max_step=period / 2000,
    )
    t = np.linspace(0.0, period, 40001)
    ground = size * np.sin(omega * t)[:, None]
    absolute = np.array([rate(*at)[2:] for at in zip(t, done.sol(t).T)]) + ground
    jerk = np.abs(np.diff(absolute, axis=0)).max(axis=0) / t[1]
    np.testing.assert_allclose(seen.measures.floor_jerk, jerk, rtol=2e-3)
print("right")
"""


def test_a_peak_is_two_files(copy, monkeypatch):
    """The largest jerk of each floor, in all that marches; in plain Python, as of any kernel."""
    assert (EXERCISES / "peak.diff").read_text().count("--- a/") == 2
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    folder, hpcsweep, run = copy("peak")
    assert run("-c", JERKS).endswith("right\n")
    job = FEW.replace("[output]\n", "[output]\nfloor_jerk = true\n")
    (folder / "swept.toml").write_text(job)
    hpcsweep("run", "swept.toml")
    with h5py.File(folder / "swept.h5") as file:
        assert file["floor_jerk"].attrs["units"] == "gaps omega_0^2 omega_0"
        assert (file["floor_jerk"][...] > 0).all()
    assert "floor_jerk" in json.loads(hpcsweep("summary", "swept.h5", "--json"))[0]["largest"]


def test_a_field_of_the_structure(copy):
    folder, hpcsweep, run = copy("field")
    job = SMALL.replace("damping_ratio = 0.05", "damping_ratio = 0.05\nretardation = 0.3")
    (folder / "damped.toml").write_text(job)
    (folder / "small.toml").write_text(SMALL)
    hpcsweep("run", "damped.toml")
    hpcsweep("run", "small.toml")
    assert "sound" in hpcsweep("validate", "damped.h5")
    # the file of a job without the field is not that of a job with it
    hpcsweep("run", "damped.toml", "-o", "small.h5", code=2)
    said = run(
        "-c",
        "import numpy as np, hpcsweep\n"
        "from reference import reference_points\n"
        "s = hpcsweep.Structure(2, 300.0, 4e3, 0.05, retardation=0.3)\n"
        "z = [0.9, 0.8, 1.0, 0.5]\n"
        "own = hpcsweep.stroboscopic_points(s, 0.3, 0.6, z, 1)\n"
        "print(abs(own - reference_points(s, 0.3, 0.6, z, 1)).max())\n",
    )
    assert float(said) < 1e-12
    run(
        "-m", "pytest", "-q", "tests/job/test_job.py", "-k", "fingerprint", "-p", "no:cacheprovider"
    )


def test_a_forcing(copy):
    folder, hpcsweep, run = copy("forcing")
    job = SMALL.replace("count = 4", "count = 2")
    (folder / "square.toml").write_text(f"{job}\n[forcing]\nsquare = 8\n")
    hpcsweep("run", "square.toml", ranks=2)
    assert "sound" in hpcsweep("validate", "square.h5")
    assert "harmonics 1, 3, 5, 7, 9, 11, 13, 15" in hpcsweep("summary", "square.h5")
    said = run(
        "-c",
        "import numpy as np, hpcsweep\n"
        "from hpcsweep.job import load_job\n"
        "from reference import reference_points\n"
        "s = load_job('square.toml').study.structure\n"
        "x = np.linspace(0.2, 2.9, 50)\n"
        "wave = [sum(a * np.sin(h * t + p) for h, a, p in s.forcing.terms) for t in x]\n"
        "print(abs(np.array(wave) - 1).max())\n"
        "own = hpcsweep.stroboscopic_points(s, 1.0, 0.6, [0.0] * 4, 5)\n"
        "print(abs(own - reference_points(s, 1.0, 0.6, [0.0] * 4, 5)).max(), own.max())\n",
    )
    ripple, error, highest = map(float, said.split())
    assert ripple < 0.2
    assert highest > 1.0  # there was contact
    assert error < 1e-11
    (folder / "square.toml").write_text(f"{job}\n[forcing]\nsquare = 0\n")
    hpcsweep("run", "square.toml", "-o", "none.h5", code=2)


def test_an_element(copy):
    """A spring that hardens moves as one between two contacts of the reference."""
    _, _, run = copy("element")
    said = run(
        "-c",
        "import numpy as np, hpcsweep\n"
        "from hpcsweep.model.hardening import Hardening\n"
        "from yielding import Yielding\n"
        "mass, k = np.eye(2), np.array([[3.0, -1.0], [-1.0, 1.5]])\n"
        "hard, row = Hardening((-1.0, 1.0), 20.0, 10.0), np.array([-1.0, 1.0])\n"
        "s = hpcsweep.Structure.from_matrices(mass, k, [], damping=0.05 * k, sliders=[hard])\n"
        "record = hpcsweep.Record(np.random.default_rng(1).standard_normal(60) * 4, dt=0.1)\n"
        "found, seen = hpcsweep.response(s, record), hpcsweep.history(s, record)\n"
        "stops = [hpcsweep.Contact(side * row, 0.5, 20.0) for side in (1, -1)]\n"
        "reference = Yielding(mass, k, 0.05 * k, stops, [])\n"
        "print(abs(found.final_state - reference.run(record.acceleration, 0.1)).max())\n"
        "d = seen.displacement @ row\n"
        "force = np.sign(d) * 20 * np.maximum(abs(d) - 0.5, 0)\n"
        "print(abs(seen.slider_force[:, 0] - force).max(), abs(force).max())\n",
    )
    state, force, largest = map(float, said.split())
    assert state < 1e-12
    assert force < 1e-12
    assert largest > 1.0


def test_a_solver(copy):
    folder, hpcsweep, _ = copy("solver")
    few = SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 3")
    (folder / "radau.toml").write_text(f'{few}\n[solver]\nmethod = "radau"\n')
    hpcsweep("run", "radau.toml", ranks=2)
    (folder / "flow.toml").write_text(few)
    hpcsweep("run", "flow.toml")
    reported = [json.loads(hpcsweep("summary", f"{k}.h5", "--json"))[0] for k in ("radau", "flow")]
    assert [one["runs_done"] for one in reported] == [12, 12]
    assert reported[0]["contact_sets"] == reported[1]["contact_sets"]
    assert "sound" in hpcsweep("validate", "radau.h5", "--samples", "3")


def test_a_study(copy):
    folder, hpcsweep, _ = copy("study")
    job = SMALL.replace("block = 4", "")
    (folder / "along.toml").write_text(f'{job}\n[study]\nkind = "frequency_sweep"\n')
    hpcsweep("run", "along.toml", ranks=2)
    hpcsweep("run", "along.toml", "-o", "alone.h5")
    assert_same_datasets(folder / "along.h5", folder / "alone.h5")
    state = json.loads(hpcsweep("status", "along.h5", "--json"))
    assert state["complete"]
    assert state["study"] == "frequency_sweep"
    assert "sound" in hpcsweep("validate", "along.h5", "--samples", "3")
    hpcsweep("plot", "along.h5", "--kind", "map", "-o", "map.png")
    reported = json.loads(hpcsweep("summary", "along.h5", "--json"))[0]
    assert reported["runs_done"] == reported["runs_total"] == 88
    assert (reported["frames"], reported["amplitudes"], reported["directions"]) == (
        4,
        11,
        ["up", "down"],
    )
