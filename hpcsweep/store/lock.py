"""Lock a file for one campaign; the system releases the lock when its holder dies.

``FILE.lock`` carries POSIX record locks, which work across nodes on NFS and on parallel file
systems, and names its holder. Rank 0 holds byte 0 exclusively: a second campaign is refused. Every
rank holds byte 1 shared: a rank that survived its killed campaign may still be writing, so a new
campaign waits until byte 1 is free. The system releases the locks of a dead process, also on
another node, so a file left behind by a kill locks nothing, whatever it says. On a file system
without locks (lockd not running, Lustre mounted without ``flock``) the existence of the file is the
lock, removed by hand after a crash; the message says so.
"""

import contextlib
import errno
import fcntl
import json
import os
import socket
import struct
import sys
import time
from pathlib import Path

from hpcsweep.job.paths import beside
from hpcsweep.store.layout import StoreError, reason, refusing
from hpcsweep.store.rows import open_above

ORPHAN_WAIT = 20.0
"""Seconds to wait for orphaned ranks of a killed campaign to end."""
UNSUPPORTED = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)
FLOCK = "hhqqi"
"""Linux's struct flock on 64 bits: type, whence, start, length, process."""
MASTER_BYTE, RANKS_BYTE = 0, 1
CLOSED = -1
"""Stands for a missing descriptor."""


class Lock:
    """The lock of one campaign file; `acquire` on rank 0, then `join` on every rank."""

    def __init__(self, path: Path):
        self._results = path
        self.path = beside(path, ".lock")
        self._descriptor = CLOSED
        self._by_existence = False

    def acquire(self, ranks: int, wait: float | None = None) -> None:
        """Take the campaign's lock.

        Parameters
        ----------
        ranks : int
        wait : float, optional
            Seconds to wait for orphaned ranks; default `ORPHAN_WAIT`.

        Raises
        ------
        StoreError
            If another process holds it; the message says which.
        """
        while True:
            with refusing(self._results, "written"):
                existed = self._open()
            if not self._take(MASTER_BYTE, existed):
                holder = self._holder()
                self._forget()
                gone = f"; if it is gone, remove {self.path}" if self._by_existence else ""
                raise StoreError(
                    f"{self._results}: another campaign is running on it ({holder}){gone}"
                )
            if self._by_existence or self._still_there():
                break
            self._forget()
        before = self._holder()
        self._say_who(ranks)
        self._wait_for_orphans(before, time.monotonic() + (ORPHAN_WAIT if wait is None else wait))

    def _open(self) -> bool:
        """Open the lock file, created if necessary; return whether it existed."""
        while True:
            with contextlib.suppress(FileExistsError):
                self._descriptor = open_above(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL)
                return False
            with contextlib.suppress(FileNotFoundError):
                self._descriptor = open_above(self.path, os.O_RDWR)
                return True

    def _wait_for_orphans(self, campaign: str, deadline: float) -> None:
        """Wait until no rank of the previous campaign holds its lock."""
        while not self._by_existence and not self._take(RANKS_BYTE, True):
            if time.monotonic() > deadline:
                process = self._process_holding(RANKS_BYTE)
                self._forget()
                raise StoreError(
                    f"{self._results}: ranks of a killed campaign are still writing to it "
                    f"({f'process {process}, of the campaign of ' if process else ''}{campaign}); "
                    "end them and run again"
                )
            time.sleep(0.05)
        if not self._by_existence:
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, RANKS_BYTE)

    def _process_holding(self, byte: int) -> int:
        """Return the process on this node that holds the lock of a byte, 0 if unknown."""
        if sys.platform != "linux" or struct.calcsize("l") != 8:
            return 0
        question = struct.pack(FLOCK, fcntl.F_WRLCK, os.SEEK_SET, byte, 1, 0)
        try:
            answer = fcntl.fcntl(self._descriptor, fcntl.F_GETLK, question)
        except OSError:
            return 0
        kind, *_, process = struct.unpack(FLOCK, answer)
        return max(process, 0) if kind != fcntl.F_UNLCK else 0

    def _say_who(self, ranks: int) -> None:
        """Write the holder of the lock into the file."""
        holder = {"host": socket.gethostname(), "pid": os.getpid(), "ranks": ranks}
        text = json.dumps(holder | {"since": time.strftime("%Y-%m-%d %H:%M:%S")})
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, text.encode(), 0)
        except OSError as error:
            self.release(remove=True)
            raise StoreError(f"{self.path}: cannot be written: {reason(error)}") from None

    def join(self) -> None:
        """Take the shared lock of a rank; on every rank, after `acquire`."""
        if self._descriptor == CLOSED:
            self._descriptor = open_above(self.path, os.O_RDWR)
        with contextlib.suppress(OSError):
            fcntl.lockf(self._descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB, 1, RANKS_BYTE)

    def release(self, remove: bool = False) -> None:
        """Release the lock; rank 0 removes the file, last of all."""
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
        """Return whether the locked file is the one under the name, not one just removed."""
        try:
            return os.fstat(self._descriptor).st_ino == self.path.stat().st_ino
        except FileNotFoundError:
            return False

    def _forget(self) -> None:
        if self._descriptor != CLOSED:
            os.close(self._descriptor)
            self._descriptor = CLOSED

    def _holder(self) -> str:
        try:
            holder = json.loads(os.pread(self._descriptor, 4096, 0))
            return (
                f"process {holder['pid']} on {holder['host']}, {holder['ranks']} ranks, "
                f"since {holder['since']}"
            )
        except (OSError, ValueError, KeyError, TypeError):
            return f"see {self.path}"
