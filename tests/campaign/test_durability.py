"""Faults and signals: a share of the kill campaign, locks, launchers."""

import fcntl
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import faults
import kill_campaign
import numpy as np
import pytest
from test_campaign import refuse
from tools import SMALL, hpcsweep

from hpcsweep import Structure
from hpcsweep.parallel.stopping import LauncherLostError, Stop, StopFlag
from hpcsweep.solvers.solver import make_solver
from hpcsweep.store import Journal, Lock, StoreError
from hpcsweep.store import lock as lock_module

BDF = (
    SMALL.replace("transient_cycles = 30", "transient_cycles = 100000")
    .replace("count = 4}", "count = 2}")
    .replace("[output]", '[solver]\nmethod = "bdf"\nskip = "none"\n[output]')
)
"""Hours of work; no block is done before minutes have passed."""


@pytest.mark.slow
@pytest.mark.mpi
def test_a_share_of_the_kill_campaign(capsys):
    kinds = ["kill rank", "kill launcher", "kill twice", "term to launcher", "int to rank"]
    kinds += ["disk full", "truncated", "bit flipped", "orphaned rank"]
    chosen = [argument for kind in kinds for argument in ("--kind", kind)]
    code = kill_campaign.main(["--runs", str(len(kinds)), "--seed", "11", *chosen])
    printed = capsys.readouterr().out
    assert code == 0, printed
    assert f"{len(kinds)} of {len(kinds)} passed" in printed
    for kind in kinds:
        assert kind in printed


@pytest.mark.slow
def test_the_kill_campaign_sees_damage(tmp_path):
    """It must be able to fail: a block that was computed again, a value that differs."""
    job = tmp_path / "small.toml"
    job.write_text(SMALL)
    reference = kill_campaign.make_reference(job, tmp_path / "whole.h5")
    total = len(faults.valid(tmp_path / "whole.h5"))
    name = next(name for name, values in reference["datasets"].items() if values.size)
    reference["datasets"][name] = reference["datasets"][name] ^ 1
    (tmp_path / "run").mkdir()
    run = kill_campaign.Run("kill rank", "pwrite", 1, 3)
    patient = kill_campaign.Patient(run, job, tmp_path / "run", reference, total + 1)
    Path(f"{patient.path}.new").write_text("left by somebody else")
    Path(f"{patient.path}.other").write_text("left by somebody else")
    patient.go_on()
    said = " | ".join(run.problems)
    assert f"differs from the uninterrupted run in ['{name}']" in said
    assert f"{total} blocks computed, {total + 1} missing" in said
    assert "left behind: ['campaign.h5.other']" in said


def test_bdf_can_be_stopped_inside_a_long_forcing_period():
    structure = Structure(n_floors=2, stiffness_ratio=300.0, sharpness=4e3, damping_ratio=0.05)
    bdf = make_solver("bdf", structure, 0.01, 1e-9)
    calls = []

    def poll():
        calls.append(None)
        if len(calls) == 3:
            raise Stop

    with pytest.raises(Stop):
        bdf.advance(np.zeros(4), 0.5, 1, poll=poll)


def wait_for_start(process: faults.Processes, path: Path) -> None:
    deadline = time.monotonic() + 120
    while not any(record["kind"] == "start" for record in faults.records(path)):
        assert process.launcher.poll() is None, process.launcher.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize(
    ("ranks", "name", "victim"),
    [
        (0, "SIGUSR1", "launcher"),
        (2, "SIGTERM", "launcher"),
        pytest.param(2, "SIGINT", "launcher", marks=pytest.mark.slow),
        pytest.param(2, "SIGUSR1", "launcher", marks=pytest.mark.slow),
        pytest.param(3, "SIGUSR1", "rank", marks=pytest.mark.slow),
        pytest.param(3, "SIGINT", "rank", marks=pytest.mark.slow),
    ],
)
def test_a_long_bdf_sweep_stops_within_seconds(tmp_path, ranks, name, victim):
    job = tmp_path / "bdf.toml"
    job.write_text(BDF)
    path = tmp_path / "bdf.h5"
    process = faults.start(ranks, "run", job, "-o", path)
    try:
        wait_for_start(process, path)
        time.sleep(0.5)
        begun = time.monotonic()
        process.send(getattr(signal, name), victim, faults.random.Random(ranks))
        code, _, errors = process.finish()
        assert code == 75, errors
        assert time.monotonic() - begun < 10
        assert "run again to resume" in errors
        assert faults.records(path)[-1]["reason"] == name
        assert not Path(f"{path}.lock").exists()
    finally:
        process.end()


@pytest.mark.slow
@pytest.mark.mpi
def test_the_time_limit_stops_a_long_bdf_sweep(tmp_path):
    job = tmp_path / "bdf.toml"
    job.write_text(BDF)
    begun = time.monotonic()
    done = hpcsweep(2, "run", job, "-o", tmp_path / "bdf.h5", "--max-hours", 9 / 3600)
    assert done.returncode == 75, done.stderr
    assert time.monotonic() - begun < 25
    assert faults.records(tmp_path / "bdf.h5")[-1]["reason"] == "time limit"


def test_a_signal_to_a_campaign_that_still_loads_its_libraries_is_obeyed(tmp_path, small_job):
    script = tmp_path / "early.py"
    script.write_text(
        "import os, signal, sys\n"
        "from hpcsweep import job; from hpcsweep.commands import cli\n"
        "load = job.load_job\n"
        "def load_job(*arguments):\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    return load(*arguments)\n"
        "job.load_job = load_job\n"
        "if __name__ == '__main__':  # not in a process that compiles\n"
        "    sys.exit(cli.main(sys.argv[1:]))\n"
    )
    done = subprocess.run(
        [sys.executable, script, "run", small_job, "-o", tmp_path / "small.h5"],
        env={**os.environ, "PYTHONPATH": str(faults.ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 75, done.stderr
    assert "SIGTERM before the first run; run again to resume" in done.stderr
    assert faults.committed(tmp_path / "small.h5") == set()
    assert hpcsweep(0, "run", small_job, "-o", tmp_path / "small.h5").returncode == 0


def test_ranks_do_not_outlive_their_launcher(monkeypatch):
    flag = StopFlag(launched=True)
    assert not flag.is_set()
    monkeypatch.setattr(os, "getppid", lambda: 1)
    assert flag.is_set()
    assert flag.reason == "the launcher died"
    monkeypatch.setattr("hpcsweep.parallel.stopping.LOST_GRACE", -1.0)
    with pytest.raises(LauncherLostError):
        flag.is_set()
    alone = StopFlag(launched=False)
    assert not alone.is_set()


HOLDER = """
import fcntl, os, sys, time
descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
fcntl.lockf(descriptor, fcntl.LOCK_SH, 1, int(sys.argv[2]))
print("held", flush=True)
time.sleep(60)
"""


def hold(path: Path, byte: int) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, path, str(byte)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    return process


def test_an_orphaned_rank_is_waited_for_and_named(tmp_path):
    path = tmp_path / "a.h5"
    first = Lock(path)
    first.acquire(4)
    first.release()
    orphan = hold(first.path, lock_module.RANKS_BYTE)
    try:
        with pytest.raises(StoreError) as refused:
            Lock(path).acquire(2, wait=0.1)
        assert f"process {orphan.pid}, of the campaign of process {os.getpid()}" in str(
            refused.value
        )
        assert "4 ranks" in str(refused.value)
    finally:
        orphan.kill()
        orphan.communicate()
    second = Lock(path)
    second.acquire(2, wait=5.0)
    second.release(remove=True)
    assert not second.path.exists()


def test_a_campaign_through_a_link_has_the_lock_and_the_journal_of_the_file(small_job, tmp_path):
    path, link = tmp_path / "a.h5", tmp_path / "other" / "link.h5"
    link.parent.mkdir()
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    link.symlink_to(path)
    assert Lock(link).path == Lock(path).path
    assert Journal(link).path == Journal(path).path
    assert Journal(path).path.exists()
    (tmp_path / "a.h5.lock").touch()
    holder = hold(tmp_path / "a.h5.lock", lock_module.MASTER_BYTE)
    try:
        done = hpcsweep(0, "run", small_job, "-o", link)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert "another campaign is running on it" in done.stderr
    finally:
        holder.kill()
        holder.communicate()


@pytest.mark.parametrize("text", ["", "not JSON", '{"pid": 1}', "[1, 2]", "\0" * 9])
def test_a_lock_file_left_behind_locks_nothing_whatever_it_says(tmp_path, text):
    path = tmp_path / "a.h5"
    (tmp_path / "a.h5.lock").write_text(text)
    lock = Lock(path)
    lock.acquire(1, wait=0.0)
    assert f'"pid": {os.getpid()}' in lock.path.read_text()
    lock.release(remove=True)
    holder = hold(lock.path, lock_module.MASTER_BYTE)
    lock.path.write_text(text)
    try:
        with pytest.raises(StoreError, match="another campaign is running on it"):
            Lock(path).acquire(1)
    finally:
        holder.kill()
        holder.communicate()


def test_without_locks_the_lock_file_is_the_lock_and_the_remedy_is_told(tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError(lock_module.errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "lockf", unsupported)
    path = tmp_path / "a.h5"
    first = Lock(path)
    first.acquire(3)
    first.join()
    with pytest.raises(StoreError) as refused:
        Lock(path).acquire(1)
    assert f"process {os.getpid()}" in str(refused.value)
    assert f"if it is gone, remove {path}.lock" in str(refused.value)
    first.release(remove=True)
    Lock(path).acquire(1)


def test_a_second_campaign_is_refused_and_writes_nothing(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    lock = Lock(path)
    lock.acquire(7)
    refused = hpcsweep(0, "run", small_job, "-o", path)
    refuse(refused, "small.h5", "another campaign", f"process {os.getpid()} on", "7 ranks, since 2")
    lock.release(remove=True)
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    "variable",
    ["OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS", "PMI_SIZE"],
)
def test_a_launcher_that_mpi_does_not_know_is_refused_with_the_remedy(
    tmp_path, small_job, variable
):
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **{variable: "3"})
    refuse(done, "started 3 ranks", "sees 1", "mpirun", "srun --mpi=pmi2")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["small.toml"]


def test_mpich_under_open_mpis_launcher_is_refused_before_it_ends_the_process(tmp_path, small_job):
    place = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"}
    meeting = {"PMIX_NAMESPACE": "1", "PMIX_RANK": "0", "PMIX_SERVER_URI4": "none"}
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **place, **meeting)
    refuse(done, "started 2 ranks", "sees 1", "mpirun")
    silent = {**place, "OMPI_COMM_WORLD_RANK": "1"}
    done = hpcsweep(0, "run", small_job, cwd=tmp_path, **silent, **meeting)
    assert (done.returncode, done.stderr) == (2, "")


def test_no_room_for_the_file_is_one_line_and_leaves_nothing(tmp_path, small_job):
    process = faults.start(0, "run", small_job, "-o", tmp_path / "a.h5", file_limit=4096)
    code, _, errors = process.finish()
    assert code == 2
    assert errors.splitlines() == [
        f"hpcsweep: error: {tmp_path / 'a.h5'}: cannot be created: File too large"
    ]
    assert [p.name for p in tmp_path.iterdir()] == ["small.toml"]
