"""The checksum of all that is no result: attributes, coordinates, names, units, places in the file.

What is in the blocks has checksums of its own (`hpcsweep.store.commit`), whose seed is the job's
fingerprint. All else a reader sees is under this one, in the attribute ``metadata_checksum``. Files
of before it have none: they are compared with what their job says (`hpcsweep.store.check`).
"""

import hashlib
from collections.abc import Mapping

import numpy as np

from hpcsweep.store.contents import NOTES, Contents

CHECKSUM = "metadata_checksum"


def metadata_checksum(contents: Contents, attributes: Mapping[str, object] | None = None) -> str:
    """Hash all that a campaign file says beside its results.

    Parameters
    ----------
    contents : Contents
        Its datasets must have the sizes its job gives: coordinates are read whole.
    attributes : mapping, optional
        In place of those of the file.
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
    """Write an attribute so that equal ones are written equally."""
    if isinstance(value, float | np.floating):
        return float(value).hex()
    if isinstance(value, int | np.integer):
        return int(value)
    return value if isinstance(value, str) else repr(value)
