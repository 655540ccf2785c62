"""Contents of an open campaign file besides its results."""

import hashlib
from collections.abc import Iterator

import h5py
import numpy as np

NOTES = ("units", "long_name")
CHECKSUM = "metadata_checksum"
"""Attribute: the checksum of everything but results. A file without it is compared with its job
(`hpcsweep.store.check`); blocks have checksums of their own (`hpcsweep.store.commit`)."""
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
        notes = [_plain(data.attrs[key]) for key in NOTES]
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
