"""What a command loads: who reads results does not wait for kernels and integrators."""

import json
import shutil
import subprocess
import sys

import pytest
from tools import SMALL, environment, hpcsweep

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
for arguments in json.loads(sys.argv[1]):
    try:
        code = cli.main(arguments)
    except SystemExit as end:
        code = end.code
    print(json.dumps([code, *sys.modules]))
"""


def loaded_by(*commands: tuple, cwd=None) -> list[set[str]]:
    """Run commands one after the other in one process; give the modules loaded after each."""
    asked = json.dumps([[str(word) for word in command] for command in commands])
    done = subprocess.run(
        [sys.executable, "-c", LOADED, asked],
        cwd=cwd,
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    told = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[0, ")]
    assert len(told) == len(commands), done.stdout
    return [set(modules) for _, *modules in told]


def loaded(*arguments: object, cwd=None) -> set[str]:
    """Modules that a command has loaded."""
    return loaded_by(arguments, cwd=cwd)[0]


def test_a_command_that_computes_nothing_loads_nothing_that_computes(tmp_path, results):
    shutil.copy(results, tmp_path)
    *without_scipy, with_options_of_figures = loaded_by(
        ["--help"],
        ["new", "job.toml"],
        ["status", RESULTS],
        ["status", RESULTS, "--job"],
        ["validate", RESULTS, "--samples", "0"],
        ["plot", "--help"],
        cwd=tmp_path,
    )
    assert not with_options_of_figures & (COMPUTES | DRAWS)
    assert "scipy" not in without_scipy[-1]


@pytest.mark.slow
def test_a_run_loads_kernels_of_its_solver_without_what_would_compile_them(tmp_path, small_job):
    arguments = ("run", small_job, "-o", tmp_path / "out.h5")
    assert hpcsweep(0, *arguments).returncode == 0  # compiles them where they are not yet
    (tmp_path / "out.h5").unlink()
    modules = loaded(*arguments)
    assert {"numba", "hpcsweep.solvers.flow"} <= modules
    assert not modules & (COMPILES | DRAWS | {"scipy.integrate", "hpcsweep.solvers.bdf"})


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
    assert not loaded(*arguments, cwd=tmp_path) & COMPUTES


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
    modules = loaded("run", job, "-o", tmp_path / "out.h5")
    studies = {name for name, study in KINDS.items() if study.__module__ in modules}
    assert studies == {DEFAULT_KIND}
    assert f"hpcsweep.solvers.{method}" in modules
