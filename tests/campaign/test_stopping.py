"""Campaigns that are told to stop: within seconds, also where no run ends for hours."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import faults
import pytest
from tools import SMALL, hpcsweep

BDF = (
    SMALL.replace("transient_cycles = 30", "transient_cycles = 100000")
    .replace("count = 4}", "count = 2}")
    .replace("[output]", '[solver]\nmethod = "bdf"\nskip = "none"\n[output]')
)
"""Hours of work; no block is done before minutes have passed."""


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
        (2, "SIGINT", "launcher"),
        (3, "SIGUSR1", "rank"),
        (0, "SIGHUP", "launcher"),
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
    done = hpcsweep(2, "run", job, "-o", tmp_path / "bdf.h5", "--max-hours", 6 / 3600)
    assert done.returncode == 75, done.stderr
    assert time.monotonic() - begun < 25
    assert faults.records(tmp_path / "bdf.h5")[-1]["reason"] == "time limit"


@pytest.mark.slow
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
