"""Create the whole campaign file, once, in one process."""

import contextlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.parallel.one_line import on_one_line
from hpcsweep.store.contents import CHECKSUM, metadata_checksum
from hpcsweep.store.layout import Layout, StoreError, attributes_of
from hpcsweep.studies.run_names import amount

LIBRARY = ("v108", "v108")
"""Oldest version of HDF5 that can read a file."""
METADATA = 2**17
"""Upper bound (bytes) of the names, scales and attributes of a file, without a long job."""


def create(path: Path, layout: Layout, provenance: dict[str, str | int]) -> None:
    """Create the file under a temporary name, reserve its disk space and rename it into place.

    Parameters
    ----------
    path : Path
        Must not exist.
    layout : Layout
    provenance : dict of str to str
        Stored as attributes.

    Raises
    ------
    StoreError
        If the folder cannot be written or has no space.
    """
    temporary = path.with_name(path.name + ".new")
    try:
        free = shutil.disk_usage(path.parent).free
        need = layout.file_size() + 4 * len(layout.text)
        if need > free:
            raise StoreError(
                f"{path}: the results need {amount(need)}, the file system has {amount(free)} free"
            )
        # HDF5 may crash if there is no space when it closes a file: find out before
        _reserve(temporary, need + METADATA)
        with h5py.File(temporary, "w", libver=LIBRARY) as file:
            fill(file, layout, provenance)
        _reserve(temporary, temporary.stat().st_size)
        temporary.rename(path)
    except (OSError, RuntimeError) as error:
        raise StoreError(f"{path}: cannot be created: {reason(error)}") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _reserve(path: Path, size: int) -> None:
    """Reserve disk space, so that a night's run does not end with a full disk."""
    with path.open("ab") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        os.fsync(file)


def reason(error: Exception) -> str:
    """Return the message of the system, or of HDF5, on one line."""
    return getattr(error, "strerror", None) or on_one_line(error)


def fill(
    file: h5py.File,
    layout: Layout,
    provenance: dict[str, str | int],
    allocate: Callable[..., h5py.Dataset] | None = None,
) -> None:
    """Write names, coordinates and attributes, and allocate variables without committed blocks."""
    for name, (values, units, long_name) in layout.coordinates.items():
        if values.dtype == object:
            scale = _texts(file, name, values)
        else:
            scale = _dataset(file, name, values.shape, values.dtype)
            scale[...] = values
        scale.make_scale(name)
        scale.attrs["units"] = units
        scale.attrs["long_name"] = long_name
    for variable in layout.datasets:
        if variable in layout.structures:
            data = _texts(file, variable.name, layout.described)
        else:
            form = layout.shape(variable), variable.dtype
            data = (allocate or _dataset)(file, variable.name, *form)
        for axis, dim in enumerate(variable.dims):
            data.dims[axis].attach_scale(file[dim])
        data.attrs.update(attributes_of(variable, layout.study.structure))
    for variable, values in layout.given:
        file[variable.name][...] = values
    for checksums in (layout.commit, *layout.derived[-1:]):
        file[checksums.name][...] = 0
    for key, value in {**layout.attributes, **provenance}.items():
        file.attrs[key] = value
    file.attrs[CHECKSUM] = metadata_checksum(file)


def _texts(file: h5py.File, name: str, values: np.ndarray) -> h5py.Dataset:
    """Create a dataset of texts."""
    return file.create_dataset(name, data=values, dtype=h5py.string_dtype(), track_times=False)


def _dataset(file: h5py.File, name: str, shape: tuple[int, ...], dtype) -> h5py.Dataset:
    """Create a contiguous dataset, allocated immediately and not filled."""
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return file.create_dataset(name, shape, dtype, dcpl=plist, track_times=False)
