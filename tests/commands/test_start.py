"""What a command loads: who reads results does not wait for kernels and integrators."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tools import ROOT, SMALL, environment, hpcsweep, run_script

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


COMPLETED = """
eval "$(python -m hpcsweep --print-completion bash)"
for words in "hpcsweep de" "hpcsweep plot --kind or" "hpcsweep run sm" "hpcsweep run --re"; do
    COMP_WORDS=($words) COMP_CWORD=$(($(wc -w <<<"$words") - 1))
    _shtab_hpcsweep hpcsweep "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
    echo "${COMPREPLY[*]}"
done
"""


def test_a_shell_completes_commands_options_words_and_files(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", COMPLETED],
        cwd=tmp_path,
        env=environment(PATH=path, PYTHONPATH=str(ROOT)),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == ["describe", "orbit", "small.toml", "--reuse"], done.stderr


def test_a_quiet_run_says_how_it_ends_alone(small_job):
    done = hpcsweep(0, "run", "--quiet", small_job, "-o", small_job.with_suffix(".h5"))
    assert done.stdout + done.stderr == f"{small_job.with_suffix('.h5')}: complete\n"


FIVE = """
import sys
for name in ("h5netcdf", "matplotlib", "pandas", "PIL", "shtab", "tqdm", "xarray"):
    sys.modules[name] = None  # as if it were not installed
from hpcsweep.commands import cli
sys.exit(cli.main())
"""


@pytest.mark.slow
@pytest.mark.mpi
def test_five_libraries_suffice_to_compute(tmp_path):
    """numpy, scipy, numba, h5py and mpi4py are what a compute node needs."""
    script, job = tmp_path / "five.py", tmp_path / "small.toml"
    script.write_text(FIVE)
    job.write_text(SMALL)

    def said(*arguments, ranks=0, code=0) -> str:
        done = run_script(ranks, script, *arguments, cwd=tmp_path)
        assert done.returncode == code, done.stderr
        return done.stdout + done.stderr

    assert "88 runs" in said("describe", job)
    said("split", job, "-n", 2)
    for part in (1, 2):
        said("run", f"small-{part}of2.toml", ranks=2)
    said("merge", "small-1of2.h5", "small-2of2.h5", "-o", "small.h5")
    assert "complete" in said("status", "small.h5")
    assert "sound" in said("validate", "small.h5", "--samples", 2)
    said("pack", "small.h5", "-o", "packed.h5")
    needed = "hpcsweep: error: needs xarray, which is not installed: pip install xarray\n"
    for command in ("summary", "plot", "explore"):
        assert said(command, "packed.h5", code=2) == needed, command
    assert "needs pandas, which is not installed" in said("table", "packed.h5", code=2)
    needed = needed.replace("xarray", "matplotlib")
    for ranks in (0, 2):
        assert needed in said("animate", "packed.h5", ranks=ranks, code=2)
