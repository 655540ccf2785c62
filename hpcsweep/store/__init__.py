"""The campaign file: the only package that knows its layout and that imports h5py.

`layout` names its variables, `contents` creates it, hashes all but results and compares it with the
layout, `rows` reads it and writes into it from every rank, `opening` opens it and returns it as a
dataset, `commit` decides which results are valid, `frames` reads them one frame at a time, `reuse`
copies them from earlier files, `copying` all parts of a job into one file, or one into a compressed
one, `inputs` reads motions and curves of others, `lock` keeps a second campaign out, `journal`
keeps the history beside it.
"""

from hpcsweep.store.commit import open_campaign as open_campaign
from hpcsweep.store.contents import create as create
from hpcsweep.store.copying import merge as merge
from hpcsweep.store.copying import pack as pack
from hpcsweep.store.frames import Frames as Frames
from hpcsweep.store.frames import Grid as Grid
from hpcsweep.store.inputs import with_inputs as with_inputs
from hpcsweep.store.journal import Journal as Journal
from hpcsweep.store.layout import DamagedError as DamagedError
from hpcsweep.store.layout import Layout as Layout
from hpcsweep.store.layout import StoreError as StoreError
from hpcsweep.store.layout import WriteError as WriteError
from hpcsweep.store.lock import Lock as Lock
from hpcsweep.store.opening import job_of as job_of
from hpcsweep.store.opening import layout_problems as layout_problems
from hpcsweep.store.opening import meanings as meanings
from hpcsweep.store.opening import open_layout as open_layout
from hpcsweep.store.opening import open_results as open_results
from hpcsweep.store.opening import read_layout as read_layout
from hpcsweep.store.reuse import Reuse as Reuse
from hpcsweep.store.rows import is_packed as is_packed
