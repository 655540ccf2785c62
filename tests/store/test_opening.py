"""A damaged file is refused in one line by everybody, and left as it is."""

import itertools
import json
import random
import shutil
from pathlib import Path

import fuzz
import h5py
import numpy as np
import pytest
from tools import SMALL, assert_same_datasets, hpcsweep

from hpcsweep import open_results
from hpcsweep.campaign import run as campaign
from hpcsweep.campaign.status import status
from hpcsweep.campaign.summary import summarize
from hpcsweep.checks.validate import validate
from hpcsweep.job import parse_job
from hpcsweep.parallel.mpi import Serial
from hpcsweep.store import DamagedError, StoreError, pack
from hpcsweep.store.journal import read_history

JOB = parse_job(SMALL.replace("count = 4", "count = 2"), "test", "test")
READERS = (open_results, status, summarize, pack)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "whole.h5"
    assert campaign.run(JOB, path, Serial()) == 0
    return path


@pytest.fixture
def copy(whole, tmp_path) -> Path:
    return Path(shutil.copy(whole, tmp_path / "copy.h5"))


def resume(path: Path) -> None:
    campaign.run(JOB, path, Serial())


def refused(path: Path, what: str, readers=READERS) -> None:
    """Check that readers and `run` refuse a file in one line, and `validate` calls it not sound."""
    before = path.read_bytes()
    for reader in (*readers, resume):
        with pytest.raises(DamagedError) as error:
            reader(path)
        assert str(error.value).startswith(f"{path}: ")
        assert what in str(error.value)
        assert len(str(error.value).splitlines()) == 1
    assert not validate(path, samples=0).sound
    assert path.read_bytes() == before


def flip(path: Path, offset: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[offset] ^= 1 << bit
    path.write_bytes(data)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omega", "amplitude", "point", "mode", "block"])
def test_a_flipped_bit_of_a_coordinate_is_refused(copy, name):
    with h5py.File(copy, "r") as file:
        offset = file[name].id.get_offset()
    flip(copy, offset + 1, 3)
    refused(copy, "checksum over them")


CHANGES = [
    (lambda file: file.attrs.__setitem__("hosts", "elsewhere"), "checksum over them"),
    (lambda file: file.attrs.__setitem__("job", file.attrs["job"] + "#"), "checksum over them"),
    (lambda file: file.attrs.__delitem__("metadata_checksum"), "checksum over them"),
    (lambda file: file.attrs.__delitem__("fingerprint"), "fingerprint"),
    (lambda file: file.attrs.__delitem__("job"), "job"),
    (lambda file: file.attrs.__delitem__("name"), "job"),
    (lambda file: file.attrs.__setitem__("mine", 1), "checksum over them"),
    (lambda file: file["cycles"].attrs.__setitem__("long_name", "rounds"), "checksum over them"),
    (lambda file: file["cycles"].attrs.__delitem__("units"), "checksum over them"),
    (lambda file: file.__delitem__("amplitude"), "amplitude: missing"),
    (lambda file: file.__delitem__("cycles"), "cycles: missing"),
    (lambda file: file.__setitem__("mine", 1), "mine: not part of the layout"),
    (lambda file: file.create_group("mine"), "mine: not part of the layout"),
]


@pytest.mark.parametrize(
    ("change", "what", "reader"),
    [(*case, reader) for case, reader in zip(CHANGES, itertools.cycle(READERS), strict=False)],
)
def test_what_is_not_as_it_was_made_is_refused(copy, change, what, reader):
    with h5py.File(copy, "r+") as file:
        change(file)
    refused(copy, what, [reader])


def test_no_more_memory_is_asked_for_than_the_job_needs(copy):
    with h5py.File(copy, "r+") as file:
        del file["drift"]
        file.create_dataset("drift", (2**20, 2**20, 11), "<f8", chunks=(1, 1, 11))
    refused(copy, "drift: ")


@pytest.mark.parametrize("place", ["length of a string", "size of a heap"])
def test_sizes_inside_the_file_are_not_believed(copy, place):
    raw = copy.read_bytes()
    heap = raw.index(b"GCOL")
    with h5py.File(copy, "r") as file:
        strings = file["state"].id.get_offset()
    flip(copy, strings + 3 if place == "length of a string" else heap + 12, 6)
    refused(copy, "has no size" if place == "size of a heap" else "no length")


@pytest.mark.slow
def test_damaged_bytes_of_metadata_at_random(whole, tmp_path):
    """The fuzzer's own cases, a few: any byte outside the results, one or many."""
    rng = random.Random(7)
    case = fuzz.Patient(tmp_path)
    tried = [case.metadata(rng) for _ in range(12)]
    assert [outcome for outcome in tried if outcome not in fuzz.ALLOWED] == []
    assert any("refused" in outcome for outcome in tried)


def write_journal(path: Path, *lines: bytes) -> None:
    Path(f"{path}.journal").write_bytes(b"".join(line + b"\n" for line in lines))


def test_a_journal_is_believed_where_it_is_one(copy):
    start = json.dumps({"kind": "start", "time": 1.0, "ranks": 2, "hosts": ["a"]}).encode()
    block = {"kind": "block", "time": 2.0, "rank": 0, "runs": 4, "seconds": 0.5}
    place = {"place": [0, 1, 2]}
    wrong = [
        {**block, "place": [0, -1, 2]},
        {**block, "place": [0, "x", 2]},
        {**block, **place, "seconds": [1]},
        {**block, **place, "runs": 0},
        {**block, **place, "seconds": float("nan")},
        {**block, **place, "time": "noon"},
        {"kind": ["block"], "time": 1.0},
        {"time": 1.0},
        [1, 2],
    ]
    far = {**block, "place": [0, 10**9, 2]}
    write_journal(
        copy,
        b"\xff\xfe\x00no text",
        start,
        b"[" * 5000,
        b"9" * 5000,
        *(json.dumps(record).encode() for record in wrong),
        json.dumps({**block, **place}).encode(),
        json.dumps(far).encode(),
        start[:20],
    )
    history = read_history(copy)
    assert len(history.sessions) == 1
    assert [cost.place for cost in history.costs] == [(0, 1, 2), (0, 10**9, 2)]
    state = status(copy)
    assert state["core_seconds"] == 1.0
    assert summarize(copy)["cost"]["core_seconds"] == 1.0
    assert campaign.run(JOB, copy, Serial()) == 0


def test_a_code_without_a_meaning_is_not_believed(tmp_path, whole):
    """Even under a checksum that holds: every reader would have to know what it does not."""
    path = tmp_path / "coded.h5"
    shutil.copy(whole, path)
    fuzz.forge(path, "outcome", 77)
    assert int(open_results(path)["outcome"].max()) <= 4
    assert summarize(path)["runs_done"] < status(path)["runs_total"]
    assert not validate(path, samples=0).sound
    assert campaign.run(JOB, path, Serial()) == 0
    assert_same_datasets(path, whole)


def test_the_commands_say_it_in_one_line(copy, tmp_path):
    with h5py.File(copy, "r+") as file:
        file["amplitude"][2] = 0.5
    for command in (("status",), ("summary",), ("plot",), ("explore",), ("pack",)):
        done = hpcsweep(0, *command, copy)
        assert done.returncode == 2, (command, done.stderr)
        assert len(done.stderr.splitlines()) == 1, (command, done.stderr)
        assert "put a whole copy in its place, or move it away and run its job again" in done.stderr
    shown = hpcsweep(0, "validate", copy)
    assert shown.returncode == 1
    assert "NOT SOUND" in shown.stdout
    assert np.isfinite(copy.stat().st_size)


def test_a_heap_without_an_end_is_refused(copy):
    """HDF5 goes round in it for ever: free room of no size, where a string was."""
    data = bytearray(copy.read_bytes())
    heap = data.index(b"GCOL")
    data[heap + 16 : heap + 32] = bytes(16)
    copy.write_bytes(data)
    with pytest.raises(StoreError, match="a heap of strings has no end"):
        open_results(copy)
