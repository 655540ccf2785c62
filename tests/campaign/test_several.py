"""Several jobs at once: one queue, each its own file, and what one of them does to the others."""

import pytest
from together import together
from tools import SMALL, assert_same_datasets, hpcsweep

from hpcsweep.campaign.progress import Silent
from hpcsweep.campaign.run import COMPLETE, FAILED, REFUSED, STOPPED, run_all
from hpcsweep.job import load_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag


@pytest.fixture
def three(tmp_path, monkeypatch):
    """Three jobs of one shape."""
    monkeypatch.chdir(tmp_path)
    paths = []
    for name, beta in (("a", 100.0), ("b", 200.0), ("c", 300.0)):
        path = tmp_path / f"{name}.toml"
        path.write_text(SMALL)
        job = load_job(path, [f"structure.stiffness_ratio={beta}"])
        path.write_text(job.text)
        paths.append(path)
    return paths


def pairs(paths, folder):
    return [(load_job(path), folder / f"{path.stem}.h5") for path in paths]


@pytest.mark.slow
@pytest.mark.mpi
def test_three_at_once_equal_three_one_after_the_other(three, tmp_path):
    done = hpcsweep(3, "run", *three)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count(": complete") == 3
    assert done.stderr.count(" runs/s") == 1
    for path in three:
        assert hpcsweep(0, "run", path, "-o", tmp_path / "alone.h5").returncode == 0
        assert_same_datasets(tmp_path / f"{path.stem}.h5", tmp_path / "alone.h5")
        (tmp_path / "alone.h5").unlink()
    again = hpcsweep(0, "run", *three)
    assert again.returncode == 0
    assert "already in the file" in again.stderr


class Counting(Silent):
    """Does something when so many runs are done."""

    def __init__(self, runs, action):
        self._left, self._action = runs, action

    def advance(self, runs):
        self._left -= runs
        if self._left <= 0 and self._action is not None:
            action, self._action = self._action, None
            action()


@pytest.mark.slow
def test_stopped_in_the_middle_and_resumed(three, tmp_path):
    flag = StopFlag()

    def stop():
        flag.reason = "SIGTERM"

    jobs = pairs(three, tmp_path)
    half = jobs[0][0].study.n_runs * 3 // 2
    made = run_all(jobs, Serial(), flag=flag, progress=lambda *_: Counting(half, stop))
    assert [ending.code for ending in made] == [COMPLETE, STOPPED, STOPPED]
    assert [ending.code for ending in run_all(jobs, Serial())] == [COMPLETE] * 3
    assert run_all(pairs(three, tmp_path)[:1], Serial())[0].code == COMPLETE
    (tmp_path / "whole").mkdir()
    for job in pairs(three, tmp_path / "whole"):
        run_all([job], Serial())
        assert_same_datasets(tmp_path / job[1].name, job[1])


def test_a_job_that_fails_does_not_stop_the_others(three, tmp_path, monkeypatch):
    """The file of b is taken away in mid-run, that of c is of another job from the beginning."""
    from hpcsweep.store import commit

    monkeypatch.setattr(commit, "SYNC_INTERVAL", 0.0)
    (tmp_path / "other").mkdir()
    jobs = pairs(three, tmp_path)
    run_all([(jobs[0][0], jobs[2][1])], Serial())
    runs = jobs[0][0].study.n_runs

    made = run_all(
        jobs, Serial(), progress=lambda *_: Counting(runs + 1, (tmp_path / "b.h5").unlink)
    )
    assert [ending.code for ending in made] == [COMPLETE, FAILED, REFUSED]
    assert "b.h5: was removed" in made[1].why
    assert "another job" in made[2].why
    assert not [*tmp_path.glob("*.lock")]


def test_what_is_left_is_listed_and_the_worst_is_the_exit_code(three, tmp_path):
    run_all([(load_job(three[0]), tmp_path / "c.h5")], Serial())
    done = hpcsweep(0, "run", *three)
    assert done.returncode == 2
    assert "left: 1 of 3 jobs: c.h5" in done.stderr
    assert done.stderr.count(": complete") == 2


@together(
    "words, said",
    [
        (["a.toml", "b.toml", "a.toml"], "a.toml: is the same job as a.toml"),
        (["a.toml", "copy.toml"], "copy.toml: is the same job as a.toml"),
        (["a.toml", "named.toml"], "named.toml: has the file of a.toml, a.h5"),
        (["a.toml", "b.toml", "-o", "x.h5"], "-o x.h5: goes with one job"),
        (["a.toml", "none.toml"], "none.toml: cannot be read"),
    ],
)
def test_jobs_that_cannot_go_together_get_one_line(three, tmp_path, words, said):
    (tmp_path / "copy.toml").write_text(three[0].read_text())
    (tmp_path / "named.toml").write_text('name = "a"\n' + three[1].read_text())
    refused = hpcsweep(0, "run", *words)
    assert refused.returncode == 2
    assert said in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert not [*tmp_path.glob("*.h5*")]
