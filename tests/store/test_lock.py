"""The lock of a results file: who holds it is told, and what is left behind locks nothing."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest
from together import together
from tools import forked, hpcsweep, refuse

from hpcsweep.store import Journal, Lock, StoreError
from hpcsweep.store import lock as lock_module

HOLDER = """
import fcntl, os, sys, time
descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
fcntl.lockf(descriptor, fcntl.LOCK_SH, 1, int(sys.argv[2]))
print("held", flush=True)
time.sleep(60)
"""


def hold(path: Path, byte: int) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, path, str(byte)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    return process


def test_an_orphaned_rank_is_waited_for_and_named(tmp_path):
    path = tmp_path / "a.h5"
    first = Lock(path)
    first.acquire(4)
    first.release()
    orphan = hold(first.path, lock_module.RANKS_BYTE)
    try:
        with pytest.raises(StoreError) as refused:
            Lock(path).acquire(2, wait=0.1)
        assert f"process {orphan.pid}, of the campaign of process {os.getpid()}" in str(
            refused.value
        )
        assert "4 ranks" in str(refused.value)
    finally:
        orphan.kill()
        orphan.communicate()
    second = Lock(path)
    second.acquire(2, wait=5.0)
    second.release(remove=True)
    assert not second.path.exists()


def test_a_campaign_through_a_link_has_the_lock_and_the_journal_of_the_file(small_job, tmp_path):
    path, link = tmp_path / "a.h5", tmp_path / "other" / "link.h5"
    link.parent.mkdir()
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    link.symlink_to(path)
    assert Lock(link).path == Lock(path).path
    assert Journal(link).path == Journal(path).path
    assert Journal(path).path.exists()
    (tmp_path / "a.h5.lock").touch()
    holder = hold(tmp_path / "a.h5.lock", lock_module.MASTER_BYTE)
    try:
        done = hpcsweep(0, "run", small_job, "-o", link)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
        assert "another campaign is running on it" in done.stderr
    finally:
        holder.kill()
        holder.communicate()


@together("text", ["", "not JSON", '{"pid": 1}', "[1, 2]", "\0" * 9])
def test_a_lock_file_left_behind_locks_nothing_whatever_it_says(tmp_path, text):
    path = tmp_path / "a.h5"
    (tmp_path / "a.h5.lock").write_text(text)
    lock = Lock(path)
    lock.acquire(1, wait=0.0)
    assert f'"pid": {os.getpid()}' in lock.path.read_text()
    lock.release(remove=True)
    holder = hold(lock.path, lock_module.MASTER_BYTE)
    lock.path.write_text(text)
    try:
        with pytest.raises(StoreError, match="another campaign is running on it"):
            Lock(path).acquire(1)
    finally:
        holder.kill()
        holder.communicate()


def test_without_locks_the_lock_file_is_the_lock_and_the_remedy_is_told(tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError(lock_module.errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "lockf", unsupported)
    path = tmp_path / "a.h5"
    first = Lock(path)
    first.acquire(3)
    first.join()
    with pytest.raises(StoreError) as refused:
        Lock(path).acquire(1)
    assert f"process {os.getpid()}" in str(refused.value)
    assert f"if it is gone, remove {path}.lock" in str(refused.value)
    first.release(remove=True)
    Lock(path).acquire(1)


def test_a_second_campaign_is_refused_and_writes_nothing(tmp_path, small_job):
    path = tmp_path / "small.h5"
    assert hpcsweep(0, "run", small_job, "-o", path).returncode == 0
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    lock = Lock(path)
    lock.acquire(7)
    refused = forked("run", small_job, "-o", path)
    refuse(refused, "small.h5", "another campaign", f"process {os.getpid()} on", "7 ranks, since 2")
    lock.release(remove=True)
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before
