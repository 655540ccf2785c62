"""Offsets of the file's variables, and readers of their rows."""

import fcntl
import math
import os
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.contents import place_of
from hpcsweep.store.layout import DamagedError, StoreError, WriteError

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
        self._strides = {
            name: [math.prod(shape[axis + 1 :]) * dtype.itemsize for axis in range(len(shape))]
            for name, (_, shape, dtype) in self._of.items()
        }

    def at(self, variable: str, start: tuple[int, ...]) -> int:
        """Return the byte offset of index `start`, with later axes at 0."""
        offset, shape, _ = self._of[variable]
        # a twentieth of the time of `ravel_multi_index`
        for index, size, stride in zip(start, shape, self._strides[variable], strict=False):
            if not 0 <= index < size:
                raise ValueError(f"{variable}: {start} is outside {shape}")
            offset += int(index) * stride
        return offset

    def extent(
        self, variable: str, start: tuple[int, ...], n: int
    ) -> tuple[int, int, tuple[int, ...], np.dtype]:
        """Return offset, bytes, shape and type of `n` rows of a variable from index `start`."""
        _, shape, dtype = self._of[variable]
        shape = (n, *shape[len(start) :])
        return self.at(variable, start), math.prod(shape) * dtype.itemsize, shape, dtype


class ContiguousRows:
    """Rows of a plain file, read without HDF5, so that what others write is seen at once."""

    def __init__(self, path: Path):
        self._path = path
        self.offsets = Offsets(path)
        self._descriptor = open_above(path, os.O_RDONLY)
        self._size = os.fstat(self._descriptor).st_size

    def read(self, variable: str, start: tuple[int, ...], n: int) -> np.ndarray:
        """Read `n` rows of a variable's last indexed axis from index `start`.

        Raises
        ------
        DamagedError
            If the file ends inside them.
        """
        offset, size, shape, dtype = self.offsets.extent(variable, start, n)
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

    offsets = None

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
                self._path,
                f"variable {variable} cannot be unpacked; put a whole copy in its place",
            ) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def is_packed(path: Path) -> bool:
    """Return whether a campaign file is packed."""
    with open_for_reading(path) as file:
        return file["commit"].chunks is not None


RowReader = ContiguousRows | PackedRows


def open_rows(path: Path) -> RowReader:
    """Open a plain or packed campaign file for reading rows."""
    return PackedRows(path) if is_packed(path) else ContiguousRows(path)
