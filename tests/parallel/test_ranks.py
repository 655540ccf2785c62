"""Every kind of campaign gives the same bytes on one, two and three ranks.

The campaigns of a number of ranks are run one after the other by one `mpirun`: its ranks load their
libraries once.
"""

import functools

import faults
import numpy as np
import pytest
from tools import (
    ALONG,
    ATTRACTORS,
    BASINS,
    GAPS,
    GRID,
    RECORDS,
    REFINED,
    SEEDS,
    SMALL,
    VARY,
    YIELDING,
    YIELDING_RECORDS,
    assert_same_datasets,
    datasets,
    made,
    run_script,
)

BRANCHES = """
[study]
kind = "branches"
[branches]
seeds = "seeds.h5"
steps = 100
max_points = 1000
max_seeds = 40
"""
CAMPAIGNS = {
    "amplitude_sweep": SMALL,
    "along omega": ALONG,
    "along a gap": GAPS,
    "points": GRID,
    "attractors": ATTRACTORS.replace("count = 6", "count = 3"),
    "basins": BASINS,
    "records": RECORDS,
    "yielding": YIELDING,
    "yielding_records": YIELDING_RECORDS,
    "branches": SEEDS + BRANCHES,
    "vary": SMALL + VARY,
    "refined": REFINED.replace("count = 26", "count = 14"),
}
ON_RANKS = {2: ("amplitude_sweep", "points", "records", "branches", "refined"), 3: tuple(CAMPAIGNS)}
"""On two ranks one of each way to hand out work: frames, blocks, lines, rounds."""
EACH = """
import sys
from hpcsweep.commands import cli
for name in sys.argv[2:]:
    if code := cli.main(["run", f"{sys.argv[1]}/{name}.toml", "-o", f"{name}.h5"]):
        sys.exit(code)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Jobs of all campaigns."""
    folder = tmp_path_factory.mktemp("ranks")
    seeds = made(SEEDS, folder / "seeds.h5")
    for name, text in CAMPAIGNS.items():
        (folder / f"{name}.toml").write_text(text.replace("seeds.h5", str(seeds)))
    return folder


@pytest.fixture(scope="module")
def alone(folder):
    """Return a function that gives the results of a campaign on one rank, made once."""
    return functools.cache(
        lambda name: made((folder / f"{name}.toml").read_text(), folder / f"{name}.h5")
    )


@pytest.fixture(scope="module")
def results_on(folder):
    """Return a function that gives the folder of all results on several ranks, made once."""
    script = folder / "each.py"
    script.write_text(EACH)

    @functools.cache
    def results_on(ranks: int):
        own = folder / str(ranks)
        own.mkdir()
        done = run_script(ranks, script, folder, *ON_RANKS[ranks], cwd=own)
        assert done.returncode == 0, done.stderr
        return own

    return results_on


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        *((name, 2) for name in ON_RANKS[2]),
        *(pytest.param(name, 3, marks=pytest.mark.slow) for name in ON_RANKS[3]),
    ],
)
def test_every_number_of_ranks_gives_the_same_bytes(alone, results_on, name, ranks):
    path = results_on(ranks) / f"{name}.h5"
    assert_same_datasets(alone(name), path)
    records = faults.records(path)
    (start,) = (record for record in records if record["kind"] == "start")
    assert start["ranks"] == ranks
    blocks = [record for record in records if record["kind"] == "block"]
    assert len({record["rank"] for record in blocks}) > 1


def test_another_job_gives_other_bytes(alone, tmp_path):
    text = CAMPAIGNS["amplitude_sweep"].replace("300.0", "300.0000001")
    control = made(text, tmp_path / "control.h5")
    left, right = datasets(alone("amplitude_sweep")), datasets(control)
    assert not np.array_equal(left["final_state"], right["final_state"])
