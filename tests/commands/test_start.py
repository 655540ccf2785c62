"""What a command loads: who reads results does not wait for kernels and integrators."""

import json
import shutil
import subprocess
import sys

import pytest
from tools import JOBS, SMALL, environment, hpcsweep

from hpcsweep.studies.kinds import DEFAULT_KIND, KINDS

COMPUTES = {"numba", "llvmlite", "scipy.integrate", "hpcsweep.solvers.flow", "hpcsweep.solvers.bdf"}
DRAWS = {"matplotlib", "xarray"}
COMPILES = {"numba.np.random.generator_methods", "numba.np.polynomial.polynomial_core"}
"""Of all that numba loads before it compiles."""
RESULTS = "results.h5"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small file of results."""
    folder = tmp_path_factory.mktemp("start")
    (folder / "small.toml").write_text(SMALL)
    done = hpcsweep(0, "run", folder / "small.toml", "-o", folder / RESULTS)
    assert done.returncode == 0, done.stderr
    return folder / RESULTS


LOADED = """
import json, sys
from hpcsweep.commands import cli
try:
    code = cli.main(sys.argv[1:])
except SystemExit as end:
    code = end.code
print(json.dumps([code, *sys.modules]))
"""


def loaded(*arguments: object, cwd=None) -> tuple[int, set[str]]:
    """Exit code of a command, and the modules it has loaded."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *map(str, arguments)],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    code, *modules = json.loads(done.stdout.splitlines()[-1])
    return code, set(modules)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["status", RESULTS],
        ["status", RESULTS, "--job"],
        ["validate", RESULTS, "--samples", "0"],
        ["plot", "--help"],
        ["new", "job.toml"],
    ],
    ids=lambda arguments: " ".join(str(one).rsplit("/", 1)[-1] for one in arguments),
)
def test_a_command_that_computes_nothing_loads_nothing_that_computes(tmp_path, results, arguments):
    shutil.copy(results, tmp_path)
    code, modules = loaded(*arguments, cwd=tmp_path)
    assert code == 0
    assert not modules & (COMPUTES | DRAWS)
    assert "plot" in arguments or "scipy" not in modules


def test_a_run_loads_kernels_without_what_would_compile_them(tmp_path, small_job):
    arguments = ("run", small_job, "-o", tmp_path / "out.h5")
    assert hpcsweep(0, *arguments).returncode == 0  # compiles them where they are not yet
    (tmp_path / "out.h5").unlink()
    code, modules = loaded(*arguments)
    assert code == 0
    assert not modules & COMPILES


@pytest.mark.parametrize(
    "arguments",
    [
        ["summary", RESULTS],
        pytest.param(["plot", RESULTS, "-o", "one.png"], marks=pytest.mark.slow),
    ],
    ids=lambda one: one[0],
)
def test_results_are_read_and_drawn_without_what_computes(tmp_path, results, arguments):
    shutil.copy(results, tmp_path)
    code, modules = loaded(*arguments, cwd=tmp_path)
    assert code == 0
    assert not modules & COMPUTES


def test_a_run_loads_the_solver_of_its_job_and_no_other(tmp_path):
    job = tmp_path / "one.toml"
    job.write_text(f'extends = "{JOBS / "demo.toml"}"\nsweep.amplitude = 0.01\n')
    code, modules = loaded("run", job, cwd=tmp_path)
    assert code == 0
    assert {"numba", "hpcsweep.solvers.flow"} <= modules
    assert not modules & ({"scipy.integrate", "hpcsweep.solvers.bdf"} | DRAWS)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["flow", "bdf"])
def test_each_solver_runs_in_a_process_that_has_loaded_no_other(tmp_path, method):
    job = tmp_path / "job.toml"
    text = SMALL
    for old, new in (
        ("count = 11", "count = 2"),
        ("count = 4", "count = 2"),
        ("transient_cycles = 30", "transient_cycles = 1"),
        ("sampling_cycles = 20", "sampling_cycles = 1"),
        ("max_orbit_period = 6", "max_orbit_period = 1"),
    ):
        text = text.replace(old, new)
    job.write_text(f'{text}\n[solver]\nmethod = "{method}"\n')
    code, modules = loaded("run", job, "-o", tmp_path / "out.h5")
    assert code == 0
    studies = {name for name, study in KINDS.items() if study.__module__ in modules}
    assert studies == {DEFAULT_KIND}
    assert f"hpcsweep.solvers.{method}" in modules
