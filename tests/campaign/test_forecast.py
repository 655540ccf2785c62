"""What a dry run asks Slurm for: by hand, and in the lines that it prints."""

import re

import pytest
from tools import hpcsweep

from hpcsweep.campaign import slurm
from hpcsweep.parallel.simulation import Prediction


def bound(costs, n):
    """Return the bound that no schedule beats, as a prediction."""
    makespan = max(sum(costs) / n, max(costs))
    efficiency = sum(costs) / (n * makespan)
    return Prediction(n, makespan, makespan, efficiency, recalls=0, messages=0, master_load=0.0)


@pytest.mark.parametrize(
    ("costs", "most", "expected"),
    [
        ([1.0], 64, 1),  # one frame: two ranks are half idle
        ([1.0] * 2, 64, 2),
        ([1.0] * 5, 64, 6),  # 5 / 6 = 0.83
        ([1.0] * 100, 4096, 120),  # 100 / 125 = 0.8, of 64, 72, ..., 128
        ([1.0] * 100, 64, 64),
        ([50.0] + [1.0] * 50, 64, 2),  # half of the work is one frame
    ],
)
def test_ranks_that_are_of_use(costs, most, expected):
    found = slurm.useful_ranks(lambda n: bound(costs, n), most)
    assert found.n_ranks == expected
    assert found.efficiency >= slurm.EFFICIENCY
    assert found == bound(costs, expected)


@pytest.mark.parametrize(
    ("makespan", "memory", "time", "megabytes"),
    [
        (0.1, 330e6, "00:15:00", 400),  # 393.4 MiB
        (200.0, 340e6, "00:15:00", 500),  # 15 min exactly, 405.3 MiB
        (201.0, 1e9, "00:20:00", 1200),
        (3600.0, 3e9, "01:40:00", 3600),
        (57200.0, 3e9, "1-00:00:00", 3600),
        (200000.0, 3e9, "3-11:30:00", 3600),
    ],
)
def test_lines_have_margins_in_the_units_of_slurm(makespan, memory, time, megabytes):
    prediction = Prediction(24, makespan, makespan, 1.0, recalls=0, messages=0, master_load=0.0)
    assert slurm.as_lines(slurm.request(prediction, memory)) == [
        "#SBATCH --ntasks=24",
        "#SBATCH --cpus-per-task=1",
        f"#SBATCH --time={time}",
        f"#SBATCH --mem-per-cpu={megabytes}M",
    ]


def test_dry_run_prints_the_lines_that_fit_its_table(tmp_path, small_job):
    reported = hpcsweep(0, "run", small_job, "--dry-run", cwd=tmp_path).stdout
    lines = [line for line in reported.splitlines() if line.startswith("#SBATCH")]
    asked = dict(line.removeprefix("#SBATCH --").split("=") for line in lines)
    assert list(asked) == ["ntasks", "cpus-per-task", "time", "mem-per-cpu"]
    rows = re.findall(r"^ +(\d+) +\S+ s +(\S+) %", reported, re.MULTILINE)
    efficiency = {int(ranks): float(percent) for ranks, percent in rows}
    n_ranks = int(asked["ntasks"])
    # the largest power of two in the table that keeps the efficiency, or less than twice it
    kept = max(n for n in efficiency if all(efficiency[k] >= 80 for k in efficiency if k <= n))
    assert kept <= n_ranks < 2 * kept
    # four frames
    assert n_ranks <= 5
    assert asked["time"] == "00:15:00"
    memory = float(re.search(r"about (\d+) MB a rank", reported)[1])
    assert (
        1.25 * memory * 1e6 <= int(asked["mem-per-cpu"][:-1]) * 2**20 < 1.25 * memory * 1e6 + 1.1e8
    )
