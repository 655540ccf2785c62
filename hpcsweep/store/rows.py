"""Rows of the campaign file: where they are in it, how they are read, and written from every rank.

Reading needs no HDF5 but where the file is packed. Of two ways of writing, with the same bytes,
``offset`` writes at the datasets' byte offsets through MPI-IO (through plain ``pwrite`` where there
is one rank), which needs no parallel HDF5. ``mpio`` writes through h5py's driver of that name,
where h5py was built with MPI. Each rank opens MPI-IO files on its own communicator, so that no
call waits for another rank; ``sync`` flushes what this rank wrote to the disk.
"""

import contextlib
import errno
import fcntl
import math
import os
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.store.contents import place_of
from hpcsweep.store.layout import DamagedError, StoreError, WriteError

ENVIRONMENT = "HPCSWEEP_TRANSPORT"
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
LAST_STREAM = 2
"""Descriptor of standard error."""


def open_for_reading(path: Path) -> h5py.File:
    """Open a file for reading that may be open elsewhere, even for writing.

    Reading needs no lock, and HDF5 refuses a file that it has open with other lock settings.
    """
    try:
        return h5py.File(path, "r", locking=False)
    except OSError as error:
        if "lock" not in str(error):
            raise
        return h5py.File(path, "r")


def open_above(path: Path, flags: int) -> int:
    """Open a file under a descriptor above those of the standard streams, even if they are closed.

    Output of the interpreter or of MPI must never reach a results file.
    """
    descriptor = os.open(path, flags, 0o666)
    if descriptor > LAST_STREAM:
        return descriptor
    try:
        return fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, LAST_STREAM + 1)
    finally:
        os.close(descriptor)


class Offsets:
    """Byte offset, shape and type of every dataset of a file."""

    def __init__(self, path: Path):
        self._of: dict[str, tuple[int, tuple[int, ...], np.dtype]] = {}
        with open_for_reading(path) as file:
            for name, data in file.items():
                if data.is_scale:
                    continue
                place = place_of(data)
                if place is None:
                    raise StoreError(f"{path}: variable {name} has no place in the file")
                self._of[name] = (place, data.shape, data.dtype)

    def at(self, variable: str, start: tuple[int, ...]) -> int:
        """Return the byte offset of index `start`, with later axes at 0."""
        offset, shape, dtype = self._of[variable]
        place = 0
        # a tenth of the time of `ravel_multi_index`
        for index, size in zip(start, shape, strict=False):
            if not 0 <= index < size:
                raise ValueError(f"{variable}: {start} is outside {shape}")
            place = place * size + int(index)
        return offset + place * math.prod(shape[len(start) :]) * dtype.itemsize

    def extent(
        self, variable: str, start: tuple[int, ...], n: int
    ) -> tuple[int, int, tuple[int, ...], np.dtype]:
        """Return offset, bytes, shape and type of `n` rows of a variable from index `start`."""
        _, shape, dtype = self._of[variable]
        shape = (n, *shape[len(start) :])
        return self.at(variable, start), math.prod(shape) * dtype.itemsize, shape, dtype


class ContiguousRows(Offsets):
    """Rows of a plain file, read without HDF5, so that what others write is seen at once."""

    def __init__(self, path: Path, flags: int = os.O_RDONLY):
        super().__init__(path)
        self._path = path
        self._descriptor = open_above(path, flags)
        self._size = os.fstat(self._descriptor).st_size

    def read(self, variable: str, start: tuple[int, ...], n: int) -> np.ndarray:
        """Read `n` rows of a variable's last indexed axis from index `start`.

        Raises
        ------
        DamagedError
            If the file ends inside them.
        """
        offset, size, shape, dtype = self.extent(variable, start, n)
        data = bytearray()
        while len(data) < size:
            piece = os.pread(self._descriptor, size - len(data), offset + len(data))
            if not piece:
                raise DamagedError(self._path, f"the file ends inside variable {variable}")
            data += piece
        return np.frombuffer(bytes(data), dtype).reshape(shape)

    def check_identity(self) -> None:
        """Make sure that the file is the one that was opened, under its name and whole.

        What is written into one that was removed is lost.

        Raises
        ------
        WriteError
        """
        mine = os.fstat(self._descriptor)
        try:
            there = self._path.stat()
        except OSError:
            there = None
        if there is None or (mine.st_dev, mine.st_ino) != (there.st_dev, there.st_ino):
            what = "removed, renamed or replaced"
        elif mine.st_size < self._size:
            what = "cut short"
        else:
            return
        raise WriteError(
            f"{self._path}: was {what} while it was being written; what was computed is not in it"
        )

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)


class PackedRows:
    """Rows of a packed file, which is never written."""

    def __init__(self, path: Path):
        self._path = path
        self._file = open_for_reading(path)

    def read(self, variable: str, start: tuple[int, ...], n: int) -> np.ndarray:
        """Read rows; see `ContiguousRows.read`.

        Raises
        ------
        DamagedError
            If a chunk cannot be unpacked.
        """
        try:
            return self._file[variable][(*start[:-1], slice(start[-1], start[-1] + n))]
        except Exception:  # HDF5 raises errors of any kind on damaged bytes
            raise DamagedError(
                self._path, f"variable {variable} cannot be unpacked; put a whole copy in its place"
            ) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def is_packed(path: Path) -> bool:
    """Return whether a campaign file is packed."""
    with open_for_reading(path) as file:
        return file["commit"].chunks is not None


def _reason(error: Exception) -> str:
    """Return the system's reason of a failed write; MPI hides it in an error stack."""
    text = on_one_line(error)
    causes = [os.strerror(code) for code in DISK_ERRORS]
    return next((cause for cause in causes if cause in text), text)


class Transport(ContiguousRows):
    """Rows of a plain file that one rank writes, by ``pwrite``; the others differ in how."""

    name = "pwrite"

    def __init__(self, path: Path):
        super().__init__(path, os.O_RDWR)

    def write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        """Write `rows` at index `start` of a variable, with all later axes whole.

        Raises
        ------
        WriteError
            If the system cannot; also in `sync`. MPI's errors are RuntimeErrors.
        """
        with self._guarded():
            self._write(variable, start, np.ascontiguousarray(rows))

    def sync(self) -> None:
        """Return once everything this rank wrote is on disk."""
        with self._guarded():
            self._sync()

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError) as error:
            raise WriteError.of(self._path, _reason(error)) from None

    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        data, offset = memoryview(rows.data).cast("B"), self.at(variable, start)
        while data:
            written = os.pwrite(self._descriptor, data, offset)
            data = data[written:]
            offset += written

    def _sync(self) -> None:
        """Flush all pages of the file on this node to disk."""
        os.fsync(self._descriptor)


class MpiIoTransport(Transport):
    """``MPI.File.Write_at`` at byte offsets: plain h5py, any MPI."""

    name = "offset"

    def __init__(self, path: Path):
        from hpcsweep.parallel.mpi import open_file

        super().__init__(path)
        self._file = open_file(path)

    def _write(self, variable: str, start: tuple[int, ...], rows: np.ndarray) -> None:
        self._file.Write_at(self.at(variable, start), rows.view(np.uint8).reshape(-1))

    def _sync(self) -> None:
        self._file.Sync()

    def close(self) -> None:
        """Close."""
        super().close()
        self._file.Close()


class MpioTransport(Transport):
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
        return Transport(path)
    if requested == "mpio" or (able and not requested):
        return MpioTransport(path, comm)
    return MpiIoTransport(path)
