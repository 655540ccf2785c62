"""Contents of an open campaign file besides its results, each item read once.

The comparison with the job and the checksum need the same items, and calls into HDF5 dominate the
cost; where there are many, they bypass the upper layers of h5py.
"""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cached_property

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5i, h5o, h5s, h5t

NOTES = ("units", "long_name")
CHECKSUM = "metadata_checksum"
"""Attribute: the checksum of everything but results. A file without it is compared with its job
(`hpcsweep.store.check`); blocks have checksums of their own (`hpcsweep.store.commit`)."""
CHUNK_BYTES = 2**18
"""Size (bytes) of a chunk before compression: whole rows, then amplitudes, then frames."""
COPY_BYTES = 2**25
"""Most bytes read or copied at once: some hundredths of a second."""


def attribute(owner: h5py.File | h5py.Dataset, name: str) -> object:
    """Read an attribute like h5py, with a short cut for single strings, which most are."""
    found = h5a.open(owner.id, name.encode(errors="surrogateescape"))
    kind = found.get_type()
    if found.shape != () or not (isinstance(kind, h5t.TypeStringID) and kind.is_variable_str()):
        return owner.attrs[name]
    value: np.ndarray = np.empty(1, object)
    found.read(value)
    return value[0].decode(errors="surrogateescape")


def values(file: h5py.File, name: str) -> np.ndarray:
    """Read a dataset of numbers whole."""
    data = h5d.open(file.id, name.encode())
    found = np.empty(data.shape, data.dtype)
    data.read(h5s.ALL, h5s.ALL, found)
    return found


class Dataset:
    """One dataset, read lazily and cached.

    Parameters
    ----------
    data : h5py.Dataset
    scale_names : dict of int to str
        Names of the file's dimension scales by address; extended as others are found.

    Attributes
    ----------
    shape : tuple of int
    dtype : dtype
    is_scale : bool
    """

    def __init__(self, data: h5py.Dataset, scale_names: dict[int, str]):
        self.data = data
        self._scale_names = scale_names
        self.shape: tuple[int, ...] = data.id.shape
        self.dtype: np.dtype = data.id.dtype
        self.is_scale: bool = h5ds.is_scale(data.id)

    @cached_property
    def is_chunked(self) -> bool:
        """Whether the dataset is stored in chunks, as in a packed file."""
        return self.data.chunks is not None

    @cached_property
    def place(self) -> int | None:
        """Offset of the first byte; None if the dataset is chunked or not allocated."""
        return None if self.is_chunked else self.data.id.get_offset()

    @cached_property
    def notes(self) -> dict[str, object]:
        """Attributes ``units`` and ``long_name``, where present."""
        there = [name for name in NOTES if h5a.exists(self.data.id, name.encode())]
        return {name: attribute(self.data, name) for name in there}

    @cached_property
    def scales(self) -> list[list[str]]:
        """Names of the scales of each axis."""
        found: list[list[str]] = []
        for axis in range(len(self.shape)):
            names: list[str] = []
            # without a scale at an axis the iteration would end in an error
            if h5ds.get_num_scales(self.data.id, axis):
                h5ds.iterate(self.data.id, axis, lambda scale, names=names: self._add(scale, names))
            found.append(names)
        return found

    def _add(self, scale: h5d.DatasetID, names: list[str]) -> None:
        # HDF5 searches the file for the name of an object; its address costs nothing
        address = h5o.get_info(scale).addr
        if address not in self._scale_names:
            self._scale_names[address] = (h5i.get_name(scale) or b"").decode(errors="replace")
        names.append(self._scale_names[address].lstrip("/"))

    @cached_property
    def values(self) -> np.ndarray:
        """All values; text as bytes."""
        return self.data[...]


class Contents:
    """Attributes and datasets of an open file.

    Parameters
    ----------
    file : h5py.File

    Attributes
    ----------
    names : list of str
        Names of all datasets.
    """

    def __init__(self, file: h5py.File):
        self._file = file
        self._found: dict[str, Dataset | None] = {}
        self._scale_names: dict[int, str] = {}
        self.names: list[str] = list(file)

    @cached_property
    def attributes(self) -> dict[str, object]:
        """Attributes of the file."""
        return attributes_of(self._file)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Dataset:
        found = self.find(name)
        if found is None:
            raise TypeError(f"{name} is no dataset")
        return found

    def find(self, name: str) -> Dataset | None:
        """Return a dataset; None if the name is not one of a dataset."""
        if name not in self._found:
            opened = h5o.open(self._file.id, name.encode(errors="surrogateescape"))
            if not isinstance(opened, h5d.DatasetID):
                self._found[name] = None
            else:
                data = h5py.Dataset(opened, readonly=True)
                found = self._found[name] = Dataset(data, self._scale_names)
                if found.is_scale:
                    self._scale_names.setdefault(h5o.get_info(opened).addr, name)
        return self._found[name]


def attributes_of(file: h5py.File) -> dict[str, object]:
    """Read all attributes of a file."""
    return {name: attribute(file, name) for name in file.attrs}


def metadata_checksum(contents: Contents, attributes: Mapping[str, object] | None = None) -> str:
    """Hash everything in a campaign file but its results.

    Parameters
    ----------
    contents : Contents
        The datasets must have the sizes of the job: coordinates are read whole.
    attributes : mapping, optional
        Replace those of the file.
    """
    digest = hashlib.blake2b(digest_size=16)

    def add(*values: object) -> None:
        digest.update((repr(values) + "\n").encode(errors="surrogateescape"))

    attributes = contents.attributes if attributes is None else attributes
    for key in sorted(attributes):
        if key != CHECKSUM:
            add(key, _plain(attributes[key]))
    for name in sorted(contents.names):
        data = contents[name]
        notes = (_plain(data.notes[key]) for key in NOTES)
        add(name, str(data.dtype), data.shape, data.place, *notes)
        if data.is_scale or len(data.shape) == 1:
            values = data.values
            is_text = values.dtype == object
            digest.update(b"\0".join(values) if is_text else values.tobytes())
        if not data.is_scale:
            add(*([f"/{name}" for name in names] for names in data.scales))
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
