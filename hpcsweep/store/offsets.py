"""Where the bytes of the file's variables are, and how rows of them are read."""

import os
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.layout import DamagedError, StoreError


def open_for_reading(path: Path) -> h5py.File:
    """Open a file that others may be writing, or that this process has open already.

    Reading needs no lock, and HDF5 refuses a file it already has open with other lock settings.
    """
    try:
        return h5py.File(path, "r", locking=False)
    except OSError as error:
        if "lock" not in str(error):
            raise
        return h5py.File(path, "r")


class Offsets:
    """Byte offset, shape and type of every dataset of a file."""

    def __init__(self, path: Path):
        self._of: dict[str, tuple[int, tuple[int, ...], np.dtype]] = {}
        with open_for_reading(path) as file:
            for name, data in file.items():
                if data.is_scale:
                    continue
                offset = data.id.get_offset()
                if offset is None:
                    raise StoreError(f"{path}: variable {name} has no place in the file")
                self._of[name] = (offset, data.shape, data.dtype)

    def at(self, variable: str, start: tuple[int, ...]) -> int:
        """Return the byte offset of index `start`, later axes at 0."""
        offset, shape, dtype = self._of[variable]
        padded = (*start, *(0,) * (len(shape) - len(start)))
        return offset + int(np.ravel_multi_index(padded, shape)) * dtype.itemsize

    def extent(
        self, variable: str, start: tuple[int, ...], n: int
    ) -> tuple[int, int, tuple[int, ...], np.dtype]:
        """Give offset, bytes, shape and type of `n` rows of a variable from index `start`."""
        _, shape, dtype = self._of[variable]
        shape = (n, *shape[len(start) :])
        return self.at(variable, start), int(np.prod(shape)) * dtype.itemsize, shape, dtype


class ContiguousRows:
    """Rows of the variables of a plain file, read past HDF5: what others write is seen at once."""

    def __init__(self, path: Path):
        self.offsets = Offsets(path)
        self._descriptor = os.open(path, os.O_RDONLY)

    def read(self, variable: str, start: tuple[int, ...], n: int) -> np.ndarray:
        """Read `n` rows of a variable's last indexed axis from index `start`.

        Raises
        ------
        DamagedError
            If the file ends before them.
        """
        offset, size, shape, dtype = self.offsets.extent(variable, start, n)
        data = bytearray()
        while len(data) < size:
            piece = os.pread(self._descriptor, size - len(data), offset + len(data))
            if not piece:
                raise DamagedError(f"the file ends inside variable {variable}")
            data += piece
        return np.frombuffer(bytes(data), dtype).reshape(shape)

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)


class PackedRows:
    """Rows of the variables of a packed file, which nobody writes."""

    offsets = None

    def __init__(self, path: Path):
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
        except OSError:
            raise DamagedError(f"variable {variable} cannot be unpacked") from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def is_packed(path: Path) -> bool:
    """Tell whether a campaign file is packed."""
    with open_for_reading(path) as file:
        return file["commit"].chunks is not None


def open_rows(path: Path) -> ContiguousRows | PackedRows:
    """Open a plain or packed campaign file for reading rows."""
    return PackedRows(path) if is_packed(path) else ContiguousRows(path)
