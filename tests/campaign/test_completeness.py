"""A session ends with 0 where its file is complete and nowhere else, wherever it is stopped."""

import itertools
import time

import h5py
import pytest
from tools import (
    BASINS,
    GRID,
    RECORDS,
    REFINED,
    SEEDS,
    SMALL,
    TWO_STOPS,
    VARY,
    assert_same_datasets,
    hpcsweep,
    made,
)

from hpcsweep.campaign.run import COMPLETE, STOPPED, run
from hpcsweep.campaign.status import overview, status
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store.journal import read_history

MORE = 2.5
"""Looks of a session over those of the one before."""
STUDIES = {
    "amplitude_sweep": SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 5"),
    "points": GRID.replace("count = 11", "count = 5"),
    "vary": SMALL.replace("count = 4", "count = 2").replace("count = 11", "count = 3") + VARY,
    "records": RECORDS.replace("count = 5", "count = 3"),
    "attractors": f"""
[study]
kind = "attractors"
starts = 8
{TWO_STOPS}
[sweep]
omega = [0.9, 1.0]
amplitude = [0.6, 0.7]
""",
    "basins": BASINS.replace("count = 9", "count = 3").replace("count = 7", "count = 4"),
    "branches": f"""
[study]
kind = "branches"
[branches]
seeds = "seeds.h5"
steps = 100
{TWO_STOPS}
[sweep]
omega = [0.9, 1.1]
amplitude = {{from = 0.2, to = 0.7, count = 11}}
transient_cycles = 100
sampling_cycles = 32
""",
    "refined points": REFINED,
    "refined attractors": f"""
[study]
kind = "attractors"
starts = 8
refine = {{levels = 2, wrong = 0.6}}
{TWO_STOPS}
[sweep]
omega = {{from = 0.5, to = 1.1, count = 5}}
amplitude = {{from = 0.02, to = 0.5, count = 6}}
[output]
max_points = 32
""",
    "refined basins": BASINS.replace(
        "starts = 16", "starts = 16\nrefine = {levels = 2, wrong = 0.4}"
    ),
}


QUICK = ("amplitude_sweep",)


class StopsAtLook(StopFlag):
    """Is set from a look on, whoever looks: while the file is verified, in runs, between rounds."""

    def __init__(self, look: int):
        super().__init__()
        self._left = look

    def is_set(self) -> bool:
        self._left -= 1
        return self._left < 0


def holds_all(path) -> bool:
    """Return whether nothing is missing, by the datasets of checksums alone."""
    with h5py.File(path, "r") as file:
        return bool(file["inferred" if "inferred" in file else "commit"][...].all())


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind not in QUICK)) for kind in STUDIES]
)
def test_no_end_but_of_a_complete_file_is_0(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if kind == "branches":
        made(SEEDS, tmp_path / "seeds.h5")
    job, path = parse_job(STUDIES[kind], "job", "job"), tmp_path / "cut.h5"
    looks, ends, complete = 0.0, [], False
    while not complete:
        code = run(job, path, Serial(), flag=StopsAtLook(int(looks)))
        complete = code == COMPLETE
        assert code in (COMPLETE, STOPPED)
        state = status(path)
        assert holds_all(path) == state["complete"] == complete
        assert (overview(path)["state"] == "complete") == validate(path, 0).complete == complete
        reason = read_history(path).sessions[-1].ended
        assert (reason == "complete") == complete
        ends.append(state["runs_done"])
        looks = max(MORE * looks, looks + 1)
    assert ends[0] == 0
    assert len(ends) > 4
    # a complete file is verified anew before a session believes it
    assert run(job, path, Serial(), flag=StopsAtLook(0)) == STOPPED
    assert run(job, path, Serial()) == COMPLETE
    assert_same_datasets(path, made(STUDIES[kind], tmp_path / "whole.h5"))


@pytest.mark.slow
def test_a_damaged_file_is_not_complete_until_it_is_mended(tmp_path):
    """Every block has a checksum, one of which does not hold."""
    path, job = made(SMALL, tmp_path / "a.h5"), parse_job(SMALL, "job", "job")
    whole = made(SMALL, tmp_path / "whole.h5")
    with h5py.File(path, "r+") as file:
        file["drift"][0, 1, 5] += 1.0
    looks = itertools.count(step=4)
    while run(job, path, Serial(), flag=StopsAtLook(next(looks))) == STOPPED:
        assert validate(path, 0).problems
    assert_same_datasets(path, whole)


@pytest.mark.parametrize("text", [SMALL, REFINED], ids=["sweep", "refined"])
def test_a_time_limit_before_the_first_run_is_75(text, tmp_path):
    (tmp_path / "job.toml").write_text(text)
    for _ in range(2):
        begun = time.monotonic()
        done = hpcsweep(0, "run", "job.toml", "--max-hours", "0.0008", cwd=tmp_path)
        assert done.returncode == STOPPED
        assert "job.h5: stopped in good order" in done.stderr
        assert time.monotonic() - begun < 30
    assert status(tmp_path / "job.h5")["runs_done"] == 0
    told = hpcsweep(0, "validate", "job.h5", cwd=tmp_path)
    assert told.returncode == 0
    assert "; not complete" in told.stdout
