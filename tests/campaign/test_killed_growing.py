"""Campaigns that take runs over, or are refined, killed on 1, 2 and 3 ranks: no bit changes."""

import random
import signal

import faults
import pytest
from test_refined import SLOW
from test_refined_basins import REFINED
from tools import assert_same_datasets, hpcsweep

from hpcsweep.campaign.run import COMPLETE, run_all
from hpcsweep.campaign.status import status
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial

KILLS = 8
POINTS = "refine = {levels = 3, wrong = 0.2}\n"
SWEEP = faults.JOB.replace("count = 4", "count = 5")
FINER = faults.JOB.replace("count = 4", "count = 9")
STARTS = REFINED.replace("count = 41", "count = 81").replace("count = 34", "count = 72")
LONG = STARTS.replace("wrong = 0.2", "wrong = 0.05")


def made(text, path):
    (ending,) = run_all([(parse_job(text, "job", "job"), path)], Serial())
    assert ending.code == COMPLETE
    return path


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [
        pytest.param(SWEEP, FINER, id="sweeps taken over"),
        pytest.param(SLOW.replace("count = 26", "count = 6"), SLOW, id="points of a coarser map"),
        pytest.param(SLOW.replace(POINTS, ""), SLOW, id="points of a full map"),
        pytest.param(None, LONG, id="starts of a slice"),
    ],
)
def test_killed_again_and_again_it_equals_the_uninterrupted_one(tmp_path, old, new):
    job, path, rng = tmp_path / "job.toml", tmp_path / "cut.h5", random.Random(5)
    job.write_text(new)
    whole = made(new, tmp_path / "whole.h5")
    reuse = ("--reuse", made(old, tmp_path / "old.h5")) if old else ()
    before = (tmp_path / "old.h5").read_bytes() if old else b""
    kills = 0
    while kills < KILLS and not (path.exists() and status(path)["complete"]):
        ranks = (0, 2, 3)[kills % 3]
        process = faults.start(ranks, "run", job, "-o", path, *reuse, sync=0.0)
        least = len(faults.committed(path)) + rng.randint(1, 12)
        if faults.wait_for_commits(process, path, least):
            process.send(signal.SIGKILL, "all", rng)
            kills += 1
        process.end()
        process.finish()
    assert kills >= 3
    done = hpcsweep(2, "run", job, "-o", path, *reuse)
    assert done.returncode == 0, done.stderr
    assert_same_datasets(whole, path)
    assert not old or (tmp_path / "old.h5").read_bytes() == before
