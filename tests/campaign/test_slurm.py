"""The batch scripts of slurm/ on a real Slurm; without one these tests fail, they never skip."""

import contextlib
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from slurm_cluster import Cluster, SlurmError, edited, launchers
from tools import ROOT, SMALL, assert_same_datasets, hpcsweep

SCRIPTS = ("once.sh", "requeue.sh", "array.sh", "chain.sh")
RECIPES = ("apptainer.def", "environment.yml", "hpcsweep-0.2.0-foss-2025b.eb", "spack")
"""How to install there; `tests/packaging` checks them."""
LONG = SMALL.replace("transient_cycles = 30", "transient_cycles = 80000").replace(
    "[output]", '[solver]\nskip = "none"\n[output]'
)
"""Half a minute of work on one core in 24 blocks: many times what stands between two writes."""
ENDLESS = LONG.replace("count = 11", "count = 4001").replace("block = 4", "block = 4001")
"""A job whose first block takes minutes."""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    with Cluster(tmp_path_factory.mktemp("slurm") / "cluster") as running:
        yield running


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> Path:
    """Results of LONG in one go."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    (folder / "long.toml").write_text(LONG)
    done = hpcsweep(0, "run", folder / "long.toml", "-o", folder / "long.h5")
    assert done.returncode == 0, done.stderr
    return folder / "long.h5"


@pytest.fixture
def long_job(tmp_path: Path) -> Path:
    path = tmp_path / "long.toml"
    path.write_text(LONG)
    return path


def status(path: Path) -> dict:
    return json.loads(hpcsweep(0, "status", path, "--json").stdout)


def wait_for_blocks(cluster: Cluster, path: Path, session: int = 1, seconds: float = 300) -> None:
    """Wait until the so-manieth session on a results file has written a block."""
    deadline = time.monotonic() + seconds
    journal = Path(f"{path}.journal")
    while True:
        sessions = journal.read_text().split('"start"') if journal.exists() else []
        if len(sessions) > session and '"block",' in sessions[session]:
            return
        assert time.monotonic() < deadline, cluster.slurm("scontrol", "show", "job")
        time.sleep(0.05)


def log_of(folder: Path) -> str:
    (path,) = folder.glob("*.log")
    return path.read_text()


def blocks(script: str) -> dict[str, str]:
    """Return the functions of a script and its place for modules and launcher."""
    text = (ROOT / "slurm" / script).read_text()
    found = dict(re.findall(r"^(\w+\(\)) \{\n(.*?)^\}$", text, re.MULTILINE | re.DOTALL))
    found["edit 2"] = re.search(r"^# Edit, 2 of 2:.*?\n\n", text, re.MULTILINE | re.DOTALL)[0]
    return found


def test_what_the_scripts_share_is_the_same_in_all():
    assert sorted(p.name for p in (ROOT / "slurm").iterdir()) == sorted(SCRIPTS + RECIPES)
    shared = {}
    for script in SCRIPTS:
        for name, text in blocks(script).items():
            shared.setdefault(name, {})[script] = text
    assert {name: len(texts) for name, texts in shared.items()} == {
        "run()": 4,
        "runs_done()": 3,
        "run_and_requeue()": 2,
        "edit 2": 4,
    }
    for name, texts in shared.items():
        assert len(set(texts.values())) == 1, f"{name} differs between {list(texts)}"


def test_a_missing_slurm_is_an_error_that_names_the_packages(tmp_path, monkeypatch):
    monkeypatch.setattr("slurm_cluster.SEARCH", str(tmp_path))
    with pytest.raises(SlurmError, match=r"no munged, slurmctld.*apt-get install munge"):
        Cluster(tmp_path / "none").__enter__()
    assert not (tmp_path / "none").exists()


@pytest.mark.slurm
@pytest.mark.parametrize("launcher", ["srun", "mpirun"])
def test_once_stops_at_the_signal_and_submitted_again_completes(
    cluster, tmp_path, long_job, uninterrupted, launcher
):
    script = edited("once.sh", tmp_path, launchers()[launcher])
    results = tmp_path / "other.h5"
    first = cluster.submit("--ntasks=2", script, long_job, results, cwd=tmp_path)
    wait_for_blocks(cluster, results)
    cluster.signal(first)
    stopped = cluster.wait(first)
    assert (stopped["JobState"], stopped["ExitCode"]) == ("FAILED", "75:0")
    assert stopped["Account"] == "test"
    log = (tmp_path / f"hpcsweep-{first}.log").read_text()
    assert "stopped in good order; run again to resume" in log
    assert not status(results)["complete"]
    second = cluster.submit("--ntasks=2", script, long_job, results, cwd=tmp_path)
    assert cluster.wait(second)["ExitCode"] == "0:0"
    state = status(results)
    assert state["complete"]
    assert [session["ended"] for session in state["sessions"]] == ["SIGUSR1", "complete"]
    assert [session["ranks"] for session in state["sessions"]] == [2, 2]
    assert_same_datasets(results, uninterrupted)


@pytest.mark.slurm
def test_slurm_takes_the_lines_that_a_dry_run_prints(cluster, tmp_path):
    job_file = tmp_path / "small.toml"
    job_file.write_text(SMALL.replace("count = 4", "count = 2"))
    reported = hpcsweep(0, "run", job_file, "--dry-run", cwd=tmp_path).stdout
    lines = re.findall(r"^#SBATCH .*$", reported, re.MULTILINE)
    script = edited("once.sh", tmp_path, launchers()["srun"])
    text = re.sub(r"^#SBATCH --(ntasks|time)=.*\n", "", script.read_text(), flags=re.MULTILINE)
    script.write_text(text.replace("\n#SBATCH", "\n" + "\n".join([*lines, "#SBATCH"]), 1))
    job = cluster.submit(script, job_file, cwd=tmp_path)
    ended = cluster.wait(job)
    assert ended["ExitCode"] == "0:0", log_of(tmp_path)
    asked = dict(line.removeprefix("#SBATCH --").split("=") for line in lines)
    assert ended["NumTasks"] == asked["ntasks"]
    assert ended["TimeLimit"] == asked["time"]
    assert ended["MinMemoryCPU"] == asked["mem-per-cpu"]
    state = status(tmp_path / "small.h5")
    assert state["complete"]
    assert state["sessions"][0]["ranks"] == int(asked["ntasks"])


@pytest.mark.slurm
@pytest.mark.parametrize("launcher", ["srun", "mpirun"])
def test_requeue_goes_on_until_complete(cluster, tmp_path, long_job, uninterrupted, launcher):
    script = edited("requeue.sh", tmp_path, launchers()[launcher])
    job = cluster.submit("--ntasks=2", script, long_job, cwd=tmp_path)
    results = tmp_path / "long.h5"
    for restart in (1, 2):
        wait_for_blocks(cluster, results, session=restart)
        cluster.signal(job)
        cluster.start_now(job)
        assert cluster.wait(job, "RUNNING")["Restarts"] == str(restart)
    ended = cluster.wait(job)
    assert (ended["JobState"], ended["Restarts"]) == ("COMPLETED", "2")
    log = log_of(tmp_path)
    for line in (
        "requeued, to resume (restart 1 of at most 50)",
        "requeued, to resume (restart 2 of at most 50)",
        "long.h5: complete",
    ):
        assert log.count(line) == 1, log
    state = status(results)
    assert state["complete"]
    assert [session["ended"] for session in state["sessions"]] == ["SIGUSR1", "SIGUSR1", "complete"]
    assert [session["ranks"] for session in state["sessions"]] == [2, 2, 2]
    assert_same_datasets(results, uninterrupted)


@pytest.mark.slow
@pytest.mark.slurm
def test_the_time_limit_itself_stops_and_requeues(cluster, tmp_path):
    job_file = tmp_path / "longer.toml"
    job_file.write_text(LONG.replace("count = 11", "count = 4001"))
    script = edited("requeue.sh", tmp_path, launchers()["srun"])
    job = cluster.submit(
        "--ntasks=2", "--time=2", "--signal=B:USR1@60", script, job_file, cwd=tmp_path
    )
    wait_for_blocks(cluster, tmp_path / "longer.h5")
    assert cluster.wait(job, "PENDING")["Restarts"] == "1"
    cluster.slurm("scancel", job)
    state = status(tmp_path / "longer.h5")
    assert [session["ended"] for session in state["sessions"]] == ["SIGUSR1"]
    assert 0 < state["runs_done"] < state["runs_total"]


@pytest.mark.slurm
def test_requeue_ends_after_the_most_restarts(cluster, tmp_path, long_job):
    script = edited("requeue.sh", tmp_path, launchers()["srun"])
    job = cluster.submit("--ntasks=2", script, long_job, cwd=tmp_path, HPCSWEEP_MAX_RESTARTS="1")
    wait_for_blocks(cluster, tmp_path / "long.h5")
    cluster.signal(job)
    cluster.start_now(job)
    wait_for_blocks(cluster, tmp_path / "long.h5", session=2)
    cluster.signal(job)
    ended = cluster.wait(job)
    assert (ended["JobState"], ended["ExitCode"], ended["Restarts"]) == ("FAILED", "75:0", "1")
    assert "not requeued: restarted 1 times, HPCSWEEP_MAX_RESTARTS is 1" in log_of(tmp_path)
    assert not status(tmp_path / "long.h5")["complete"]


@pytest.mark.slurm
@pytest.mark.parametrize("script", ["requeue.sh", "chain.sh"])
def test_a_time_limit_without_progress_is_not_repeated(cluster, tmp_path, script):
    job_file = tmp_path / "endless.toml"
    job_file.write_text(ENDLESS)
    path = edited(script, tmp_path, launchers()["srun"])
    if script == "chain.sh":
        job, *later = cluster.slurm("bash", path, 3, job_file, "--ntasks=2", cwd=tmp_path).split()
    else:
        job, later = cluster.submit("--ntasks=2", path, job_file, cwd=tmp_path), []
    journal = tmp_path / "endless.h5.journal"
    cluster.wait(job, "RUNNING")
    while not journal.exists():
        cluster.wait(job, "RUNNING")
        time.sleep(0.1)
    cluster.signal(job)
    ended = cluster.wait(job)
    assert (ended["JobState"], ended["ExitCode"], ended["Restarts"]) == ("FAILED", "75:0", "0")
    assert "no progress" in log_of(tmp_path)
    assert [cluster.wait(link)["JobState"] for link in later] == ["CANCELLED"] * len(later)
    assert journal.read_text().count('"start"') == 1


@pytest.mark.slurm
@pytest.mark.parametrize("script", ["once.sh", "requeue.sh", "array.sh"])
def test_a_mistake_is_told_in_one_line_and_not_requeued(cluster, tmp_path, script):
    bad = tmp_path / "bad.toml"
    bad.write_text(SMALL.replace("300.0", "-1.0"))
    path = edited(script, tmp_path, launchers()["srun"])
    array = ["--array=1-1"] if script == "array.sh" else []
    job = cluster.submit("--ntasks=2", *array, path, bad, cwd=tmp_path)
    ended = cluster.wait(job)
    assert (ended["JobState"], ended["ExitCode"], ended["Restarts"]) == ("FAILED", "2:0", "0")
    ours = [line for line in log_of(tmp_path).splitlines() if "hpcsweep: error:" in line]
    assert len(ours) == 1
    assert "bad.toml" in ours[0]
    assert "structure.stiffness_ratio" in ours[0]
    assert not list(tmp_path.glob("*.h5*"))


@pytest.mark.slurm
def test_a_cancelled_job_is_not_requeued(cluster, tmp_path, long_job):
    script = edited("requeue.sh", tmp_path, launchers()["srun"])
    job = cluster.submit("--ntasks=2", script, long_job, cwd=tmp_path)
    wait_for_blocks(cluster, tmp_path / "long.h5")
    cluster.slurm("scancel", job)
    ended = cluster.wait(job)
    assert (ended["JobState"], ended["Restarts"]) == ("CANCELLED", "0")
    time.sleep(3)
    assert cluster.job(job)["JobState"] == "CANCELLED"
    assert "requeued" not in log_of(tmp_path)


@pytest.mark.slurm
def test_array_runs_each_file_and_requeues_one_task_alone(
    cluster, tmp_path, long_job, uninterrupted
):
    small = tmp_path / "small.toml"
    small.write_text(SMALL)
    script = edited("array.sh", tmp_path, launchers()["mpirun"])
    array = cluster.submit("--ntasks=2", "--array=1-3", script, long_job, small, cwd=tmp_path)
    wait_for_blocks(cluster, tmp_path / "long.h5")
    cluster.signal(f"{array}_1")
    cluster.start_now(f"{array}_1")
    assert cluster.wait(f"{array}_1")["Restarts"] == "1"
    for task, code, restarts in ((1, "0:0", "1"), (2, "0:0", "0"), (3, "2:0", "0")):
        ended = cluster.wait(f"{array}_{task}")
        assert (ended["ExitCode"], ended["Restarts"]) == (code, restarts), task
    log = (tmp_path / f"hpcsweep-{array}_3.log").read_text()
    assert "no job file for task 3: use --array=1-2" in log
    assert status(tmp_path / "small.h5")["complete"]
    assert_same_datasets(tmp_path / "long.h5", uninterrupted)


@pytest.mark.slurm
def test_chain_goes_on_and_cancels_the_links_left_over(cluster, tmp_path, long_job, uninterrupted):
    script = edited("chain.sh", tmp_path, launchers()["srun"])
    links = cluster.slurm("bash", script, 4, long_job, "--ntasks=2", cwd=tmp_path).split()
    assert len(links) == 4
    wait_for_blocks(cluster, tmp_path / "long.h5")
    assert cluster.job(links[1])["Reason"] == "Dependency"
    cluster.signal(links[0])
    ended = [cluster.wait(link) for link in links]
    assert [(job["JobState"], job["ExitCode"]) for job in ended] == [
        ("FAILED", "75:0"),
        ("COMPLETED", "0:0"),
        ("CANCELLED", "0:0"),
        ("CANCELLED", "0:0"),
    ]
    assert "the chain ends: complete" in log_of(tmp_path)
    assert [session["ended"] for session in status(tmp_path / "long.h5")["sessions"]] == [
        "SIGUSR1",
        "complete",
    ]
    assert_same_datasets(tmp_path / "long.h5", uninterrupted)


@pytest.mark.slurm
def test_chain_ends_with_a_mistake(cluster, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text(SMALL.replace("300.0", "-1.0"))
    script = edited("chain.sh", tmp_path, launchers()["srun"])
    links = cluster.slurm("bash", script, 3, bad, "--ntasks=2", cwd=tmp_path).split()
    ended = [cluster.wait(link) for link in links]
    assert [job["JobState"] for job in ended] == ["FAILED", "CANCELLED", "CANCELLED"]
    assert log_of(tmp_path).count("hpcsweep: error:") == 1


@pytest.mark.slurm
def test_a_launcher_of_another_mpi_is_refused(cluster, tmp_path, long_job):
    script = edited("once.sh", tmp_path, "srun --mpi=none")
    job = cluster.submit("--ntasks=2", script, long_job, cwd=tmp_path)
    assert cluster.wait(job)["ExitCode"] == "2:0"
    log = log_of(tmp_path)
    assert log.count("hpcsweep: error:") == 1, log
    assert "the launcher started 2 ranks" in log
    assert "srun --mpi=pmi2 (MPICH) or srun --mpi=pmix (Open MPI)" in log
    assert not list(tmp_path.glob("*.h5*"))


@pytest.mark.slurm
def test_nothing_is_left_running(tmp_path, long_job):
    own = Cluster(tmp_path / "own")
    with contextlib.suppress(ZeroDivisionError), own:
        script = edited("once.sh", tmp_path, launchers()["srun"])
        own.submit("--ntasks=2", script, long_job, cwd=tmp_path)
        wait_for_blocks(own, tmp_path / "long.h5")
        # munged, slurmctld and its helper, slurmd, two slurmstepd, the script, srun, two ranks
        assert len(own.processes()) >= 9
        raise ZeroDivisionError
    assert own.processes() == set()


@pytest.mark.slurm
def test_nothing_is_left_running_when_the_test_process_is_killed(tmp_path, long_job):
    program = (
        "import sys, time; from pathlib import Path\n"
        "from slurm_cluster import Cluster, edited, launchers\n"
        f"folder = Path({str(tmp_path)!r})\n"
        "with Cluster(folder / 'own') as own:\n"
        "    script = edited('once.sh', folder, launchers()['srun'])\n"
        "    own.submit('--ntasks=2', script, 'long.toml', cwd=folder)\n"
        "    time.sleep(600)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    own = Cluster(tmp_path / "own")
    try:
        wait_for_blocks(own, tmp_path / "long.h5")
        assert len(own.processes()) >= 9
    finally:
        process.kill()
        process.wait()
    deadline = time.monotonic() + 30
    while own.processes():
        assert time.monotonic() < deadline, own.processes()
        time.sleep(0.1)
