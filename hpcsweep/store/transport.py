"""Write into the shared file from every rank, in one of two ways with the same bytes.

``offset`` writes at the datasets' byte offsets through MPI-IO (through plain ``pwrite`` where there
is one rank), which needs no parallel HDF5. ``mpio`` writes through h5py's driver of that name,
where h5py was built with MPI. Each rank opens MPI-IO files on its own communicator, so that no
call waits for another rank; ``sync`` flushes what this rank wrote to the disk.
"""

import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.store.layout import StoreError, WriteError
from hpcsweep.store.offsets import Offsets, open_above

ENVIRONMENT = "HPCSWEEP_TRANSPORT"
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)


def _reason(error: Exception) -> str:
    """Return the system's reason of a failed write; MPI hides it in an error stack."""
    text = on_one_line(error)
    causes = [os.strerror(code) for code in DISK_ERRORS]
    return next((cause for cause in causes if cause in text), text)


class Transport(ABC):
    """Interface for the commit protocol.

    Parameters
    ----------
    path : Path
    """

    name: str

    def __init__(self, path: Path):
        self._path = path

    def write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        """Write `rows` at index `start` of a variable, with all later axes whole.

        Raises
        ------
        WriteError
            If the system cannot; also in `sync`. MPI's errors are RuntimeErrors.
        """
        self._guarded(self._write, variable, start, np.ascontiguousarray(rows))

    def sync(self) -> None:
        """Return once everything this rank wrote is on disk."""
        self._guarded(self._sync)

    def _guarded(self, action: Callable[..., None], *arguments: Any) -> None:
        try:
            action(*arguments)
        except (OSError, RuntimeError) as error:
            raise WriteError(
                f"{self._path}: cannot be written: {_reason(error)}; what is committed is safe: "
                "make room and run again to resume"
            ) from None

    @abstractmethod
    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None: ...

    @abstractmethod
    def _sync(self) -> None: ...

    @abstractmethod
    def close(self) -> None:
        """Close (collective)."""


class PosixTransport(Transport):
    """``pwrite`` at byte offsets: one rank."""

    name = "pwrite"

    def __init__(self, path: Path):
        super().__init__(path)
        self._offsets = Offsets(path)
        self._descriptor = open_above(path, os.O_RDWR)

    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        data, offset = memoryview(rows.data).cast("B"), self._offsets.at(variable, start)
        while data:
            written = os.pwrite(self._descriptor, data, offset)
            data = data[written:]
            offset += written

    def _sync(self) -> None:
        """Flush all pages of the file on this node to disk."""
        os.fsync(self._descriptor)

    def close(self) -> None:
        """Close."""
        os.close(self._descriptor)


class MpiIoTransport(Transport):
    """``MPI.File.Write_at`` at byte offsets: plain h5py, any MPI."""

    name = "offset"

    def __init__(self, path: Path):
        from hpcsweep.parallel.mpi import open_file

        super().__init__(path)
        self._offsets = Offsets(path)
        self._file = open_file(path)

    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        self._file.Write_at(self._offsets.at(variable, start), rows.view(np.uint8).reshape(-1))

    def _sync(self) -> None:
        self._file.Sync()

    def close(self) -> None:
        """Close."""
        self._file.Close()


class MpioTransport(PosixTransport):
    """h5py's ``mpio`` driver: needs h5py built with MPI."""

    name = "mpio"

    def __init__(self, path: Path, comm):
        super().__init__(path)
        self._file = h5py.File(path, "r+", driver="mpio", comm=comm.raw)

    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        self._file[variable][(*start[:-1], slice(start[-1], start[-1] + len(rows)))] = rows

    def close(self) -> None:
        """Close (collective)."""
        super().close()
        self._file.close()


def check_transport() -> str:
    """Return the transport that ``HPCSWEEP_TRANSPORT`` requests, '' if none.

    Raises
    ------
    StoreError
        If it is not available.
    """
    requested = os.environ.get(ENVIRONMENT, "")
    if requested not in ("", "offset", "mpio"):
        raise StoreError(f"{ENVIRONMENT} = {requested!r}: must be offset or mpio")
    if requested == "mpio" and not h5py.get_config().mpi:
        raise StoreError(f"{ENVIRONMENT} = 'mpio': this h5py was built without MPI")
    return requested


def open_transport(path: Path, comm) -> Transport:
    """Open the file for writing on every rank.

    ``HPCSWEEP_TRANSPORT`` may request ``offset`` or ``mpio``; otherwise ``mpio`` is used where h5py
    has MPI and there is more than one rank.

    Raises
    ------
    StoreError
        If the requested transport is not available.
    """
    requested, able = check_transport(), h5py.get_config().mpi
    if comm.size == 1:
        return PosixTransport(path)
    if requested == "mpio" or (able and not requested):
        return MpioTransport(path, comm)
    return MpiIoTransport(path)
