"""The campaign file: the only package that knows its layout and that imports h5py.

`layout` names its variables, `create` makes it, `transport` writes into it from every rank,
`commit` says what of it is believed, `reader` opens it for people, `frames` one frame at a time,
`lock` keeps a second campaign out, `journal` keeps the history beside it.
"""

from hpcsweep.store.commit import Campaign, open_campaign
from hpcsweep.store.create import create, file_size
from hpcsweep.store.frames import Frames
from hpcsweep.store.journal import Journal
from hpcsweep.store.layout import StoreError
from hpcsweep.store.lock import Lock
from hpcsweep.store.reader import open_results, status

__all__ = [
    "Campaign",
    "Frames",
    "Journal",
    "Lock",
    "StoreError",
    "create",
    "file_size",
    "open_campaign",
    "open_results",
    "status",
]
