"""Where the bytes of the file's contiguous variables are."""

import os
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.layout import StoreError


class Offsets:
    """Byte offset, shape and type of every dataset of a file."""

    def __init__(self, path: Path):
        self._of: dict[str, tuple[int, tuple[int, ...], np.dtype]] = {}
        with h5py.File(path, "r", locking=False) as file:
            for name, data in file.items():
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
