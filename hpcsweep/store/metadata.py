"""Checksum of everything but results: attributes, coordinates, names, units, offsets.

The blocks have checksums of their own (`hpcsweep.store.commit`), whose seed is the job's
fingerprint. This one, in the attribute ``metadata_checksum``, covers everything else that a reader
sees. A file without it is compared with its job (`hpcsweep.store.check`).
"""

import hashlib
from collections.abc import Mapping

import numpy as np

from hpcsweep.store.contents import NOTES, Contents

CHECKSUM = "metadata_checksum"


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
