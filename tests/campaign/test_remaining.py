"""The reported remaining time, against a replay of recorded costs.

The costs have the shape of the whole study: 2,000 frames, those below Omega = 0.23 thirty times as
costly as the rest, runs of one place that differ by a factor of two, costliest frames first.
"""

import numpy as np
import pytest

from hpcsweep.campaign import costs as costs_of
from hpcsweep.campaign.costs import (
    PILOT_TIMED,
    KnownCosts,
    TaskCosts,
    n_samples,
    remaining_of,
    sample_place,
)
from hpcsweep.campaign.progress import Log
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store.journal import BlockCost, PilotCost

STUDY = """
[sweep]
omega = {from = 0.1, to = 1.5, count = 2000}
amplitude = {from = 0.002, to = 0.25, count = 125}
[output]
block = 25
"""
COSTLY = 0.23
MINUTE = 60.0
NONE = np.empty((0, 3), int)


def cost_of_runs(study, rng) -> np.ndarray:
    """Seconds a run, shape (direction, frame, amplitude)."""
    omega, amplitude = study.omega[:, None], study.amplitude
    frames = np.where(omega < COSTLY, 30.0, 1.0) * (1 + 0.3 * np.sin(40 * omega))
    along = 0.2 + (amplitude / amplitude[-1]) ** 2
    shape = (len(study.directions), omega.size, amplitude.size)
    spread = rng.lognormal(-0.245, 0.7, shape)
    return 1e-3 * frames * along * spread


def replay(study, seconds: np.ndarray, ranks: int, pilot: bool):
    """Hand out the frames as the schedule does; yield time, estimate (requested) and truth."""
    costs = TaskCosts(study)
    for index in range(n_samples(study) if pilot else 0):
        share, along = sample_place(index)
        frame = int(share * study.omega.size)
        at = int(along * (study.n_along - PILOT_TIMED))
        timed = float(seconds[0, frame, at : at + PILOT_TIMED].sum())
        costs.sampled(PilotCost(frame, (at + 1) / study.n_along, PILOT_TIMED, timed))
    order = np.argsort(-costs.totals(), kind="stable") if ranks > 1 else range(study.omega.size)
    left = float(seconds.sum())
    clock = 0.0
    for task in order:
        for block in study.path(int(task)):
            spent = float(seconds[block.runs].sum())
            costs.measured(BlockCost(block.place, block.n_runs, spent))
            costs.done(block.place)
            left -= spent
            clock += spent / ranks
        yield clock, costs.remaining, left / ranks


@pytest.mark.parametrize("ranks", [1, 8])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_the_remaining_time_is_right_from_the_first_minute_on(ranks, seed):
    study = parse_job(STUDY, "study", "study").study
    seconds = cost_of_runs(study, np.random.default_rng(seed))
    total = seconds.sum() / ranks
    asked = 0
    for number, (clock, estimate, truth) in enumerate(replay(study, seconds, ranks, True)):
        if clock < MINUTE or number % 20:
            continue
        asked += 1
        if truth > 0.01 * total:
            reported = estimate(ranks)
            assert abs(reported / truth - 1) < 0.25, (clock, reported, truth)
    assert asked > 20


def test_without_any_cost_nothing_is_told():
    study = parse_job(STUDY, "study", "study").study
    assert TaskCosts(study).remaining(2) is None


def test_without_a_pilot_the_measured_blocks_tell():
    study = parse_job(STUDY.replace("2000", "50"), "study", "study").study
    costs = TaskCosts(study)
    for block in study.path(7):
        costs.measured(BlockCost(block.place, block.n_runs, 0.1 * block.n_runs))
        costs.done(block.place)
    assert costs.remaining() == pytest.approx(0.1 * (study.n_runs - 250))


def test_the_log_takes_the_estimate_where_there_is_one(capsys):
    log = Log(1000, 0)
    log.advance(10)
    log.close()
    assert "left" in capsys.readouterr().err
    log.expect(lambda: 754.2)
    log.close()
    assert "0:12:34 left" in capsys.readouterr().err


def test_one_rank_is_told_the_time_too(tmp_path):
    """The pilot's samples are in the journal, and the estimate comes before the first block."""
    from hpcsweep.campaign import run as campaign
    from hpcsweep.campaign.progress import Silent
    from hpcsweep.parallel.mpi import Serial
    from hpcsweep.store.journal import read_history

    job = parse_job(STUDY.replace("2000", "4"), "study", "study")
    reported = []

    class Display(Silent):
        def expect(self, remaining):
            self.remaining = remaining

        def advance(self, runs):
            reported.append(self.remaining())

    path = tmp_path / "one.h5"
    assert campaign.run(job, path, Serial(), progress=lambda *_: Display()) == 0
    assert len(read_history(path).samples) == n_samples(job.study)
    assert all(np.isfinite(reported))
    assert reported[0] > reported[-1] == 0


def test_what_a_rank_does_besides_its_runs_is_in_the_remaining_time(tmp_path, monkeypatch):
    """Of single points: 0.5 ms of runs, 2 ms of messages and commits a point."""
    text = STUDY.replace("[sweep]", '[study]\nkind = "points"\n[sweep]').replace("block = 25", "")
    study = parse_job(text.replace("2000", "50"), "", "points").study
    now = [100.0]
    monkeypatch.setattr(costs_of.time, "monotonic", lambda: now[0])
    known = KnownCosts(Serial(), study, tmp_path / "a.h5", NONE)
    done = study.n_tasks // 5
    for task in range(done):
        (block,) = study.path(task)
        now[0] += 2.5e-3
        known.block_done(BlockCost(block.place, block.n_runs, 5e-4))
    left = (study.n_tasks - done) * 2.5e-3
    assert remaining_of([known]) == pytest.approx(left, rel=0.02)
