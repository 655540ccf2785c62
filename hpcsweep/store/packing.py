"""Pack a campaign file: the same datasets, chunked and compressed, verified equal."""

import contextlib
import io
import math
import os
import shutil
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.job.paths import followed, path_of
from hpcsweep.store.commit import Blocks
from hpcsweep.store.contents import CHECKSUM, chunk_shape, parts_of
from hpcsweep.store.create import fill, reason
from hpcsweep.store.inferred import Inferred
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import Layout, StoreError
from hpcsweep.store.lock import Lock
from hpcsweep.store.offsets import is_packed
from hpcsweep.store.opening import open_layout, reading

COMPRESSION = 4
"""Level of gzip, which every HDF5 library can read."""
LIBRARY = ("v110", "v110")
"""Oldest version of HDF5 that can read a packed file: its chunk indices are smaller than before."""


def pack(path: str | Path, output: str | Path | None = None) -> tuple[int, int]:
    """Write a packed copy of a campaign file, verify it, and only then move it into place.

    The checksums of all committed blocks are verified, then every dataset is read back from the
    copy and compared byte by byte, and so is every attribute.

    Parameters
    ----------
    path : str or Path
    output : str or Path, optional
        Must not exist. By default the packed file replaces `path`, whose job must be complete,
        because a packed file cannot be resumed.

    Returns
    -------
    before, after : int
        Bytes of the two files.

    Raises
    ------
    StoreError
        If there is nothing sound to pack, or the copy cannot be written; `path` is unchanged.
    """
    path = followed(path_of("path", path))
    target = path if output is None else path_of("output", output)
    layout = open_layout(path)
    if is_packed(path):
        raise StoreError(f"{path}: is packed already")
    if output is not None and target.exists():
        raise StoreError(f"{target}: exists already; it is left as it is")
    if not target.parent.is_dir():
        raise StoreError(f"{target}: folder {target.parent} does not exist")
    lock = Lock(path)
    lock.acquire(1)
    try:
        _check_blocks(path, layout, whole=output is None)
        temporary = target.with_name(target.name + ".packing")
        try:
            _copy(path, temporary, layout)
            _verify(path, temporary)
            before, after = path.stat().st_size, temporary.stat().st_size
            if output is not None and Journal(path).path.exists():
                shutil.copyfile(Journal(path).path, Journal(target).path)
            temporary.replace(target)
            _sync(target.parent)
        except OSError as error:
            raise StoreError(f"{target}: cannot be written: {reason(error)}") from None
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    finally:
        lock.release(remove=True)
    return before, after


def _check_blocks(path: Path, layout: Layout, whole: bool) -> None:
    """Make sure that all committed blocks have a checksum that holds, and that `whole` is whole."""
    n_committed = 0
    with Blocks(path, layout) as blocks:
        # in a complete map the points that are not committed are inferred
        inferred = layout.derived and not Inferred(blocks).unknown()
        for task in blocks.begun():
            for block, good in blocks.verify(task):
                if good:
                    n_committed += 1
                elif blocks.committed(block):
                    raise StoreError(
                        f"{path}: damaged (see hpcsweep validate); run its job again, then pack it"
                    )
    n_blocks = math.prod(layout.shape(layout.commit))
    if whole and not inferred and n_committed < n_blocks:
        raise StoreError(
            f"{path}: not complete ({n_blocks - n_committed} of {n_blocks} blocks are missing), "
            "and a packed file cannot be resumed; run it to its end, or pack a copy with -o"
        )


def _copy(path: Path, temporary: Path, layout: Layout) -> None:
    """Write the packed copy and flush it to disk; what cannot be written is not the source's.

    Raises
    ------
    OSError
        If the copy cannot be written.
    """
    with _Written(temporary, "w+") as stream, contextlib.ExitStack() as last:
        last.callback(stream.check)  # before what follows from it
        with reading(path) as source, h5py.File(stream, "w", libver=LIBRARY) as copy:
            # its checksum covers the offsets of the datasets, which differ here
            fill(copy, layout, {k: v for k, v in source.attrs.items() if k != CHECKSUM}, _packed)
            for variable in layout.structures:
                copy[variable.name][...] = source[variable.name][...]
            for variable in layout.stored:
                data, packed = source[variable.name], copy[variable.name]
                for part in parts_of(packed):
                    packed[part] = _part(path, data, part)
                    stream.check()
    _sync(temporary)


class _Written(io.FileIO):
    """A file that keeps the first error of writing, and what comes after it in memory.

    HDF5 may end the process where it cannot write what it still has when it closes a file, or
    reads something else than it wrote.
    """

    def __init__(self, path: Path, mode: str) -> None:
        super().__init__(path, mode)
        self.error: OSError | None = None
        self._beside: list[tuple[int, bytes]] = []

    def write(self, data) -> int:
        """Write bytes."""
        rest = memoryview(data).cast("B")
        size = rest.nbytes
        try:
            while rest.nbytes and self.error is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self.error = error
        if rest.nbytes:
            self._beside.append((self.tell(), bytes(rest)))
            self.seek(rest.nbytes, os.SEEK_CUR)
        return size

    def readinto(self, buffer) -> int:
        """Read bytes, 0 where nothing was written."""
        view, first = memoryview(buffer).cast("B"), self.tell()
        n_read = super().readinto(view) or 0
        view[n_read:] = bytes(view.nbytes - n_read)
        for at, data in self._beside:
            begin, end = max(at, first), min(at + len(data), first + view.nbytes)
            if begin < end:
                view[begin - first : end - first] = data[begin - at : end - at]
        self.seek(first + view.nbytes)
        return view.nbytes

    def truncate(self, size=None) -> int:
        """Set the size."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def check(self) -> None:
        """Raise the first error."""
        if self.error is not None:
            raise self.error


def _part(path: Path, data: h5py.Dataset, part) -> np.ndarray:
    """Read a part of a dataset of the source."""
    try:
        return data[part]
    except Exception as error:
        raise StoreError(f"{path}: cannot be read: {reason(error)}") from None


def _packed(file: h5py.File, name: str, shape: tuple[int, ...], dtype) -> h5py.Dataset:
    """Create a compressed dataset."""
    return file.create_dataset(
        name,
        shape,
        dtype,
        chunks=chunk_shape(shape, np.dtype(dtype).itemsize),
        compression="gzip",
        compression_opts=COMPRESSION,
        shuffle=True,
    )


def _verify(path: Path, temporary: Path) -> None:
    """Compare the copy with the file.

    Raises
    ------
    StoreError
        If anything differs.
    """
    with reading(path) as source, reading(temporary) as copy:
        different = [] if source.keys() == copy.keys() else ["the names of the datasets"]
        left, right = ({**file.attrs, CHECKSUM: ""} for file in (source, copy))
        if left != right:
            different.append("the attributes")
        for name, data in source.items():
            packed = copy[name]
            parts = [()] if data.is_scale else parts_of(packed)
            if data.dtype != packed.dtype or any(
                _bytes(data[part]) != _bytes(packed[part]) for part in parts
            ):
                different.append(name)
    if different:
        raise StoreError(f"{path}: the packed copy differs in {', '.join(different)}; not packed")


def _bytes(values: np.ndarray) -> bytes:
    return b"\0".join(values.flat) if values.dtype == object else values.tobytes()


def _sync(path: Path) -> None:
    """Flush a file or a folder to disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
