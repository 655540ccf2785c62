"""The campaign file: the only package that knows its layout and that imports h5py.

`layout` names its variables, `create` creates it, `transport` writes into it from every rank,
`opening` opens it, `contents` reads all but results and hashes it, `check` compares it with the
layout, `repair` restores what follows from the job, `commit` decides which results are valid,
`reader` returns them as a dataset, `frames` one frame at a time, `frame_grid` all of them, `reuse`
copies them from earlier files, `inputs` reads motions and curves of others, `packing` compresses,
`lock` keeps a second campaign out, `journal` keeps the history beside it.
"""

from hpcsweep.store.commit import Campaign, open_campaign
from hpcsweep.store.create import create
from hpcsweep.store.frame_grid import Grid
from hpcsweep.store.frames import Frames
from hpcsweep.store.inputs import with_inputs
from hpcsweep.store.journal import Journal, read_history
from hpcsweep.store.layout import DamagedError, Layout, StoreError, WriteError
from hpcsweep.store.lock import Lock
from hpcsweep.store.offsets import is_packed
from hpcsweep.store.opening import layout_problems, open_layout, read_layout
from hpcsweep.store.packing import pack
from hpcsweep.store.reader import job_of, meanings, open_results
from hpcsweep.store.reuse import Reuse

__all__ = [
    "Campaign",
    "DamagedError",
    "Frames",
    "Grid",
    "Journal",
    "Layout",
    "Lock",
    "Reuse",
    "StoreError",
    "WriteError",
    "create",
    "is_packed",
    "job_of",
    "layout_problems",
    "meanings",
    "open_campaign",
    "open_layout",
    "open_results",
    "pack",
    "read_history",
    "read_layout",
    "with_inputs",
]
