"""The campaign file: the only package that knows its layout and that imports h5py.

`layout` names its variables, `create` makes it, `transport` writes into it from every rank,
`commit` says what of it is believed, `reader` opens it for people, `frames` reads it
in pieces, `lock` keeps a second campaign
out, `journal` keeps the history beside it.
"""

from hpcsweep.store.commit import Campaign, open_campaign
from hpcsweep.store.create import create, file_size
from hpcsweep.store.frames import read_frames
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import StoreError
from hpcsweep.store.lock import Lock
from hpcsweep.store.reader import job_of, open_results, status

__all__ = [
    "Campaign",
    "Journal",
    "Lock",
    "StoreError",
    "create",
    "file_size",
    "job_of",
    "open_campaign",
    "open_results",
    "read_frames",
    "status",
]
