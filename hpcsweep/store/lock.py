"""One campaign a file: a lock that the system releases when its holder dies.

``FILE.lock`` carries POSIX record locks, which work across nodes on NFS and on the parallel file
systems, and says who holds it. Rank 0 holds byte 0 exclusively: a second campaign is refused.
Every rank holds byte 1 shared: a rank that survived its killed campaign may still be writing, so
that a new campaign waits until byte 1 is free. On a file system without locks the file's mere
existence is the lock, given up by hand after a crash.
"""

import contextlib
import errno
import fcntl
import json
import os
import socket
import time
from pathlib import Path

from hpcsweep.store.layout import StoreError

ORPHAN_WAIT = 20.0
"""Seconds to wait for orphaned ranks of a killed campaign to end."""
UNSUPPORTED = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)
MASTER_BYTE, RANKS_BYTE = 0, 1


class Lock:
    """The lock of one campaign file; `acquire` on rank 0, then `join` on every rank."""

    def __init__(self, path: Path):
        self._results = path
        self.path = path.with_name(path.name + ".lock")
        self._descriptor: int | None = None
        self._by_existence = False

    def acquire(self, ranks: int, wait: float = ORPHAN_WAIT) -> None:
        """Take the campaign's lock.

        Raises
        ------
        StoreError
            If somebody else holds it; the message says who.
        """
        while True:
            try:
                existed = self.path.exists()
                self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except OSError as error:
                raise StoreError(f"{self._results}: cannot be written: {error.strerror}") from None
            if not self._take(MASTER_BYTE, existed):
                holder = self._holder()
                self._forget()
                raise StoreError(f"{self._results}: another campaign is running on it ({holder})")
            if self._by_existence or self._still_there():
                break
            self._forget()
        deadline = time.monotonic() + wait
        while not self._by_existence and not self._take(RANKS_BYTE, True):
            if time.monotonic() > deadline:
                holder = self._holder()
                self._forget()
                raise StoreError(
                    f"{self._results}: ranks of a killed campaign are still writing to it "
                    f"({holder}); end them and run again"
                )
            time.sleep(0.05)
        if not self._by_existence:
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, RANKS_BYTE)
        text = json.dumps(
            {
                "host": socket.gethostname(),
                "pid": os.getpid(),
                "ranks": ranks,
                "since": time.strftime("%Y-%m-%d %H:%M:%S"),
            }
        )
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, text.encode(), 0)
        except OSError as error:
            self.release(remove=True)
            raise StoreError(f"{self.path}: cannot be written: {error.strerror}") from None

    def join(self) -> None:
        """Hold the lock of a rank; after `acquire`, on every rank."""
        if self._descriptor is None:
            self._descriptor = os.open(self.path, os.O_RDWR)
        with contextlib.suppress(OSError):
            fcntl.lockf(self._descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB, 1, RANKS_BYTE)

    def release(self, remove: bool = False) -> None:
        """Give up the lock; rank 0 removes the file, last of all."""
        if remove:
            with contextlib.suppress(OSError):
                self.path.unlink()
        self._forget()

    def _take(self, byte: int, existed: bool) -> bool:
        try:
            fcntl.lockf(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
        except OSError as error:
            if error.errno in UNSUPPORTED:
                self._by_existence = True
                return not existed
            return False
        return True

    def _still_there(self) -> bool:
        """Tell whether the locked file is the one under the name (not one just removed)."""
        try:
            return os.fstat(self._descriptor).st_ino == self.path.stat().st_ino
        except FileNotFoundError:
            return False

    def _forget(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _holder(self) -> str:
        try:
            holder = json.loads(os.pread(self._descriptor, 4096, 0))
            return (
                f"process {holder['pid']} on {holder['host']}, {holder['ranks']} ranks, "
                f"since {holder['since']}"
            )
        except (OSError, ValueError, KeyError, TypeError):
            return f"see {self.path}"
