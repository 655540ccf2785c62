"""Contents of an open campaign file besides its results: their form, and their checksum.

The checksum tells whether anything differs from what was written; that each dataset has the type
and the size which the job gives it makes it safe to compute.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from hpcsweep.store.layout import Layout

NOTES = ("units", "long_name")
CHECKSUM = "metadata_checksum"
"""Attribute: the checksum of everything but results; blocks have checksums of their own
(`hpcsweep.store.commit`)."""
PROVENANCE = (
    *("hpcsweep_version", "git_commit", "libraries", "mpi", "hosts", "ranks", "created"),
    "history",
)
"""Attributes of provenance."""
STRING = np.dtype([("length", "<u4"), ("heap", "<u8"), ("index", "<u4")])
"""HDF5's form of a variable-length string in a dataset."""
LONGEST_NAME = 4096
CURVES = "curves_checksum"
"""Attribute of a refined map whose cells known curves cut (`hpcsweep.store.inputs`)."""
OPTIONAL = ("command", "processor", CHECKSUM, CURVES)
"""Optional attributes."""
CHUNK_BYTES = 2**18
"""Size (bytes) of a chunk before compression: whole rows, then amplitudes, then frames."""
COPY_BYTES = 2**25
"""Most bytes read or copied at once: some hundredths of a second."""


def notes_of(data: h5py.Dataset) -> dict[str, object]:
    """Return the attributes ``units`` and ``long_name``, where present."""
    return {name: data.attrs[name] for name in NOTES if name in data.attrs}


def place_of(data: h5py.Dataset) -> int | None:
    """Return the offset of the first byte; None if the dataset is chunked or not allocated."""
    return None if data.chunks is not None else data.id.get_offset()


def scales_of(data: h5py.Dataset) -> list[list[str]]:
    """Return the names of the scales of each axis."""
    return [list(axis.keys()) for axis in data.dims]


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
        notes = [_plain(data.attrs.get(key)) for key in NOTES]
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
    return value if isinstance(value, str) else repr(value)


def chunk_shape(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Choose chunks of about `CHUNK_BYTES`: whole later axes first."""
    room = max(CHUNK_BYTES // itemsize, 1)
    chunks = []
    for length in reversed(shape):
        chunks.append(max(min(length, room), 1))
        room //= chunks[-1]
    return tuple(reversed(chunks))


def parts_of(data: h5py.Dataset) -> Iterator[tuple[slice, ...]]:
    """Split a dataset into parts of about `COPY_BYTES`, of whole chunks if it is packed."""
    axes = data.ndim
    size = [*(data.chunks or chunk_shape(data.shape, data.dtype.itemsize))[:axes]]
    room = COPY_BYTES // CHUNK_BYTES
    for axis in reversed(range(axes)):
        most = -(-data.shape[axis] // size[axis])
        taken = max(min(room, most), 1)
        size[axis] *= taken
        room //= taken
    counts = [-(-data.shape[axis] // size[axis]) for axis in range(axes)]
    for place in np.ndindex(*counts):
        yield tuple(
            slice(i * step, min((i + 1) * step, data.shape[axis]))
            for axis, (i, step) in enumerate(zip(place, size, strict=True))
        )


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
