"""Campaigns as a user runs them: ranks, kills, signals, mistakes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import faults
import h5py
import numpy as np
import pytest
from tools import (
    JOBS,
    SMALL,
    assert_same_datasets,
    datasets,
    environment,
    fork,
    hpcsweep,
    refuse,
    run_script,
)

from hpcsweep.commands import cli


def long_job(cycles: int) -> str:
    """Write a job of 24 blocks that takes a second for each 4,000 to 5,000 cycles, on one core."""
    return SMALL.replace("transient_cycles = 30", f"transient_cycles = {cycles}").replace(
        "[output]", '[solver]\nskip = "none"\n[output]'
    )


LONG = long_job(30_000)
"""Not run to its end."""


def journal(path: Path, kind: str) -> list[dict]:
    lines = Path(f"{path}.journal").read_text().splitlines()
    return [record for record in map(json.loads, lines) if record["kind"] == kind]


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_sigterm_stops_in_good_order_within_seconds(tmp_path, ranks):
    job = tmp_path / "long.toml"
    job.write_text(LONG)
    path = tmp_path / "stopped.h5"
    process = faults.start(ranks, "run", job, "-o", path)
    assert faults.wait_for_commits(process, path, 1)
    begun = time.monotonic()
    for pid in process.ranks().values():
        os.kill(pid, signal.SIGTERM)
    code, _, errors = process.finish()
    assert time.monotonic() - begun < 10
    assert code == 75, errors
    assert "run again to resume" in errors
    assert journal(path, "end")[-1]["reason"] == "SIGTERM"
    assert not Path(f"{path}.lock").exists()


def test_time_limit_stops_in_good_order_and_the_next_run_goes_on(tmp_path):
    job = tmp_path / "long.toml"
    job.write_text(long_job(2_000))
    path = tmp_path / "limited.h5"
    stopped = hpcsweep(0, "run", job, "-o", path, "--max-hours", 0.1 / 3600)
    assert stopped.returncode == 75, stopped.stderr
    assert journal(path, "end")[-1]["reason"] == "time limit"
    done = len(faults.committed(path))
    assert hpcsweep(0, "run", job, "-o", path).returncode == 0
    assert len(faults.committed(path)) == 24 > done


def test_a_flipped_byte_is_not_believed_and_is_computed_again(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    whole = datasets(path)
    with h5py.File(path, "r") as file:
        offset = file["drift"].id.get_offset() + 8 * 15
    with path.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes([byte ^ 1]))
    from hpcsweep import open_results

    results = open_results(path)
    assert int((results["outcome"] == 0).sum()) == 4
    assert np.isnan(results["drift"].values.ravel()[15])
    before = len(journal(path, "block"))
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    assert len(journal(path, "block")) == before + 1
    for name, values in datasets(path).items():
        assert np.array_equal(values, whole[name]), name


def test_other_peoples_files_are_refused_and_left_alone(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    other = tmp_path / "other.toml"
    other.write_text(SMALL.replace("300.0", "301.0"))
    text = tmp_path / "text.h5"
    text.write_text("not HDF5")
    foreign = tmp_path / "foreign.h5"
    with h5py.File(foreign, "w") as file:
        file["x"] = 1
    newer = tmp_path / "newer.h5"
    newer.write_bytes(path.read_bytes())
    with h5py.File(newer, "r+") as file:
        file.attrs["layout_version"] = 99
    before = {file: file.read_bytes() for file in (path, text, foreign, newer)}
    refuse(hpcsweep(0, "run", other, "-o", path), "small.h5", "another job", "-o")
    refuse(hpcsweep(0, "run", small_job, "-o", text), "text.h5", "not an HDF5 file")
    refuse(hpcsweep(0, "run", small_job, "-o", foreign), "foreign.h5", "no results of hpcsweep")
    refuse(hpcsweep(0, "run", small_job, "-o", newer), "newer.h5", "layout version 99")
    refuse(hpcsweep(0, "run", small_job, "-o", tmp_path / "no" / "a.h5"), "does not exist")
    refuse(hpcsweep(0, "run", small_job, "-o", tmp_path), "is a folder")
    refuse(hpcsweep(0, "run", small_job, "-o", "/proc/a.h5"), "/proc/a.h5", "cannot be written")
    refuse(hpcsweep(0, "status", text), "not an HDF5 file")
    assert {file: file.read_bytes() for file in before} == before
    assert sorted(p.suffix for p in tmp_path.iterdir() if p.name.startswith("small")) == [
        ".h5",
        ".journal",
        ".toml",
    ]


@pytest.mark.mpi
def test_mistakes_under_mpirun_take_one_line_too(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text(SMALL.replace("300.0", "-1.0"))
    done = hpcsweep(2, "run", bad, cwd=tmp_path)
    assert done.returncode == 2
    ours = [line for line in done.stderr.splitlines() if "hpcsweep" in line]
    assert len(ours) == 1
    assert "structure.stiffness_ratio" in ours[0]
    assert "Traceback" not in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["bad.toml"]


def test_a_second_campaign_on_the_file_is_refused_and_told_who_holds_it(tmp_path):
    job = tmp_path / "long.toml"
    job.write_text(LONG)
    path = tmp_path / "long.h5"
    first = fork(lambda: cli.main(["run", str(job), "-o", str(path)]))
    try:
        while not any(record["kind"] == "start" for record in faults.records(path)):
            assert os.waitpid(first, os.WNOHANG) == (0, 0)
            time.sleep(0.01)
        # it holds its lock for as long as the second needs
        os.kill(first, signal.SIGSTOP)
        holder = f"process {first}"
        refuse(hpcsweep(0, "run", job, "-o", path), "another campaign", holder, "rank")
    finally:
        os.kill(first, signal.SIGKILL)
        os.waitpid(first, 0)


@pytest.mark.mpi
def test_an_exception_on_a_worker_ends_the_job_with_one_traceback(tmp_path, small_job):
    script = tmp_path / "broken.py"
    script.write_text(
        "import sys\n"
        "from hpcsweep.commands import cli\n"
        "from hpcsweep.studies.sweep.runs import FrameRuns\n"
        "from hpcsweep.parallel import mpi\n"
        "good = FrameRuns.follow\n"
        "def broken(*a, **k):\n"
        "    if mpi.launched_rank() == 1:\n"
        "        raise RuntimeError('the worker broke')\n"
        "    return good(*a, **k)\n"
        "FrameRuns.follow = broken\n"
        "if __name__ == '__main__':  # not in a process that compiles\n"
        "    sys.exit(cli.main(sys.argv[1:]))\n"
    )
    done = run_script(2, script, "run", small_job, "-o", tmp_path / "b.h5")
    assert done.returncode not in (0, 2, 75)
    assert done.stderr.count("Traceback") == 1
    assert "the worker broke" in done.stderr
    assert "on rank 1" in done.stderr


def test_status_of_a_finished_file(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    state = json.loads(hpcsweep(0, "status", path, "--json").stdout)
    assert state["complete"]
    assert state["runs_done"] == state["runs_total"] == 88
    assert state["frames_done"] == 4
    assert state["n_failed"] == 0
    assert "complete" in hpcsweep(0, "status", path).stdout


def test_dry_run_writes_nothing_and_tells_the_cost(tmp_path, small_job):
    done = hpcsweep(0, "run", small_job, "--dry-run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for word in ("88 runs", "MB", "core-hours", "ranks"):
        assert word in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["small.toml"]


@pytest.mark.mpio
@pytest.mark.mpi
def test_h5py_mpio_writes_the_same_bytes_and_survives_a_kill(tmp_path):
    assert h5py.get_config().mpi, "this h5py was built without MPI"
    job = JOBS / "ci.toml"
    for name, ranks, transport in (("a", 0, ""), ("b", 2, "mpio"), ("c", 3, "mpio")):
        done = hpcsweep(
            ranks, "run", job, "-o", tmp_path / f"{name}.h5", HPCSWEEP_TRANSPORT=transport
        )
        assert done.returncode == 0, done.stderr
    done = hpcsweep(2, "run", job, "-o", tmp_path / "d.h5", HPCSWEEP_TRANSPORT="offset")
    assert done.returncode == 0, done.stderr
    used = [journal(tmp_path / f"{name}.h5", "start")[0]["transport"] for name in "abcd"]
    assert used == ["pwrite", "mpio", "mpio", "offset"]
    for name in "bcd":
        assert_same_datasets(tmp_path / "a.h5", tmp_path / f"{name}.h5")
    long = tmp_path / "long.toml"
    long.write_text(long_job(10_000))
    assert hpcsweep(0, "run", long, "-o", tmp_path / "whole.h5").returncode == 0
    path = tmp_path / "killed.h5"
    process = faults.start(2, "run", long, "-o", path)
    assert faults.wait_for_commits(process, path, 4)
    os.kill(process.ranks()[1], signal.SIGKILL)
    code, _, _ = process.finish()
    assert code not in (None, 0)
    assert journal(path, "start")[0]["transport"] == "mpio"
    assert hpcsweep(2, "run", long, "-o", path).returncode == 0
    assert_same_datasets(tmp_path / "whole.h5", path)


def test_help_and_version():
    shown = hpcsweep(0, "--help").stdout
    for word in ("run", "status", "plot", "exit codes", "mpirun"):
        assert word in shown
    version = hpcsweep(0, "--version").stdout
    assert version.startswith("hpcsweep ")
    assert "numba" in version
    refuse(hpcsweep(0, "rnu"), "rnu")
    assert sys.version_info >= (3, 11)


def test_a_rank_has_one_thread_of_linear_algebra():
    program = (
        "import hpcsweep.commands.cli, os\n"
        "import numpy as np, scipy.linalg\n"
        "a = np.eye(600)\n"
        "a @ a, scipy.linalg.blas.dgemm(1.0, a, a)\n"
        "print(len(os.listdir('/proc/self/task')))\n"
    )
    env = {k: v for k, v in environment().items() if not k.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**env, "PYTHONPATH": str(JOBS.parent)},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert done.stdout.split() == ["1"]


def test_a_new_file_does_not_go_on_with_the_journal_of_one_that_is_gone(tmp_path):
    job, path = tmp_path / "job.toml", tmp_path / "out.h5"
    sessions = []
    for count in (4, 2):
        job.write_text(SMALL.replace("count = 4", f"count = {count}"))
        assert hpcsweep(0, "run", job, "-o", path).returncode == 0
        state = json.loads(hpcsweep(0, "status", path, "--json").stdout)
        sessions.append(len(state["sessions"]))
        path.unlink()
    assert sessions == [1, 1]
