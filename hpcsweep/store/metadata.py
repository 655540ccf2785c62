"""The checksum of all that is no result: attributes, coordinates, names, units, places in the file.

What is in the blocks has checksums of its own (`hpcsweep.store.commit`), whose seed is the job's
fingerprint. All else a reader sees is under this one, in the attribute ``metadata_checksum``. Files
of before it have none: they are compared with what their job says (`hpcsweep.store.check`).
"""

import hashlib
from collections.abc import Mapping

import h5py
import numpy as np

CHECKSUM = "metadata_checksum"
NOTES = ("units", "long_name")


def metadata_checksum(file: h5py.File, attributes: Mapping[str, object] | None = None) -> str:
    """Hash all that an open campaign file says beside its results.

    Parameters
    ----------
    file : h5py.File
        Its datasets must have the sizes its job gives: coordinates are read whole.
    attributes : mapping, optional
        In place of those of the file.
    """
    digest = hashlib.blake2b(digest_size=16)

    def add(*values: object) -> None:
        digest.update((repr(values) + "\n").encode(errors="surrogateescape"))

    attributes = dict(file.attrs) if attributes is None else attributes
    for key in sorted(attributes):
        if key != CHECKSUM:
            add(key, _plain(attributes[key]))
    for name in sorted(file):
        data = file[name]
        place = data.id.get_offset() if data.chunks is None else None
        add(name, str(data.dtype), data.shape, place, *(_plain(data.attrs[key]) for key in NOTES))
        if data.is_scale or data.ndim == 1:
            values = data[...]
            is_text = values.dtype == object
            digest.update(b"\0".join(values) if is_text else values.tobytes())
        if not data.is_scale:
            add(*([scale.name for scale in dim.values()] for dim in data.dims))
    return digest.hexdigest()


def _plain(value: object) -> object:
    """Write an attribute so that equal ones are written equally."""
    if isinstance(value, float | np.floating):
        return float(value).hex()
    if isinstance(value, int | np.integer):
        return int(value)
    return value if isinstance(value, str) else repr(value)
