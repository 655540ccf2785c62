"""Split datasets: into the chunks of packed files, and for reading and copying."""

from collections.abc import Iterator

import h5py
import numpy as np

CHUNK_BYTES = 2**18
"""Size (bytes) of a chunk before compression: whole rows, then amplitudes, then frames."""
COPY_BYTES = 2**25
"""Most bytes read or copied at once: some hundredths of a second."""


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
