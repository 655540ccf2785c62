"""Contents of a campaign file besides its results: their creation, once, in one process, and check.

The checksum tells whether anything differs from what was written; that each dataset has the type
and the size which the job gives it makes it safe to compute.
"""

import contextlib
import hashlib
import math
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.layout import Layout, StoreError, refusing
from hpcsweep.studies.run_names import amount

NOTES = ("units", "long_name", "flag_values", "flag_masks", "flag_meanings")
CHECKSUM = "metadata_checksum"
"""Attribute: the checksum of everything but results; blocks have checksums of their own
(`hpcsweep.store.commit`)."""
STRING = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
"""HDF5's form of a variable-length string in a dataset."""
LONGEST_NAME = 4096
CURVES = "curves_checksum"
"""Attribute of a refined map whose cells known curves cut (`hpcsweep.store.inputs`)."""
CHUNK_BYTES = 2**18
"""Size (bytes) of a chunk before compression: whole rows, then amplitudes, then frames."""
COPY_BYTES = 2**25
"""Most bytes read or copied at once: some hundredths of a second."""
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
    with refusing(path, "created"), removed_at_last(temporary):
        free = shutil.disk_usage(path.parent).free
        need = layout.file_size() + 4 * len(layout.text)
        if need > free:
            raise StoreError(
                f"{path}: the results need {amount(need)}, the file system has {amount(free)} free"
            )
        # HDF5 may crash if there is no space when it closes a file: find out before
        reserve(temporary, 0, need + METADATA)
        with h5py.File(temporary, "w", libver=LIBRARY) as file:
            fill(file, layout, provenance)
        reserve(temporary, 0, temporary.stat().st_size)
        temporary.rename(path)


@contextlib.contextmanager
def removed_at_last(path: Path) -> Iterator[None]:
    """Remove a temporary file after the ``with``, if it is still under this name."""
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()


def reserve(path: Path, begin: int, size: int) -> None:
    """Reserve disk space from a byte on, so that a night's run does not end with a full disk."""
    with path.open("ab") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), begin, size)
        os.fsync(file)


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
        data.attrs.update(layout.notes(variable))
    for variable, values in layout.given:
        file[variable.name][...] = values
    for checksums in (layout.commit, *layout.derived[-1:]):
        file[checksums.name][...] = 0
    file.attrs.update({**layout.attributes, **provenance})
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


def place_of(data: h5py.Dataset) -> int | None:
    """Return the offset of the first byte; None if the dataset is chunked or not allocated."""
    return None if data.chunks is not None else data.id.get_offset()


def scales_of(data: h5py.Dataset) -> list[list[str]]:
    """Return the names of the scales of each axis."""
    return [list(axis.keys()) for axis in data.dims]


def notes_of(data: h5py.Dataset) -> dict[str, object]:
    """Return the attributes that say what the numbers of a dataset mean."""
    return {key: data.attrs[key] for key in NOTES if key in data.attrs}


def metadata_checksum(file: h5py.File) -> str:
    """Hash everything in a campaign file but its results.

    Parameters
    ----------
    file : h5py.File
        The datasets must have the sizes of the job: coordinates are read whole.
    """
    digest = hashlib.blake2b(digest_size=16)

    def add(*values: object) -> None:
        digest.update((repr(values) + "\n").encode(errors="surrogateescape"))

    attributes = dict(file.attrs)
    for key in sorted(attributes):
        if key != CHECKSUM:
            add(key, _plain(attributes[key]))
    for name in sorted(file):
        data = file[name]
        notes = [(key, _plain(note)) for key, note in notes_of(data).items()]
        add(name, str(data.dtype), data.shape, place_of(data), *notes)
        is_text = data.dtype == object
        if data.is_scale or is_text or len(data.shape) == 1:
            values = data[...]
            digest.update(b"\0".join(values.flat) if is_text else values.tobytes())
        if not data.is_scale:
            add(*([f"/{name}" for name in names] for names in scales_of(data)))
    return digest.hexdigest()


def _plain(value: object) -> object:
    """Return a canonical form of an attribute."""
    if isinstance(value, float | np.floating):
        return float(value).hex()
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value if isinstance(value, str) else repr(value)


def chunk_shape(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Choose chunks of about `CHUNK_BYTES`: whole later axes first."""
    room = max(CHUNK_BYTES // itemsize, 1)
    chunks = []
    for length in reversed(shape):
        chunks.append(max(min(length, room), 1))
        room //= chunks[-1]
    return tuple(reversed(chunks))


def parts_of(data: h5py.Dataset) -> Iterator[tuple[int | slice, ...]]:
    """Split a dataset into parts of `COPY_BYTES` at most: an index on the first axes, a slice."""
    row_bytes = [
        math.prod(data.shape[axis + 1 :]) * data.dtype.itemsize for axis in range(data.ndim)
    ]
    axis = next(axis for axis, size in enumerate(row_bytes) if size <= COPY_BYTES)
    step = COPY_BYTES // max(row_bytes[axis], 1)
    for place in np.ndindex(data.shape[:axis]):
        for first in range(0, data.shape[axis], step):
            yield (*place, slice(first, first + step))


def file_problems(file: h5py.File, layout: Layout) -> list[str]:
    """Compare names, types and sizes with the layout, and values that no checksum covers.

    Nothing is read before its size is known to be the layout's.

    Returns
    -------
    list of str
        One line for each difference; empty for a sound file.
    """
    scales = {name: scale.values for name, scale in layout.coordinates.items()}
    forms = {name: (values.dtype, values.shape) for name, values in scales.items()}
    forms |= {v.name: (np.dtype(v.dtype), layout.shape(v)) for v in layout.datasets}
    problems = [line for name, form in forms.items() for line in _form_problems(file, name, *form)]
    problems += [f"{name!s:.60}: not part of the layout" for name in file if name not in forms]
    if problems:
        return problems
    texts = [name for name, values in scales.items() if values.dtype == object]
    problems = [
        f"{name}: its values have no length" for name in texts if not _lengths_are_sane(file[name])
    ]
    return problems + [
        f"{variable.name}: its values are not those of the job"
        for variable, values in layout.given
        if not np.array_equal(file[variable.name][...], values, equal_nan=values.dtype.kind == "f")
    ]


def _form_problems(file: h5py.File, name: str, dtype: np.dtype, shape: tuple) -> list[str]:
    """Compare type and shape of a dataset."""
    if name not in file:
        return [f"{name}: missing"]
    data, problems = file[name], []
    if not isinstance(data, h5py.Dataset):
        return [f"{name}: not a variable"]
    is_text = dtype.kind == "O"
    if h5py.check_string_dtype(data.dtype) is None if is_text else data.dtype != dtype:
        wanted = "string" if is_text else dtype
        problems.append(f"{name}: its type is {data.dtype}, not {wanted}")
    if data.shape != shape:
        problems.append(f"{name}: its shape is {data.shape}, not {shape}")
    return problems


def _lengths_are_sane(scale: h5py.Dataset) -> bool:
    """Return whether the lengths of strings are possible: HDF5 allocates them before it checks.

    A damaged length of 2^32 - 1 costs 4.1 GB and 29 s until h5py reports an error.
    """
    offset = scale.id.get_offset()
    if offset is None:
        return False
    with Path(scale.file.filename).open("rb") as file:
        file.seek(offset)
        raw = file.read(STRING.itemsize * scale.size)
    if len(raw) < STRING.itemsize * scale.size:
        return False
    return bool(np.all(np.frombuffer(raw, STRING)["length"] <= LONGEST_NAME))
