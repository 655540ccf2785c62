"""What a dry run says of a job: the bound of the ranks, an interval, a Slurm request, by hand."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from together import together
from tools import GRID, hpcsweep

from hpcsweep.campaign import forecast
from hpcsweep.campaign.forecast import (
    COMMIT_SECONDS,
    LOAD,
    SHARE,
    Sample,
    TimeInterval,
    advised_ranks,
    mean_interval,
    slurm_lines,
    useful_ranks,
    whole,
)
from hpcsweep.job import parse_job
from hpcsweep.store import Layout


@together(
    "tasks, expected",
    [([1.0], 1), ([1.0] * 5, 5), ([2.0, 1.0, 1.0], 2), ([50.0] + [1.0] * 50, 2), ([3, 4, 5], 2.4)],
)
def test_more_ranks_than_the_whole_over_the_longest_task_are_of_no_use(tasks, expected):
    assert useful_ranks(np.array(tasks, float)) == pytest.approx(expected, rel=1e-15)


@together(
    "useful, hours, within, expected",
    [
        (832.0, 1.26, 1.0, 2),
        (832.0, 1.26, 0.1, 13),
        (832.0, 1.26, 2.0, 1),
        (832.0, 2000.0, 1.0, 832),
        (2.4, 10.0, 1.0, 2),
    ],
)
def test_the_fewest_ranks_are_advised_that_are_done_in_time(useful, hours, within, expected):
    total = TimeInterval(1200 * hours, 3600 * hours)
    assert advised_ranks(useful, total, 3600 * within) == expected
    assert expected == int(useful) or hours / expected <= within
    assert expected == 1 or hours / (expected - 1) > within


DRAWS = 400
POPULATIONS = {
    "equal": lambda rng, n: np.full(n, 1.0),
    "lognormal": lambda rng, n: rng.lognormal(0.0, 1.0, n),
    "hundredfold": lambda rng, n: 10 ** rng.uniform(0, 2, n),
}


@together("n", [2, 5, 20, 200])
@together("kind", POPULATIONS)
def test_the_interval_holds_the_whole_in_its_share_of_samples(kind, n):
    """However slow, within `LOAD`, the cores that compute it are."""
    rng = np.random.default_rng(n)
    runs = POPULATIONS[kind](rng, 20_000)
    held = [0, 0]
    for slowness in rng.uniform(1.0, LOAD, DRAWS):
        drawn = rng.choice(runs, n)
        low, high = mean_interval(np.broadcast_to(drawn, (2, n)))
        # the sample's error alone, and with the load
        held[0] += low <= runs.mean() <= high / LOAD + 1e-12
        held[1] += low <= slowness * runs.mean() <= high
    assert min(held) >= SHARE * DRAWS


@together(
    "processor, clock, expected",
    [
        (1.0, 1.0, (1.0, LOAD)),
        (1.0, 3.0, (1.0, 3.0)),  # others had two thirds of the core
        (1.5, 2.9, (1.5, 1.5 * LOAD)),
    ],
)
def test_the_interval_tells_of_the_load_of_equal_runs(processor, clock, expected):
    assert mean_interval(np.tile([[processor], [clock]], 4)) == pytest.approx(expected)


def test_the_whole_has_the_runs_and_their_blocks_at_least_those_of_a_refined_map():
    job = parse_job(GRID.replace("[output]", "[output]\nblock = 11"), "job", "job")
    assert (job.study.n_runs, job.study.block_size) == (44, 11)
    equal = np.full((2, 4), 0.5)
    least, most = COMMIT_SECONDS
    assert whole(job, equal, 44) == pytest.approx((22 + 4 * least, 22 * LOAD + 4 * most))
    assert whole(job, equal, 11).low == pytest.approx(5.5 + least)


@together(
    "ranks, work, memory, tasks, time, megabytes",
    [
        (1, 0.1, 330e6, 1, "00:15:00", 400),  # 393.4 MiB
        (24, 24 * 300.0, 340e6, 24, "00:15:00", 500),  # 15 min exactly, 405.3 MiB
        (24, 24 * 301.0, 1e9, 24, "00:20:00", 1200),
        (32, 32 * 5400.0, 3e9, 32, "01:40:00", 3600),
        (33, 33 * 85800.0, 3e9, 34, "24:00:00", 3600),  # and a rank that hands out the work
    ],
)
def test_lines_have_margins_in_the_units_of_slurm(ranks, work, memory, tasks, time, megabytes):
    assert slurm_lines(ranks, work, memory) == [
        f"#SBATCH --ntasks={tasks}",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={time}",
        f"#SBATCH --mem-per-cpu={megabytes}M",
    ]


def test_dry_run_prints_the_lines_that_fit(tmp_path, small_job):
    reported = hpcsweep(0, "run", small_job, "--dry-run", cwd=tmp_path).stdout
    lines = [line for line in reported.splitlines() if line.startswith("#SBATCH")]
    asked = dict(line.removeprefix("#SBATCH --").split("=") for line in lines)
    assert list(asked) == ["ntasks", "cpus-per-task", "time", "mem-per-cpu"]
    # four frames, that take less than a second
    told = re.search(
        r"^  ranks +1, done in up to \S+ h, wanted 1 h; no more than (\d) are of use",
        reported,
        re.M,
    )
    assert 1 <= int(told[1]) <= 4
    assert (asked["ntasks"], asked["time"]) == ("1", "00:15:00")
    low, high = map(float, re.search(r"\((\S+) to (\S+) s\)", reported).groups())
    assert 0 < LOAD * low <= 1.1 * high
    memory = float(re.search(r"about (\d+) MB a rank", reported)[1])
    needed = 1.25 * memory * 1e6
    assert needed <= int(asked["mem-per-cpu"][:-1]) * 2**20 < needed + 1.1e8


def test_a_task_of_several_points_is_told_as_that_and_a_time_that_no_ranks_meet(tmp_path):
    (tmp_path / "job.toml").write_text(GRID.replace("[output]", "[output]\nblock = 11"))
    options = "--dry-run", "--max-hours", "1e-9"
    reported = hpcsweep(0, "run", "job.toml", *options, cwd=tmp_path).stdout
    ((ranks, useful),) = re.findall(
        r"ranks +(\d), done in up to .* h, wanted 1e-09 h; .* (\d) are", reported
    )
    assert ranks == useful
    assert re.search(r"longest +11 runs .*, Omega = 0\.\d, A = 0\.02 to 0\.3$", reported, re.M)
    assert "cannot be cut" not in reported


def test_a_dry_run_of_several_jobs_tells_their_sum(monkeypatch):
    """Two runs of 2 s cost from 2 s to `LOAD` times 2 s a run, and their blocks."""
    sample = Sample(np.ones(4), np.full((2, 2), 2.0), 2)
    monkeypatch.setattr(forecast, "time_runs", lambda study: sample)
    sums, jobs = Counter(), [parse_job(GRID, "job", "a"), parse_job(GRID, "job", "b")]
    for job in jobs:
        assert dict(forecast.estimate(job, Path("a.h5"), sums))["in all"]
    n_runs = jobs[0].study.n_runs
    n_blocks = 2 * n_runs / jobs[0].study.block_size
    assert sums["runs"] == 2 * n_runs
    assert sums["low"] == pytest.approx(4 * n_runs + n_blocks * COMMIT_SECONDS[0])
    assert sums["high"] == pytest.approx(LOAD * 4 * n_runs + n_blocks * COMMIT_SECONDS[1])
    told = dict(forecast.sum_lines(sums))
    assert told["runs"] == f"{2 * n_runs}"
    assert told["files"].startswith(f"{2 * Layout(jobs[0]).file_size()} bytes")
