"""A file that goes away in mid-run, places where none can be, and stops before the first run."""

import os
import time
from pathlib import Path

import faults
import h5py
import pytest
from tools import SMALL, hpcsweep

from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.progress import Silent
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.parallel.stopping import StopFlag
from hpcsweep.store import StoreError, WriteError

JOB = parse_job(SMALL, "test", "test")
MANY = (
    SMALL.replace("count = 4}", "count = 2}")
    .replace("{from = 0.02, to = 0.3, count = 11}", "{from = 0.02, to = 0.3, count = 1000000}")
    .replace("block = 4", "block = 1\npoincare = false")
)


def replace(path: Path) -> None:
    path.rename(f"{path}.other")
    path.write_bytes(Path(f"{path}.other").read_bytes())


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (Path.unlink, "removed, renamed or replaced"),
        (lambda path: path.rename(f"{path}.other"), "removed, renamed or replaced"),
        (replace, "removed, renamed or replaced"),
        (lambda path: os.truncate(path, 4000), "cut short|the file ends inside"),
    ],
)
@pytest.mark.parametrize("moment", [1, 24])
def test_no_campaign_is_complete_without_its_file(tmp_path, change, what, moment):
    path = tmp_path / "out.h5"

    class Display(Silent):
        blocks = 0

        def advance(self, runs):
            self.blocks += 1
            if self.blocks == moment:
                change(path)

    with pytest.raises(WriteError, match=what) as error:
        campaign.run(JOB, path, Serial(), progress=lambda *_: Display())
    assert str(error.value).startswith(f"{path}: ")
    assert not Path(f"{path}.lock").exists()


def left_behind(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix != ".toml")


@pytest.mark.slow
def test_a_place_that_cannot_be_leaves_nothing_behind(tmp_path, small_job):
    fifo, link = tmp_path / "fifo.h5", tmp_path / "link.h5"
    os.mkfifo(fifo)
    link.symlink_to(tmp_path / "nowhere.h5")
    before = left_behind(tmp_path)
    cases = {
        "": "must not be empty",
        str(fifo): "fifo.h5: is no regular file",
        str(link): "link.h5: is a link that leads nowhere",
        str(tmp_path / ("x" * 250)): "its name is too long: 247 bytes",
        str(tmp_path): "is a folder",
        "/dev/null": "/dev/null: is no regular file",
    }
    for output, what in cases.items():
        done = hpcsweep(0, "run", small_job, "-o", output, cwd=tmp_path)
        assert done.returncode == 2, (output, done.stderr)
        assert len(done.stderr.splitlines()) == 1
        assert what in done.stderr
        assert left_behind(tmp_path) == before
    done = hpcsweep(0, "run", small_job, "-o", tmp_path / "a.h5", HPCSWEEP_TRANSPORT="post")
    assert done.returncode == 2
    assert left_behind(tmp_path) == before
    for command in ("status", "summary", "validate", "plot", "explore", "pack"):
        done = hpcsweep(0, command, fifo)
        assert done.returncode == 2
        assert "fifo.h5: cannot be read: it is no regular file" in done.stderr


@pytest.mark.slow
def test_a_scan_of_two_million_blocks_stops_and_takes_little_memory(tmp_path):
    job = parse_job(MANY, "test", "test")
    path = tmp_path / "many.h5"
    flag = StopFlag()
    flag.reason = "SIGTERM"
    flag.at_once = lambda reason: None
    from hpcsweep.campaign.work import scan
    from hpcsweep.parallel import memory
    from hpcsweep.store import Layout
    from hpcsweep.store.commit import Blocks
    from hpcsweep.store.contents import create

    create(path, Layout(job), {})
    with h5py.File(path, "r+") as file:
        file["commit"][...] = 1
    with Blocks(path, Layout(job)) as blocks:
        begun = time.monotonic()
        assert not scan(Serial(), blocks, flag, print).finished
        assert time.monotonic() - begun < 10.0
        before = memory.peak()
        with StopFlag(deadline=time.time() + 1.0) as late:
            assert not scan(Serial(), blocks, late, print).finished
        assert time.monotonic() - begun < 30.0
        assert memory.peak() - before < 100e6


def test_a_scan_verifies_only_tasks_of_which_the_file_holds_a_part(tmp_path, monkeypatch):
    from hpcsweep.campaign.work import scan
    from hpcsweep.store import Layout
    from hpcsweep.store.commit import Blocks
    from hpcsweep.store.contents import create

    points = MANY.replace("1000000", "500").replace("[sweep]", '[study]\nkind = "points"\n[sweep]')
    job = parse_job(points + "[vary]\nstructure.gap = [0.5, 1.0, 2.0]\n", "test", "test")
    path = tmp_path / "points.h5"
    create(path, Layout(job), {})
    verified = []
    verify = Blocks.verify
    monkeypatch.setattr(Blocks, "verify", lambda *args: verified.append(args[1]) or verify(*args))
    with StopFlag() as flag, Blocks(path, Layout(job)) as blocks:
        fresh = scan(Serial(), blocks, flag, print)
        assert verified == []
        assert fresh.todo == list(range(job.study.n_tasks)) == list(range(3000))
        # a block that is there, and one whose checksum does not hold
        good, bad = (job.study.block(place) for place in ((0, 0, 1, 7), (2, 0, 0, 499)))
        rows = job.study.compute(good, job.study.initial_state)
        whole = blocks.checksum(good, job.study.initial_state, rows)
        with h5py.File(path, "r+") as file:
            for name, values in rows.items():
                file[name][good.runs] = values
            file["commit"][good.place], file["commit"][bad.place] = whole, 1
        again = scan(Serial(), blocks, flag, print)
        assert verified == [507, 2499]
        assert (again.done_runs, again.finished) == (1, True)
        assert again.todo == [task for task in range(3000) if task != 507]


def test_a_job_too_large_for_its_blocks_is_refused():
    from hpcsweep.job import JobError

    text = MANY.replace("count = 2}", "count = 20000}")
    with pytest.raises(JobError, match=r"output\.block"):
        parse_job(text, "test", "test")


def test_a_damaged_file_is_not_made_anew_where_another_lies(tmp_path):
    path = tmp_path / "text.h5"
    path.write_text("no HDF5")
    with pytest.raises(StoreError, match="not an HDF5 file"):
        campaign.run(JOB, path, Serial())
    assert path.read_text() == "no HDF5"


def test_no_room_for_the_file_is_one_line_and_leaves_nothing(tmp_path, small_job):
    process = faults.start(0, "run", small_job, "-o", tmp_path / "a.h5", file_limit=4096)
    code, _, errors = process.finish()
    assert code == 2
    assert errors.splitlines() == [
        f"hpcsweep: error: {tmp_path / 'a.h5'}: cannot be created: File too large"
    ]
    assert [p.name for p in tmp_path.iterdir()] == ["small.toml"]
