"""A disk that takes no more, and what writing costs."""

import json
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from tools import SMALL, assert_same_datasets, hpcsweep, run_script

from hpcsweep.job import parse_job
from hpcsweep.store import Layout, Lock, StoreError, WriteError
from hpcsweep.store.commit import Campaign
from hpcsweep.store.contents import create
from hpcsweep.store.rows import Transport

FULL = """
import resource, sys
from hpcsweep.campaign import run as campaign; from hpcsweep.commands import cli
opened = campaign.store.open_campaign
def on_a_full_disk(*arguments):
    # from here on, no byte can be written at or after this place in a file
    resource.setrlimit(resource.RLIMIT_FSIZE, (@, @))
    return opened(*arguments)
campaign.store.open_campaign = on_a_full_disk
if __name__ == "__main__":  # not in a process that compiles
    sys.exit(cli.main(sys.argv[1:]))
"""


def run_on_a_full_disk(folder: Path, ranks: int, limit: int, *arguments):
    script = folder / "full.py"
    script.write_text(FULL.replace("@", str(limit)))
    return run_script(ranks, script, *arguments)


def journal(path: Path, kind: str) -> list[dict]:
    records = map(json.loads, Path(f"{path}.journal").read_text().splitlines())
    return [record for record in records if record["kind"] == kind]


def wait_until_nobody_writes(path: Path) -> None:
    """Ranks, the first among them, may outlive their mpirun by some tenths of a second."""
    lock, deadline = Lock(path), time.monotonic() + 30
    while True:
        try:
            lock.acquire(1)
        except StoreError:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        else:
            lock.release(remove=True)
            return


@pytest.mark.slow
@pytest.mark.parametrize(
    "ranks", [pytest.param(0, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.mpi)]
)
def test_a_full_disk_takes_one_line_and_the_run_goes_on_when_there_is_room(
    tmp_path, small_job, ranks
):
    path, whole = tmp_path / "full.h5", tmp_path / "whole.h5"
    assert hpcsweep(0, "run", small_job, "-o", whole).returncode == 0
    job = parse_job(SMALL, "test", "small")
    notes = {
        "hpcsweep_version": "",
        "git_commit": "",
        "libraries": "",
        "mpi": "",
        "hosts": "",
        "history": "",
    }
    create(path, Layout(job), {**notes, "ranks": 1, "created": ""})
    with h5py.File(path, "r") as file:
        # what lies last in the file: sweeps up can be written, sweeps down cannot
        per_run = [file[variable.name].id for variable in Layout(job).variables]
        last = max(per_run, key=lambda data: data.get_offset())
        assert last.get_offset() > file["commit"].id.get_offset()
        downs = last.get_offset() + last.get_storage_size() // 2
        data = file["poincare"].id.get_offset() + file["poincare"].nbytes // 2
    for limit, most in ((data, 0), (downs, 6)):
        done = run_on_a_full_disk(tmp_path, ranks, limit, "run", small_job, "-o", path)
        assert done.returncode not in (0, 2, 75)
        if not ranks:
            assert done.returncode == 1
        assert "Traceback" not in done.stderr
        ours = [line for line in done.stderr.splitlines() if line.startswith("hpcsweep: error: ")]
        assert 1 <= len(ours) <= max(ranks, 1)
        assert str(path) in ours[0]
        assert "cannot be written" in ours[0]
        assert "make room and run again" in ours[0]
        wait_until_nobody_writes(path)
        with h5py.File(path, "r") as file:
            kept = set(map(tuple, np.argwhere(file["commit"][...]).tolist()))
        assert len(kept) <= most
        assert all(direction == 0 and frame < 2 for direction, frame, _ in kept)
    if not ranks:
        # after the sweep up of the first frame comes its sweep down
        assert kept == {(0, 0, 0), (0, 0, 1), (0, 0, 2)}
    sound = hpcsweep(0, "validate", path, "--samples", 0)
    assert sound.returncode == 0, sound.stdout
    assert f"{len(kept)} of 24 committed" in sound.stdout
    before = len(journal(path, "block"))
    done = hpcsweep(ranks, "run", small_job, "-o", path)
    assert done.returncode == 0, done.stderr
    again = {tuple(b["place"]) for b in journal(path, "block")[before:]}
    assert not again & kept
    assert len(again) == 24 - len(kept)
    assert_same_datasets(path, whole)


class Forgetful(Transport):
    """A transport whose first flush fails, as a disk's does, and whose second does not."""

    def __init__(self, path):
        super().__init__(path)
        self.written: list[str] = []
        self.flushes = 0

    def write(self, variable, start, rows) -> None:
        self.written.append(variable)

    def sync(self) -> None:
        self.flushes += 1
        if self.flushes == 1:
            raise WriteError("lost")


def test_checksums_of_a_failed_flush_are_never_written(tmp_path):
    layout = Layout(parse_job(SMALL, "test", "small"))
    path = tmp_path / "a.h5"
    create(path, layout, {})
    transport = Forgetful(path)
    campaign = Campaign(path, layout, transport)
    (block, *_) = layout.study.path(0)
    campaign.write_block(block, layout.study.initial_state, campaign.blocks.read(block))
    with pytest.raises(WriteError, match="lost"):
        campaign.flush()
    campaign.flush()
    campaign.close()
    assert "drift" in transport.written
    assert "commit" not in transport.written


def test_a_disk_with_no_room_for_the_whole_file_is_found_before_the_start(tmp_path, monkeypatch):
    class Usage:
        free = 1000

    monkeypatch.setattr("shutil.disk_usage", lambda folder: Usage)
    with pytest.raises(StoreError, match=r"the results need .* kB, the file system has 1 kB free"):
        create(tmp_path / "a.h5", Layout(parse_job(SMALL, "test", "small")), {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("ranks", "transport"), [(0, "pwrite"), pytest.param(2, "offset", marks=pytest.mark.slow)]
)
def test_status_tells_by_what_the_ranks_write(tmp_path, small_job, monkeypatch, ranks, transport):
    path = tmp_path / "small.h5"
    monkeypatch.setenv("HPCSWEEP_TRANSPORT", "offset")
    done = hpcsweep(ranks, "run", small_job, "-o", path)
    assert done.returncode == 0, done.stderr
    (session,) = json.loads(hpcsweep(0, "status", path, "--json").stdout)["sessions"]
    assert session["transport"] == transport
    assert f"{transport}: complete" in hpcsweep(0, "status", path).stdout


def test_sessions_are_paired_with_their_own_ends(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    file = Path(f"{path}.journal")
    killed = json.dumps({"kind": "start", "time": 0.0, "ranks": 7, "hosts": ["a"]})
    file.write_text(killed + "\n" + file.read_text())
    first, second = json.loads(hpcsweep(0, "status", path, "--json").stdout)["sessions"]
    assert (first["ranks"], first["ended"]) == (7, None)
    assert (second["ranks"], second["ended"]) == (1, "complete")
