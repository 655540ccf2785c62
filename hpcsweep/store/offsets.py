"""Where the bytes of the file's contiguous variables are."""

import os
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.layout import StoreError


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

    def read(self, descriptor: int, variable: str, start: tuple[int, ...], n: int) -> np.ndarray:
        """Read `n` rows of a variable's last indexed axis from index `start`.

        Raises
        ------
        StoreError
            If the file ends before them.
        """
        _, shape, dtype = self._of[variable]
        shape = (n, *shape[len(start) :])
        size = int(np.prod(shape)) * dtype.itemsize
        data = bytearray()
        offset = self.at(variable, start)
        while len(data) < size:
            piece = os.pread(descriptor, size - len(data), offset + len(data))
            if not piece:
                raise StoreError(f"the file ends inside variable {variable}")
            data += piece
        return np.frombuffer(bytes(data), dtype).reshape(shape)
